"""When a movement that is learned again is the one that the library has."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from library_samples import draw_movements

import kineme
from kineme import ActionLibrary
from kineme.library.storage.source import Source
from kineme.orientation import exp


@pytest.fixture
def library(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as actions:
        yield actions


def _source(**options):
    return Source("wave.csv", "0" * 64, 1, options=options)


def _rounded(demos):
    """The same movements, read a little differently."""
    return [movement.positions.astype(np.float32) for movement in demos]


def test_samples_say_more_than_the_place_in_a_file(library):
    """A reader that counts places in another order finds the same movements."""
    demos = draw_movements(3)
    first = library.learn(demos, source=_source(), places=["0", "1", "2"])
    again = library.learn(demos, source=_source(), places=["2", "0", "1"])
    assert again.duplicates == 3
    np.testing.assert_array_equal(again.ids, first.ids)


def test_one_place_is_one_movement_also_within_one_call(library):
    demos = draw_movements(1)
    report = library.learn([demos[0].positions, *_rounded(demos)], source=[_source(), _source()], places=["0", "0"])
    assert (report.added, report.duplicates, report.ids.tolist()) == (1, 1, [1, 1])


def test_the_same_file_read_with_other_options_is_another_source(library):
    demos = draw_movements(2)
    library.learn(demos, source=_source(columns="x,y"), places=["0", "1"])
    assert library.learn(_rounded(demos), source=_source(columns="y,x"), places=["0", "1"]).added == 2


@pytest.mark.parametrize("by", ["samples", "place"])
def test_what_was_deleted_is_learned_anew(library, by):
    demos = draw_movements(2)
    first = library.learn(demos, source=_source(), places=["0", "1"])
    library.delete(first.ids[:1])
    again = library.learn(demos if by == "samples" else _rounded(demos), source=_source(), places=["0", "1"])
    assert (again.added, again.duplicates) == (1, 1)
    assert again.ids[0] not in first.ids
    assert again.ids[1] == first.ids[1]


@pytest.mark.parametrize("origin", [0.0, 5.3, 1.7e9])
@pytest.mark.parametrize("ragged", [False, True])
def test_what_is_read_from_a_library_is_known_to_it(library, ragged, origin):
    """It is stored in single precision, and read in double."""
    demos = draw_movements(20, 3, ragged=ragged)
    demos = kineme.Demonstrations.from_arrays(
        [movement.positions for movement in demos], times=[movement.times + origin for movement in demos]
    )
    ids = library.learn(demos).ids
    for again in (library.movements(), list(library.movements())):
        assert library.learn(again).added == 0
        np.testing.assert_array_equal(library.learn(again).ids, ids)


def _poses(n_samples=40, turn=0.0):
    """A hand that turns while it moves and opens, as a table."""
    t = np.linspace(0, 1, n_samples)
    q = exp(np.column_stack((np.sin(t), t**2, t + turn)))
    table = pd.DataFrame({"t": t, "x": t, "y": t**2, "gripper": 0.08 * (t > 0.5)})
    table[["qw", "qx", "qy", "qz"]] = q
    return table


def test_poses_that_are_read_from_a_library_are_known_to_it(library):
    first, turned = (kineme.Demonstrations.of(_poses(turn=turn)) for turn in (0.0, 0.5))
    library.learn(first)
    assert library.learn(library.movements()).added == 0
    assert library.learn(turned).added == 1


def test_the_same_way_begun_in_another_direction_is_another_movement(library):
    """What is learned of a rotation is told from its start."""
    table = _poses()
    straight, reversed_ = table.copy(), table.copy()
    straight[["qw", "qx", "qy", "qz"]] = (1.0, 0.0, 0.0, 0.0)
    reversed_[["qw", "qx", "qy", "qz"]] = (0.0, 0.0, 0.0, 1.0)
    assert [library.learn(kineme.Demonstrations.of(path)).added for path in (straight, reversed_)] == [1, 1]
