"""Explanations of answers: the movement over its nearest example, where they differ, and the runner-up."""

from __future__ import annotations

import json
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

import kineme
from kineme.errors import SpecificationError
from kineme.library.recognize import LibraryRecognizer


@pytest.fixture(scope="module")
def shapes():
    demos = kineme.load_lasa()
    labels = np.asarray(demos.labels).astype(str)
    chosen = np.isin(labels, ["CShape", "Angle", "Zshape"])
    return demos[chosen], labels[chosen]


def test_a_movement_that_is_its_example_differs_nowhere(shapes):
    demos, labels = shapes
    recognizer = kineme.Recognizer().fit(demos, labels)
    moved = kineme.Demonstrations.from_arrays([3.0 * demos[0].positions + [5.0, -2.0]], times=[demos[0].times])
    explained = recognizer.recognize(moved)[0].explain()
    assert explained.nearest.label == labels[0]
    assert explained.nearest.differences.max() < 1e-6
    np.testing.assert_allclose(explained.nearest.path, explained.path, atol=1e-5 * np.ptp(explained.path))
    assert f"the same as an example of {labels[0]}" in explained.in_words


def test_an_example_that_was_turned_is_not_the_same():
    u = np.linspace(0, 1, 60)
    swipe = np.column_stack((u, 0.1 * np.sin(np.pi * u)))
    demos = [kineme.Trajectory(u, size * swipe) for size in (0.9, 1.0, 1.1, -0.9, -1.0, -1.1)]
    explained = kineme.Recognizer().fit(demos, ["right"] * 3 + ["left"] * 3).recognize(demos[1]).explain()
    assert explained.nearest.turned == pytest.approx(0.0, abs=1e-6)
    assert abs(explained.runner_up.turned) == pytest.approx(180.0, abs=1e-6)
    assert "the same as an example of right;" in explained.in_words
    assert re.search(r"an example of left turned by -?180 degrees$", explained.in_words)
    assert explained.to_dict()["runner_up"]["turned"] == explained.runner_up.turned


def test_where_a_movement_leaves_its_example_is_said(shapes):
    """A bump of a third of the size at three fifths of the path."""
    demos, labels = shapes
    recognizer = kineme.Recognizer().fit(demos, labels)
    demo = demos[0]
    u = np.linspace(0, 1, len(demo.times))
    size = np.sqrt(demo.positions.var(axis=0).sum())
    bump = 0.5 * size * np.exp(-0.5 * ((u - 0.6) / 0.04) ** 2)
    bent = demo.positions + bump[:, None] * [0.0, 1.0]
    explained = recognizer.recognize(kineme.Trajectory(demo.times, bent)).explain()
    first, last = explained.nearest.where
    assert first > 0.3
    assert last < 0.95
    assert explained.nearest.differences.max() > 0.2
    assert f"{100 * first:.0f} to {100 * last:.0f} % of the path" in explained.in_words


def test_the_runner_up_is_the_next_class_and_less_alike(shapes):
    demos, labels = shapes
    answer = kineme.Recognizer().fit(demos[::2], labels[::2]).recognize(demos[1])
    explained = answer.explain()
    assert explained.runner_up.label == answer.ranked[1]
    assert explained.nearest.similarity == answer.nearest[0].similarity > explained.runner_up.similarity
    data = json.loads(json.dumps(explained.to_dict()))
    assert data["nearest"]["label"] == answer.ranked[0]
    assert len(data["runner_up"]["differences"]) == len(data["path"]) == 199


def test_of_one_class_there_is_no_runner_up(shapes):
    demos, labels = shapes
    own = labels == "Angle"
    explained = kineme.Recognizer().fit(demos[own], labels[own]).recognize(demos[own][0]).explain()
    assert explained.runner_up is None
    assert len(explained.plot().axes) == 2


@pytest.mark.parametrize("n_dims", [1, 2, 3, 6])
def test_every_number_of_dimensions_is_drawn(make_movement, n_dims):
    arrays = [make_movement(seed, n_dims)[1] for seed in (0, 1, 0, 1)]
    recognizer = kineme.Recognizer().fit(arrays[:2], ["a", "b"])
    figure = recognizer.recognize(arrays[2]).explain().plot()
    assert [axes.get_title().split(",")[0] for axes in figure.axes[:2]] == ["nearest: a", "next in rank: b"]


def read_columns(folder, heads, arrays):
    """Recordings with these columns, as they are read from files."""
    folder.mkdir()
    for i, x in enumerate(arrays):
        table = np.column_stack((np.linspace(0, 2, len(x)), x))
        np.savetxt(folder / f"{i}.csv", table, delimiter=",", header=",".join(["time", *heads]), comments="")
    return kineme.read_recordings(folder).demonstrations


def test_each_point_is_drawn_apart_and_the_farthest_is_named(make_movement, tmp_path):
    heads = [f"{side}_hand_{axis} [m]" for side in ("left", "right") for axis in "xyz"]
    arrays = [make_movement(seed, 6)[1] for seed in (0, 1)]
    u = np.linspace(0, 1, len(arrays[0]))[:, None]
    dent = 0.4 * np.ptp(arrays[0]) * np.exp(-0.5 * ((u - 0.5) / 0.1) ** 2) * [0, 0, 0, 0, 0, 1]
    demos = read_columns(tmp_path / "hands", heads, [*arrays, arrays[0] + dent])
    explained = kineme.Recognizer().fit(demos[:2], ["a", "b"]).recognize(demos[2]).explain()
    assert explained.nearest.part == "right_hand"
    assert "of its size, most in right_hand; " in explained.in_words
    assert explained.to_dict()["nearest"]["part"] == "right_hand"
    assert explained.to_dict()["columns"] == heads
    figure = explained.plot()
    panels = figure.axes[:4]
    assert [axes.get_title().split("\n")[-1] for axes in panels] == ["left_hand"] * 2 + ["right_hand"] * 2
    assert all(axes.get_xlabel().startswith("mostly ") and axes.get_ylabel() in {f"mostly {h}" for h in heads}
               for axes in panels)  # fmt: skip
    for left, right in (panels[:2], panels[2:]):
        assert (left.get_xlim(), left.get_ylim()) == (right.get_xlim(), right.get_ylim())
    assert np.ptp(panels[0].get_xlim()) == pytest.approx(np.ptp(panels[2].get_xlim()))
    figure.canvas.draw()
    (legend,) = figure.legends
    assert legend.get_window_extent().y1 <= min(axes.get_window_extent().y0 for axes in panels)


def test_columns_that_are_no_points_are_curves_with_their_names(make_movement, tmp_path, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # eight columns are compiled apart
    heads = [f"joint{k} [deg]" for k in range(8)]
    demos = read_columns(tmp_path / "joints", heads, [10 * make_movement(seed, 8)[1] for seed in (0, 1, 2)])
    explained = kineme.Recognizer().fit(demos[:2], ["a", "b"]).recognize(demos[2]).explain()
    figure = explained.plot()
    assert "6 of 8 columns" in figure.get_suptitle()
    assert {axes.get_ylabel() for axes in figure.axes[:12]} < {*explained.columns}
    assert explained.nearest.part in explained.columns


def test_a_signal_is_drawn_over_time_with_its_name(make_movement, tmp_path):
    demos = read_columns(tmp_path / "signals", ["force [N]"], [make_movement(seed, 1)[1] for seed in (0, 1)])
    explained = kineme.Recognizer().fit(demos, ["a", "b"]).recognize(demos[0]).explain()
    axes = explained.plot().axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("share of the time", "force [N]")
    assert "% of the time, " in explained.in_words
    assert explained.nearest.part is None


def test_what_was_written_in_space_is_drawn_as_written(make_movement):
    """In x and z, as on a wall: x to the right and z up, not mirrored nor on its side."""
    plane = [make_movement(seed, 2)[1] for seed in (0, 1)]
    arrays = [np.column_stack((x, 0.01 * np.arange(len(x)) / len(x), z)) for x, z in (path.T for path in plane)]
    axes = kineme.Recognizer().fit(arrays, ["a", "b"]).recognize(arrays[0]).explain().plot().axes[0]
    pieces = np.array(axes.collections[0].get_segments())
    drawn, written = pieces[-1, 1] - pieces[0, 0], plane[0][-1] - plane[0][0]
    np.testing.assert_allclose(drawn, written, atol=0.02 * np.abs(written).max())


def test_an_answer_from_another_process_says_what_it_lacks(shapes):
    demos, labels = shapes
    answer = pickle.loads(pickle.dumps(kineme.Recognizer().fit(demos, labels).recognize(demos[0])))
    assert answer.label == labels[0]
    with pytest.raises(SpecificationError, match="without its movements; recognize the movement again"):
        answer.explain()
    assert replace(answer, confidence=0.5).transform.angle == answer.transform.angle  # computed before it was sent


def test_what_an_answer_computes_later_is_of_the_movement_that_was_asked(shapes):
    demos, labels = shapes
    block = np.stack([movement.positions[::4][:20] for movement in demos[:3]])
    recognizer = kineme.Recognizer().fit(demos, labels)
    expected, answers = recognizer.recognize(block.copy()), recognizer.recognize(block)
    block[:] = 0.0
    np.testing.assert_array_equal(answers[1].transform.matrix, expected[1].transform.matrix)
    np.testing.assert_array_equal(answers[2].explain().path, expected[2].explain().path)


def test_a_large_library_explains_too(shapes, tmp_path):
    demos, labels = shapes
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos, labels)
        answer = LibraryRecognizer(library.store, exhaustive=10).recognize(demos[3:4])[0]
        explained = answer.explain()
    np.testing.assert_allclose(answer.transform.scale, 1.0, atol=1e-3)  # the library is closed
    assert explained.nearest.label == labels[3]
    assert explained.nearest.differences.max() < 1e-3
