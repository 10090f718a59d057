"""Widgets in Python: what they hold of what was drawn and moved, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme.errors import DataError, SpecificationError, TrajectoryError

pytest.importorskip("anywidget", reason="the extra notebook is not installed")
from widget_samples import demonstrations

from kineme.notebook import Draw, Move

SAMPLES = [[0.1 * k, 0.2 * k, 1 - 0.1 * k] for k in range(5)]


def test_what_was_drawn_is_movements_with_names_in_the_unit_of_the_area():
    draw = Draw(height=2.0)
    heard = []
    draw.observe(heard.append, "drawn")
    draw.drawn = [["wave", SAMPLES], [None, SAMPLES[:4]]]
    first, last = draw.trajectories
    np.testing.assert_allclose(first.times, [0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(first.positions[-1], [1.6, 1.2])
    assert (first.label, last.label, len(draw.trajectory), len(heard)) == ("wave", None, 4, 1)
    draw.clear()
    assert draw.trajectories == []
    with pytest.raises(DataError, match="expected a movement, got none yet"):
        _ = draw.trajectory


def test_the_recognizer_answers_to_what_was_drawn():
    demos = demonstrations()
    draw = Draw(kineme.Recognizer().fit(demos))
    movement = kineme.load_lasa(["Sine"])[6]
    draw.drawn = [[None, np.column_stack((movement.times, movement.positions)).tolist()]]
    assert draw.answer.ranked[0] == "Sine"
    np.testing.assert_allclose(draw.trajectory.positions, movement.positions)
    with pytest.raises(SpecificationError, match=r"Draw\(recognizer\)"):
        _ = Draw().answer


def test_a_library_is_taken_as_its_page_takes_it(tmp_path):
    demos = demonstrations()
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos)
        assert '"n_movements":6,' in Draw(library, most=6)._page


def test_a_primitive_is_where_it_was_learned_until_it_is_dragged():
    primitives = kineme.DMP().learn(demonstrations()[[0, 3, 4]])
    move = Move(primitives)
    np.testing.assert_allclose(move.goal, primitives.goals[0])
    np.testing.assert_allclose(move.path.positions, primitives[0].rollout(n_samples=len(move.path)).positions[0])
    assert (move.moved["name"], move.primitive.labels.tolist()) == ("1 CShape", ["CShape"])
    move.moved = move.moved | {"name": "3 GShape", "goal": [1.0, 2.0]}
    np.testing.assert_allclose(move.primitive.goals, primitives[2].goals)
    assert move.goal.tolist() == [1.0, 2.0]
    assert Move(kineme.DMP().learn(demonstrations()[[0, 3]])).moved["name"] == "CShape"
    with pytest.raises(DataError, match="expected a movement in the cell"):
        _ = Draw().goal


def test_the_path_has_the_label_and_the_name_of_its_primitive():
    demos = demonstrations()[[0, 1]]
    path = Move(kineme.DMP().learn(demos)).path
    assert (path.label, path.name) == ("CShape", demos.names[0])
    numbers = kineme.Demonstrations.from_arrays([movement.positions for movement in demos], [3, 4])
    assert Move(kineme.DMP().learn(numbers)).path.label == 3
    assert Move(kineme.DMP().learn(demos[0].positions)).path.label is None


def test_a_movement_is_placed_from_python():
    move = Move(kineme.DMP().learn(demonstrations()[[0, 3]]))
    via = [[0.5, (move.path.positions[100] + [3.0, 1.0]).tolist()]]
    move.moved = move.moved | {"name": "GShape", "via": via}
    move.place(goal=[5.0, 6.0], start=(-20, 1))
    assert (move.goal.tolist(), move.start.tolist(), move.moved["via"]) == ([5.0, 6.0], [-20.0, 1.0], via)
    path, primitive = move.path, move.primitive
    expected = primitive.rollout(start=[-20, 1], goal=[5, 6], via=[(0.5, via[0][1])], n_samples=len(path))
    np.testing.assert_allclose(path.positions, expected.positions[0])
    before = move.moved
    with pytest.raises(TrajectoryError, match="goal of shape"):
        move.place(goal=[1.0, 2.0, 3.0])
    with pytest.raises(TrajectoryError, match="of one movement, got 2 of them"):
        move.place(goal=[[1.0, 2.0], [3.0, 4.0]])
    assert move.moved == before


def test_what_cannot_be_drawn_is_refused():
    wide = kineme.Demonstrations.from_arrays([np.random.default_rng(k).normal(size=(20, 4)) for k in range(3)])
    with pytest.raises(SpecificationError, match="got 4 dimensions, which cannot be drawn"):
        Move(kineme.DMP().learn(wide))
    with pytest.raises(SpecificationError, match="got 4 dimensions, which cannot be drawn"):
        Draw(kineme.Recognizer().fit(wide, ["a", "b", "c"]))
    with pytest.raises(SpecificationError, match="expected at most 100 primitives"):
        Move(kineme.DMP().learn([demonstrations()[0]] * 101))
    with pytest.raises(SpecificationError, match="height"):
        Draw(height=0)
