"""Labels are objects or numbers: of no fixed width, never both, and none is lost on the way to an answer."""

from __future__ import annotations

import enum
import tracemalloc
from unicodedata import normalize

import numpy as np
import pytest

import kineme
from kineme import Demonstrations, Recognizer, Trajectory
from kineme.errors import TrajectoryError
from kineme.movements.tables.layout import Layout
from kineme.movements.trajectories.labels import label_array
from recordings_in_bytes import read_recordings_from_bytes

X = np.arange(20.0)[:, None] ** [1, 2]
T = np.arange(20.0)


class Act(str, enum.Enum):  # noqa: UP042 - its str() is not its text
    WAVE = "wave"


@pytest.mark.parametrize(
    "labels",
    [
        ["wave", "nod"],
        ("wave", "nod"),
        np.array(["wave", "nod"]),
        [np.str_("wave"), "nod"],
        np.array(["wave", "nod"], dtype=object),
        np.array(["wave", "nod"], dtype=np.dtypes.StringDType()),
        [Act.WAVE, "nod"],
    ],
    ids=["list", "tuple", "fixed width", "numpy text", "objects", "strings", "enum"],
)
def test_texts_become_plain_objects(labels):
    found = Demonstrations.from_arrays([X, X], labels).labels
    assert found.dtype == object
    assert found.tolist() == ["wave", "nod"]
    assert {type(one) for one in found} == {str}
    assert not found.flags.writeable


@pytest.mark.parametrize("labels", [[3, 5], np.array([3, 5], np.uint8), [0.5, 1.5], [True, False], [2**80, 1]])
def test_numbers_stay_numbers(labels):
    found = Demonstrations.from_arrays([X, X], labels).labels
    assert found.dtype == np.asarray(labels).dtype
    assert found.tolist() == np.asarray(labels).tolist()


def test_whole_numbers_of_64_bits_stay_exact():
    labels = [5, 2**63 + 5, np.uint64(2**63 + 9), -1]
    movements = [np.random.default_rng(k).normal(size=(20, 2)).cumsum(axis=0) for k in range(4)]
    for classifier in ("auto", "svm"):
        known = Recognizer(classifier=classifier).fit(movements, labels)
        assert known.classes_.tolist() == sorted(map(int, labels))


def test_labels_that_look_the_same_are_one_class_spelled_as_the_first():
    composed, decomposed = (normalize(form, "caf\u00e9") for form in ("NFC", "NFD"))
    movements = [np.random.default_rng(k).normal(size=(20, 2)).cumsum(axis=0) for k in range(4)]
    for first, second in ((composed, decomposed), (decomposed, composed)):
        known = Recognizer().fit(movements, [first, second, "b", "b"])
        assert known.classes_.tolist() == sorted(["b", first])
        assert known.score(movements[:2], [second, first]) == 1


def test_the_labels_of_the_caller_are_not_ours():
    given = np.array(["wave", "nod"], dtype=object)
    demos = Demonstrations.from_arrays([X, X], given)
    given[0] = "bow"
    assert demos.labels.tolist() == ["wave", "nod"]


def test_labels_that_differ_in_trailing_nuls_stay_different():
    demos = Demonstrations.from_arrays([X, X, X**2, X**2], ["a", "a", "a\0", "a\0"])
    assert len(np.unique(demos.labels)) == 2
    learned = kineme.DMP().learn(demos)
    assert learned[2:].labels.tolist() == ["a\0", "a\0"]
    assert Recognizer().fit(demos).classes_.tolist() == ["a", "a\0"]
    assert Recognizer().fit(demos).predict(demos).tolist() == ["a", "a", "a\0", "a\0"]


@pytest.mark.soak
def test_one_long_label_costs_its_own_length(tmp_path):
    long = "x" * 2**20
    lines = ["movement,label,t,x"]
    lines += [
        f"{i},{long if i == 7 and k == 0 else 'ab'[i % 2]},{k},{k * (i + 1)}" for i in range(200) for k in range(5)
    ]
    data = "\n".join(lines).replace("7,b,", f"7,{long},").encode()
    tracemalloc.start()
    recordings = read_recordings_from_bytes(data, "long.csv", Layout())
    demos = recordings.demonstrations
    kept = Demonstrations(list(demos))[np.arange(len(demos))]
    learned = kineme.DMP(n_basis=5).learn(kept)
    kineme.dmp.Primitives.concatenate([learned, learned]).save(tmp_path / "learned")
    assert kineme.dmp.Primitives.load(tmp_path / "learned").labels[7] == long
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert kept.labels.dtype == object
    assert peak < 150 * 2**20  # 200 labels of fixed width take 800 MiB


MIXED = {
    "a text and a number": (
        ["a", 1],
        "trajectory 1: expected labels that are all texts or all numbers, got 1 beside 'a'",
    ),
    "a number and a text": ([1.5, "a"], "trajectory 1: expected labels that are all texts .* got 'a' beside 1.5"),
    "nan": ([1.0, np.nan], "trajectory 1: expected a label, got nan, which names none"),
    "nan in an array": (np.array([np.nan, 1.0]), "trajectory 0: expected a label, got nan"),
    "nan among texts": (["a", float("nan")], "trajectory 1: expected a label, got nan"),
    "a text": ("ab", "expected one label for each of the 2 movements"),
    "none": (["a", None], "expected a label on every movement or on none, got none on trajectory 1"),
}


@pytest.mark.parametrize(("labels", "words"), MIXED.values(), ids=MIXED)
def test_labels_that_name_no_class(labels, words):
    with pytest.raises(TrajectoryError, match=words):
        Demonstrations.from_arrays([X, X**2], labels)
    with pytest.raises(TrajectoryError, match=words):
        Recognizer().fit(Demonstrations.from_arrays([X, X**2]), labels)


class Sign(enum.Enum):
    STOP = 1
    GO = 2


@pytest.mark.parametrize("labels", [[b"a", b"b"], np.array([b"a", b"b"]), np.array(["2024", "2025"], "M8[Y]")])
def test_other_labels_are_kept_as_they_are(labels):
    assert Demonstrations.from_arrays([X, X**2], labels).labels.tolist() == list(np.asarray(labels).tolist())


@pytest.mark.parametrize("labels", [[Sign.STOP, Sign.GO], [{"a"}, "b"], [("a", 1), None]])
def test_classes_have_an_order(labels):
    with pytest.raises(TrajectoryError, match="expected"):
        Recognizer().fit(Demonstrations.from_arrays([X, X**2]), labels)


@pytest.mark.parametrize("labels", [("a", 1), (np.nan, 1.0)])
def test_the_same_on_single_movements(labels):
    with pytest.raises(TrajectoryError, match=r"trajectory . \('m.'\): expected"):
        Demonstrations([Trajectory(T, X, label, f"m{k}") for k, label in enumerate(labels)])


def test_no_labels_at_all_are_no_labels():
    assert label_array([], 0).shape == (0,)
    with pytest.raises(TrajectoryError, match="expected one label for each of the 2 movements"):
        label_array([], 2)
