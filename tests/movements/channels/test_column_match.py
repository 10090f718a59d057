"""Columns of one recording beside those of another: matched by names, in their order and units."""

import numpy as np
import pytest

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.column_match import Columns, columns_like, may_be

ROWS = np.arange(12.0).reshape(4, 3)


def columns(heads, units=None):
    heads = tuple(heads.split())
    return Columns(heads, units or (None,) * len(heads))


def channels(names, kinds="position"):
    return tuple(Channel(name, kind, (name,)) for name, kind in zip(names.split(), 3 * kinds.split(), strict=False))


def test_columns_are_ordered_and_converted_and_what_was_recorded_stays():
    recorded = ROWS.copy()
    for heads, order in (("z x y", [1, 2, 0]), ("x y z", [0, 1, 2])):
        found = columns_like(recorded, columns(heads, ("m",) * 3), columns("X Y Z", ("cm",) * 3))
        np.testing.assert_allclose(found, 100 * ROWS[:, order])
        np.testing.assert_array_equal(recorded, ROWS)


def test_heads_that_only_units_tell_apart_keep_them():
    assert Columns(("x [mm]", "y [mm]"), ("mm", "mm")).names == ("x", "y")
    assert Columns(("x [mm]", "x [m]"), ("mm", "m")).names == ("x [mm]", "x [m]")


@pytest.mark.parametrize("axes", ["zyx", "xzy", "yxz", "zx", "yx"])
def test_rotations_about_the_same_axes_in_another_order_are_other_angles(axes):
    ours = columns(" ".join(f"Hips.{axis}rotation" for axis in axes))
    wanted = columns(" ".join(f"hips.{axis}rotation" for axis in "zxy" if axis in axes))
    if [*ours.rotations.values()] == [*wanted.rotations.values()]:
        columns_like(ROWS[:, : len(axes)], ours, wanted)
    else:
        with pytest.raises(TrajectoryError, match=rf"in the order {wanted.rotations['hips']}, .* got {axes}"):
            columns_like(ROWS[:, : len(axes)], ours, wanted)


@pytest.mark.parametrize(
    ("ours", "others", "expected"),
    [
        (channels("x y z"), channels("hand_x hand_y hand_z"), True),
        (channels("x y z"), channels("hand_y hand_x hand_z"), False),
        (channels("x y"), channels("hand_x hand_y", "angle position"), False),
        (channels("x y"), channels("hand_x hand_y hand_z"), False),
        (channels("hand_x hand_y"), channels("foot_x foot_y"), False),
        (channels("x1 x2"), channels("foot_x foot_y"), True),
    ],
)
def test_bare_axes_may_be_those_of_a_hand_in_their_order_and_kind(ours, others, expected):
    assert may_be(ours, others) == may_be(others, ours) == expected
