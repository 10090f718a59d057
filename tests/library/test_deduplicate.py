"""When a movement that is learned again is the one that the library has."""

from __future__ import annotations

import numpy as np
import pytest
from library_samples import draw_movements

from kineme import ActionLibrary
from kineme.library.storage.source import Source


@pytest.fixture
def library(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as made:
        yield made


def _source(**options):
    return Source("wave.csv", "0" * 64, 1, options=options)


def _rounded(demos):
    """The same movements, read a little differently."""
    return [one.positions.astype(np.float32) for one in demos]


def test_samples_say_more_than_the_place_in_a_file(library):
    """A reader that counts places in another order finds the same movements."""
    demos = draw_movements(3)
    first = library.learn(demos, source=_source(), places=["0", "1", "2"])
    again = library.learn(demos, source=_source(), places=["2", "0", "1"])
    assert again.known == 3
    np.testing.assert_array_equal(again.ids, first.ids)


def test_one_place_is_one_movement_also_within_one_call(library):
    demos = draw_movements(1)
    report = library.learn([demos[0].positions, *_rounded(demos)], source=[_source(), _source()], places=["0", "0"])
    assert (report.added, report.known, report.ids.tolist()) == (1, 1, [1, 1])


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
    assert (again.added, again.known) == (1, 1)
    assert again.ids[0] not in first.ids
    assert again.ids[1] == first.ids[1]
