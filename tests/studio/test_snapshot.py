"""Snapshots: what a page holds of a library, how large it is, and what is refused."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from node_runtime import NODE, REASON, ask, question

import kineme
from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channel
from kineme.movements.preparation import pauses
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import of_channels
from kineme.recognition import conformal
from kineme.recognition.early import evidence, hypotheses
from kineme.studio.snapshot import MOST_NUMBERS, snapshot_of_library, snapshot_of_recognizer
from movement_samples import draw_shapes, turn
from soaking import SOAK

RUNTIME = Path(kineme.__file__).parent / "studio" / "javascript"
HOSTILE = "</script><script>alert(1)</script>"


def library_of(folder, demos, names=None, **options):
    library = kineme.ActionLibrary(folder, create=True, **options)
    library.learn(demos, [names[label] if names else label for label in demos.labels])
    return library


def test_arrays_are_written_whole_and_in_order():
    snapshot = snapshot_of_recognizer(kineme.Recognizer().fit(draw_shapes([2, 3])))
    document = json.loads(snapshot.to_json())
    block = b64decode(document["data"])
    for name, (kind, offset, length) in document["arrays"].items():
        array = np.frombuffer(block, kind, length, offset)
        np.testing.assert_array_equal(array, snapshot.arrays[name].ravel(), err_msg=name)
        assert offset % 8 == 0


def test_numbers_that_are_tuned_come_from_python_alone():
    """The runtime reads each of them from the header, under its name, and has no constant of that name.

    The exponent is fitted, and the guesses are names of rules.
    """
    header = snapshot_of_recognizer(kineme.Recognizer().fit(draw_shapes([2, 3]))).header
    groups = {
        "pauses.js": (header["comparison"]["pauses"], [pauses]),
        "recognition.js": (header["calibration"], [conformal]),
        "evidence.js hypotheses.js": (header["early"]["numbers"], [evidence, hypotheses]),
    }
    for files, (numbers, modules) in groups.items():
        constants = {name: value for module in modules for name, value in vars(module).items() if name.isupper()}
        text = "".join((RUNTIME / file).read_text() for file in files.split())
        shared = [name for name in numbers if name.upper() in constants and name not in ("exponent", "guesses")]
        assert len(shared) >= 6
        for name in shared:
            assert numbers[name] == constants[name.upper()], name
            assert re.search(rf"\b{name}\b", text), name
            assert not re.search(rf"\bconst {name.upper()}\b", text), name


def test_names_cannot_end_the_script_element(tmp_path):
    demos = draw_shapes([1, 1])
    names = dict(zip(np.unique(demos.labels), [HOSTILE, "__proto__"], strict=True))
    with library_of(tmp_path / "actions", demos, names) as library:
        text = snapshot_of_library(library).to_json()
    assert "<" not in text
    assert set(json.loads(text)["classes"]) == {HOSTILE, "__proto__"}


def compare_answers(snapshot, movements, said):
    """Compare labels, ranks and similarities of the runtime with those of Python."""
    for got, answer in zip(ask(snapshot, [question("recognize", one) for one in movements]), said, strict=True):
        assert got["label"] == answer.label
        assert [candidate["label"] for candidate in got["ranked"]] == list(answer.ranked)
        assert got["p_known"] == pytest.approx(answer.p_known, abs=1e-5)
        for near, neighbor in zip(got["nearest"], answer.nearest, strict=True):
            assert near["index"] == neighbor.index
            assert near["similarity"] == pytest.approx(neighbor.similarity, abs=1e-5)


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_a_library_answers_in_the_runtime_as_it_does_in_python(tmp_path):
    demos = kineme.load_lasa()
    shown = np.arange(len(demos)) % 7 < 3
    others = demos[~shown][:: 1 if SOAK else 4]
    with library_of(tmp_path / "actions", demos[shown]) as library:
        compare_answers(snapshot_of_library(library), others, library.recognize(others))


@pytest.mark.soak
@pytest.mark.skipif(NODE is None, reason=REASON)
def test_a_library_of_two_hands_answers_in_the_runtime_as_it_does_in_python(tmp_path, monkeypatch):
    """Names of columns tell that they are points."""
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for these alone would take longer than all else
    names = [f"{side}_hand_{axis}" for side in ("left", "right") for axis in "xyz"]
    channels = tuple(Channel(name, "position", (name,)) for name in names)
    hands = Demonstrations.of_movements(replace(draw_shapes([3, 3, 3], 6).movements, channels=channels))
    R = np.kron(np.eye(2), turn(0.5, 3))
    others = [kineme.Trajectory(one.times, one.positions @ R.T) for one in draw_shapes([2, 2, 2], 6, spread=0.2)]
    with library_of(tmp_path / "actions", hands) as library:
        snapshot = snapshot_of_library(library)
        compare_answers(snapshot, others, library.recognize(others))
    assert snapshot.header["comparison"]["rule"]["n_points"] == 2


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_a_library_of_angles_answers_alike_where_they_wrap(tmp_path):
    """Also under way, as an encoder gives them: from -180 to 180 degrees."""
    channels = tuple(Channel(name, "angle", (name,), "deg") for name in ("pan", "lift"))
    shapes = draw_shapes([5, 5, 5], 2, seed=1)
    turned = [100 * one.positions / np.ptp(one.positions) for one in shapes]
    wrapped = [(x - x[:1] + 350) % 360 - 180 for x in turned]
    assert sum(bool((np.abs(np.diff(x, axis=0)) > 300).any()) for x in wrapped) > 5
    rows = Demonstrations.from_arrays(wrapped, list(shapes.labels), [one.times for one in shapes])
    shown = Demonstrations.of_movements(of_channels(rows.movements, channels))
    own = np.arange(15) % 5 < 4
    with library_of(tmp_path / "actions", shown[own]) as library:
        others = [kineme.Trajectory(one.times, wrapped[k]) for k, one in enumerate(shapes) if not own[k]]
        snapshot = snapshot_of_library(library)
        said = [library.recognize(one) for one in others]
        states = [library.stream().update(one.times, one.positions) for one in others]
        compare_answers(snapshot, others, said)
        asked = [question("follow", one, ends=[len(one)]) for one in others]
        for (got,), state in zip(ask(snapshot, asked), states, strict=True):
            assert got["ranked"][0]["label"] == state.ranked[0].label
            np.testing.assert_allclose(got["path"], state.path, atol=1e-2)
        assert len({answer.label for answer in said} - {None}) == 3
    assert snapshot.header["columns"] == [
        {"head": "pan [deg]", "period": 360.0}, {"head": "lift [deg]", "period": 360.0}
    ]  # fmt: skip


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_the_prototype_of_a_symbol_moves(tmp_path):
    demos = draw_shapes([3, 4])
    with library_of(tmp_path / "actions", demos) as library:
        library.annotate("kind 01", prototype=int(library.ids("kind 01")[2]))
        snapshot = snapshot_of_library(library)
        wanted = library.primitives(ids=library.ids("kind 01")[2:3]).rollout(goal=[3.0, 4.0]).positions[0]
    (got,) = ask(snapshot, [{"ask": "rollout", "symbol": "kind 01", "wish": {"goal": [3.0, 4.0]}}])
    np.testing.assert_allclose(got["positions"], wanted, atol=1e-9)


@pytest.mark.soak
def test_a_hundred_symbols_are_below_two_megabytes(tmp_path):
    """Of 12 movements each as many are taken as fit; the answers are those of a library of these."""
    demos = draw_shapes([12] * 100, seed=2, n_samples=30)
    with library_of(tmp_path / "actions", demos) as library:
        snapshot = snapshot_of_library(library)
    assert snapshot.header["n_all"] == 1200
    assert snapshot.header["n_movements"] == 400
    assert snapshot.arrays["paths"].size + snapshot.arrays["detailed rows"].size <= MOST_NUMBERS
    assert np.diff(snapshot.header["first"]).tolist() == [4] * 99
    assert len(snapshot.to_json()) < 1_800_000


def test_of_unequal_symbols_the_large_ones_are_cut(tmp_path):
    demos = draw_shapes([1, 30, 4], seed=2, n_samples=30)
    with library_of(tmp_path / "actions", demos) as library:
        taken = snapshot_of_library(library, most=15).header
        assert taken["first"] == [0, 1, 11]
        assert taken["ids"][:2] == [1, 2]
        assert taken["ids"][10] == 31
        with pytest.raises(SpecificationError, match="at most 2 symbols"):
            snapshot_of_library(library, most=2)


@pytest.mark.parametrize(
    ("settings", "d", "message"),
    [
        ({"classifier": "svm"}, 2, "svm"),
        ({"max_angle": 0.5}, 3, "rotation prior"),
        ({"rotation_prior": None}, 3, "rotation prior"),
    ],
)
def test_what_the_runtime_lacks_is_refused(settings, d, message, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for a refusal takes longer than all else
    recognizer = kineme.Recognizer(**settings).fit(draw_shapes([2, 2], d))
    with pytest.raises(SpecificationError, match=message):
        snapshot_of_recognizer(recognizer)


def test_what_a_refusal_says_to_do_helps(tmp_path):
    demos, recognizer = draw_shapes([2, 2], 3), kineme.Recognizer(max_angle=0.5)
    with (
        kineme.ActionLibrary(tmp_path / "one", create=True, recognizer=recognizer) as library,
        kineme.ActionLibrary(tmp_path / "other", create=True, recognizer=kineme.Recognizer()) as other,
    ):
        library.learn(demos)
        with pytest.raises(SpecificationError, match=r"other\.learn\(library\.movements\(symbol\.name\)\)"):
            snapshot_of_library(library)
        for symbol in library.symbols():
            other.learn(library.movements(symbol.name))
        assert snapshot_of_library(other).header["classes"] == [symbol.name for symbol in library.symbols()]


def test_a_library_without_symbols_is_refused(tmp_path):
    library = kineme.ActionLibrary(tmp_path / "actions", create=True)
    with library, pytest.raises(SpecificationError, match="symbol"):
        snapshot_of_library(library)
