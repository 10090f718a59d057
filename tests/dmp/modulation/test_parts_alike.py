"""Recordings of different things do not become one movement: refused in words, wherever parts come together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme import DMP, Demonstrations, blend, couple, join
from kineme.dmp import Primitives
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel, check_alike
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, PosePrimitives, exp
from kineme.styles import average, learn_styles


def columns(names, kind="position", unit=None):
    return tuple(Channel(name, kind, (name,), unit) for name in names)


HAND, JOINTS = columns("xyz", unit="m"), columns(("j1", "j2", "j3"), "angle", "rad")
GRIPPER = Channel("gripper", "discrete", ("gripper",))
ORIENTATION = Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz")


def recorded(channels, n=3, dmp=None):
    u = np.linspace(0, 1, 80)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    blocks = []
    for i in range(n):
        parts = []
        for k, one in enumerate(channels):
            if one.kind == "orientation":
                parts.append(exp(np.outer(s, [0.2 * i, 0.5, 1.0])))
            else:
                parts.append((s * (k + 1) + 0.1 * (i + 1) * np.sin((2 + k) * s))[:, None])
        blocks.append(np.concatenate(parts, axis=1))
    plain = Demonstrations.from_arrays(blocks, times=[2.0 * u] * n)
    return (dmp or DMP(n_basis=20)).learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))


TOGETHER = {
    "join": lambda one, other: join([one[0], other[0]]),
    "join of rollouts": lambda one, other: join([one[0].rollout(), other[0].rollout()], shift=True),
    "blend": lambda one, other: blend(one[0], other[0], (0.4, 0.6)),
    "couple": lambda one, other: couple(one[0], other[0], during=(0.4, 0.6)),
    "concatenate": lambda one, other: Primitives.concatenate([one, other]),
    "blend of averages": lambda one, other: average(one).blend(average(other), 0.5),
    "log_likelihood": lambda one, other: average(one).log_likelihood(other, noise=0.1),
    "style_of": lambda one, other: learn_styles(one, 1).style_of(other),
}
each = pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)


@each
@pytest.mark.parametrize(
    ("other", "why"),
    [
        (JOINTS, "their kinds differ"),
        (columns("zyx", unit="m"), "their order differs"),
        (columns("xyz", unit="mm"), "x is in m, x in mm"),
    ],
    ids=["joints", "order", "unit"],
)
def test_what_differs_is_refused_with_both(together, other, why):
    hand = recorded(HAND)
    with pytest.raises(TrajectoryError, match=rf"1: expected .*x \(position\).* got .*{other[0].name} .*: {why}; "):
        together(hand, recorded(other))


@pytest.mark.soak("combinations")
@each
@pytest.mark.parametrize(
    "other",
    [
        HAND,
        columns("xyz", unit="meters"),
        columns("xyz"),
        columns(("left x", "left y", "left z"), unit="m"),
        (*HAND, GRIPPER),
        columns("xyz", "angle"),
    ],
    ids=["same", "unit of another name", "no unit", "other names", "gripper", "kind guessed otherwise"],
)
def test_what_may_be_the_same_goes_together(together, other):
    together(recorded(HAND), recorded(other))
    together(recorded(other), recorded(HAND))


@each
def test_what_is_not_known_goes_together(together):
    plain = DMP(n_basis=20).learn(recorded(HAND).rollout().positions)
    together(plain, recorded(JOINTS))
    together(recorded(JOINTS), plain)


def test_poses_are_compared_by_the_columns_that_are_learned():
    """The orientation is learned last, wherever it was recorded."""
    first, last = recorded((ORIENTATION, *HAND), dmp=PoseDMP()), recorded((*HAND, ORIENTATION), dmp=PoseDMP())
    assert len(PosePrimitives.concatenate([first, last])) == 6
    with pytest.raises(TrajectoryError, match="their kinds differ"):
        PosePrimitives.concatenate([first, recorded((*JOINTS, ORIENTATION), dmp=PoseDMP())])


def test_the_first_whose_channels_are_known_is_compared_with():
    with pytest.raises(TrajectoryError, match=r"^part 2: expected .* as part 1, got "):
        check_alike([None, HAND, JOINTS])


@given(st.permutations(range(6)))
def test_order_counts_where_the_names_are_the_same(order):
    ours = columns("abcdef")
    theirs = tuple(ours[k] for k in order)
    if theirs == ours:
        check_alike([ours, theirs])
    else:
        with pytest.raises(TrajectoryError, match="their order differs"):
            check_alike([ours, theirs])


def test_styles_know_what_was_recorded():
    model = learn_styles(recorded((*HAND, GRIPPER)), 1)
    made = model.primitive([0.0])
    assert model.channels == made.channels == (*HAND, GRIPPER)
    assert made.to_recording is None  # when the gripper steps nobody has shown
    plain = learn_styles(recorded(HAND), 1)
    assert plain.interpolate([-0.5], [0.5], 3).rollout().demonstrations.channels == HAND
    assert kineme.styles.average(plain.interpolate([-0.5], [0.5], 3)).primitive.channels == HAND
    assert learn_styles(DMP(n_basis=20).learn(recorded(HAND).rollout().positions), 1).channels is None
