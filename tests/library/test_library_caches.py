"""Caches that somebody has made to harm, under right checksums: built again, whatever they say."""

from __future__ import annotations

import io
import json
import os
import zlib
from dataclasses import fields

import numpy as np
import pytest
from library_samples import draw_movements

from kineme import ActionLibrary
from kineme.library import calibration_cache
from kineme.library import reduced_features_cache as features_cache
from kineme.library.members import members_of
from kineme.library.recognize import LibraryRecognizer
from kineme.recognition.conformal import EXPONENT, Calibration, calibrate

CODES, CALIBRATION = features_cache.FILE, calibration_cache.FILE
LABELS = [["wave"] * 3 + ["nod"] * 4 + ["bow"] * 5, [f"kind {k}" for k in range(12)]]


def _answers(library):
    answers = LibraryRecognizer(library.store, exhaustive=0).recognize(library.movements())
    return [(a.label, a.ranked, a.confidence, dict(a.p_values), [n.index for n in a.nearest]) for a in answers]


def _expected(library):
    """Answers as they are to be again; rows are single precision, whose products depend on where they lie in memory."""
    return [
        (label, ranked, pytest.approx(confidence, abs=1e-6), pytest.approx(p_values, abs=1e-6), indices)
        for label, ranked, confidence, p_values, indices in _answers(library)
    ]


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A library that has answered, its answers, and its caches."""
    folder = tmp_path_factory.mktemp("served") / "actions"
    with ActionLibrary(folder, create=True) as library:
        library.learn(draw_movements(12, n_samples=12, labels=LABELS[0]))
        expected = _expected(library)
    return folder, expected, {name: (folder / name).read_bytes() for name in (CODES, CALIBRATION)}


def test_classes_that_share_scores_keep_their_own_novelties():
    """A class whose scale is raised has other novelties than one of the same size whose scale is not."""
    scores, novelties, own = np.array([0.2, 0.5]), np.array([0.3, 1.6]), (np.array([0.1]), np.array([0.4]))
    calibration = Calibration(np.array([0.1, 2.0]), own, (scores, scores), own, (novelties, novelties))
    scaled = calibration.with_least_scales(np.array([1.0, 1.0]))
    again = calibration_cache._deserialized(calibration_cache._serialized(scaled, "key"), "key", 2)
    np.testing.assert_array_equal(again.scales, [1.0, 2.0])
    np.testing.assert_array_equal(again.pooled_novelties, [[1.0, 1.6], [0.3, 1.6]])
    np.testing.assert_array_equal(np.concatenate(again.own_novelties), [1.0, 0.4])
    np.testing.assert_array_equal(again.pooled, [scores, scores])


@pytest.mark.parametrize("labels", LABELS)
def test_a_good_cache_is_believed(tmp_path, monkeypatch, labels):
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(draw_movements(12, n_samples=12, labels=labels))
        expected = _expected(library)
        monkeypatch.setattr(calibration_cache, "calibrate_sample", None)
        monkeypatch.setattr(features_cache, "_write", None)
        assert _answers(library) == expected


def test_a_cache_of_other_members_is_not_believed_however_many_they_are(tmp_path):
    """Two movements change places: names and sizes of symbols stay."""
    with ActionLibrary(tmp_path, create=True) as library:
        ids = library.learn(draw_movements(12, n_samples=12, labels=LABELS[0])).ids
        before = _answers(library)
        library.assign(ids[:1], "nod")
        library.assign(ids[4:5], "wave")
        answers = _answers(library)
        (tmp_path / CALIBRATION).unlink()
        assert answers == _answers(library)
        assert answers != before


@pytest.mark.parametrize("name", [CALIBRATION, calibration_cache.FILE_OF_ALL])
def test_a_cache_of_movements_that_a_restored_backup_has_discarded_is_not_believed(tmp_path, monkeypatch, name):
    """The movements that are learned instead have the same ids, names and versions."""
    monkeypatch.setattr(calibration_cache, "_FEW", 12)
    of, answers = 0 if name == CALIBRATION else 12, []
    ActionLibrary(tmp_path, create=True).close()
    backup = (tmp_path / "library.sqlite").read_bytes()
    for seed in (1, 2):
        (tmp_path / "library.sqlite").write_bytes(backup)
        with ActionLibrary(tmp_path) as library:
            library.learn(draw_movements(12, n_samples=12, labels=LABELS[0], seed=seed))
            answers.append(LibraryRecognizer(library.store, exhaustive=of).current().model.calibration.scales)
    (tmp_path / name).unlink()
    with ActionLibrary(tmp_path) as library:
        expected = LibraryRecognizer(library.store, exhaustive=of).current().model.calibration.scales
    np.testing.assert_allclose(answers[1], expected, rtol=1e-5)
    assert (abs(answers[0] - expected) > 1e-3).all()


def _header(data, **changes):
    """Codes with another header, and the checksum that fits."""
    header = json.loads(data[: features_cache._HEADER].rstrip(b"\0")) | changes
    return _headed(json.dumps(header).encode(), data)


def _headed(header, data):
    return header.ljust(features_cache._HEADER, b"\0") + data[features_cache._HEADER :]


def _codes(change):
    """Codes changed as floats and as whole numbers, with the checksum that fits."""

    def spoil(data, _):
        body = bytearray(data[features_cache._HEADER :])
        change(body)
        return _header(data[: features_cache._HEADER] + bytes(body), crc=zlib.crc32(body))

    return spoil


def _archive(**changes):
    """A calibration with other arrays, under the key of the library."""

    def spoil(data, key):
        with np.load(io.BytesIO(data[32:])) as arrays:
            changed = dict(arrays) | changes
        file = io.BytesIO()
        np.savez(file, **{name: array for name, array in changed.items() if array is not None})
        return calibration_cache._seal(file.getvalue(), key) + file.getvalue()

    return spoil


def _zeros(body, start, stop, kind, value):
    body[start:stop] = np.full((stop - start) // np.dtype(kind).itemsize, value, kind).tobytes()


HOSTILE = {
    "ids backwards": (CODES, _codes(lambda body: _zeros(body, 0, 96, np.int64, 5))),
    "ids far away": (CODES, _codes(lambda body: _zeros(body, 88, 96, np.int64, 1 << 40))),
    "functions of NaN": (CODES, _codes(lambda body: _zeros(body, 128, 136, np.float64, np.nan))),
    "functions of zeros": (CODES, _codes(lambda body: _zeros(body, 128, 128 + 9600, np.float64, 0.0))),
    "codes of NaN": (CODES, _codes(lambda body: _zeros(body, 9728, 9728 + 1152, np.float32, np.nan))),
    "sizes below zero": (CODES, _codes(lambda body: _zeros(body, 9728 + 1152, 9728 + 1200, np.float32, -1.0))),
    "no codes": (CODES, lambda data, _: _header(data, n=0)),
    "codes below zero": (CODES, lambda data, _: _header(data, n=-12)),
    "codes without end": (CODES, lambda data, _: _header(data, n=1 << 60)),
    "an endless number": (CODES, lambda data, _: _header(data, n=float("inf"))),
    "an endless version": (CODES, lambda data, _: _header(data, version=1 << 80)),
    "a nested header": (CODES, lambda data, _: _headed(b"[" * features_cache._HEADER, data)),
    "a header that is a list": (CODES, lambda data, _: _headed(b"[]", data)),
    "an empty file": (CODES, lambda data, _: b""),
    "no archive": (CALIBRATION, lambda data, key: calibration_cache._seal(b"evil", key) + b"evil"),
    "an empty archive": (CALIBRATION, lambda data, key: calibration_cache._seal(b"", key)),
    "scales of NaN": (CALIBRATION, _archive(scales=np.full(3, np.nan))),
    "scales of zero": (CALIBRATION, _archive(scales=np.zeros(3))),
    "scales of text": (CALIBRATION, _archive(scales=np.array(["a", "b", "c"]))),
    "too few scales": (CALIBRATION, _archive(scales=np.ones(2))),
    "no scales": (CALIBRATION, _archive(scales=None)),
    "no such scores": (CALIBRATION, _archive(which=np.array([0, 1, 99]))),
    "scores below zero": (CALIBRATION, _archive(which=np.array([-1, 0, 0]))),
    "scores of NaN": (CALIBRATION, _archive(own=np.full(12, np.nan))),
    "novelties of NaN": (CALIBRATION, _archive(**{"novelties 0": np.full(12, np.nan)})),
    "no novelties": (CALIBRATION, _archive(**{"novelties 0": None})),
    "ends backwards": (CALIBRATION, _archive(ends=np.array([12, 3, 12]))),
    "ends far away": (CALIBRATION, _archive(ends=np.array([3, 7, 1 << 60]))),
    "ends of halves": (CALIBRATION, _archive(ends=np.array([3.5, 7.0, 12.0]))),
}


@pytest.mark.parametrize("attack", HOSTILE)
def test_a_hostile_cache_is_built_again(served, attack):
    folder, expected, caches = served
    for name, data in caches.items():
        (folder / name).write_bytes(data)
    name, spoil = HOSTILE[attack]
    with ActionLibrary(folder) as library:
        hostile = spoil(caches[name], calibration_cache._key(library.store, members_of(library.store)))
        assert hostile != caches[name]
        (folder / name).write_bytes(hostile)
        assert _answers(library) == expected
        assert (folder / name).read_bytes() != hostile


@pytest.mark.parametrize("name", [CODES, CALIBRATION])
@pytest.mark.parametrize(
    "make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path), lambda path: path.symlink_to("/dev/zero")]
)
def test_what_is_no_file_is_no_cache(served, name, make):
    folder, expected, caches = served
    for each, data in caches.items():
        (folder / each).unlink(missing_ok=True)
        (folder / each).write_bytes(data)
    (folder / name).unlink()
    make(folder / name)
    with ActionLibrary(folder) as library:
        assert _answers(library) == expected
    if (folder / name).is_dir():
        (folder / name).rmdir()


@pytest.fixture
def of_all(tmp_path, monkeypatch):
    """A small library whose calibration is cached, and how often it was computed."""
    computed = []

    def counting(*arguments):
        computed.append(arguments)
        return calibrate(*arguments)

    monkeypatch.setattr(calibration_cache, "_FEW", 12)
    monkeypatch.setattr(calibration_cache, "calibrate", counting)
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(draw_movements(12, n_samples=12, labels=LABELS[0]), groups=["ann", "bob"] * 6)
        yield library, computed


def _all_answers(library):
    recognizer = LibraryRecognizer(library.store)
    calibration = recognizer.current().model.calibration
    answers = recognizer.recognize(library.movements())
    return [(a.label, a.ranked, a.rule, a.confidence, a.p_known, dict(a.p_values)) for a in answers], calibration


def _all_expected(library):
    """The same as they are to be again, within single precision as above."""
    answers, calibration = _all_answers(library)
    return [(*a[:3], *(pytest.approx(number, abs=1e-6) for number in a[3:])) for a in answers], calibration


def test_the_calibration_of_a_small_library_is_computed_once(of_all, tmp_path):
    library, computed = of_all
    expected, calibration = _all_expected(library)
    (answers, read), (again, _) = _all_answers(library), _all_answers(library)
    assert answers == expected
    assert again == expected
    assert len(computed) == 1
    assert (calibration.between, calibration.exponent) == (read.between, read.exponent) != (0.0, EXPONENT)
    for name in {field.name for field in fields(calibration)} - {"between", "exponent"}:
        for array, other in zip(getattr(calibration, name), getattr(read, name), strict=True):
            np.testing.assert_array_equal(array, other)
    (tmp_path / calibration_cache.FILE_OF_ALL).write_bytes(b"spoiled")
    assert _all_answers(library)[0] == expected
    assert len(computed) == 2
    with ActionLibrary(tmp_path, read_only=True) as reading:
        assert _all_answers(reading)[0] == expected
    assert len(computed) == 2


@pytest.mark.parametrize("change", ["learn", "assign", "delete", "rename"])
def test_a_change_of_the_library_makes_it_again(of_all, tmp_path, change):
    library, computed = of_all
    _all_answers(library)
    cached = (tmp_path / calibration_cache.FILE_OF_ALL).read_bytes()
    if change == "learn":
        library.learn(draw_movements(1, n_samples=13, labels=["wave"]))
    elif change == "assign":
        library.assign([1], "nod")
    elif change == "delete":
        library.learn(draw_movements(1, n_samples=13, labels=["wave"]))
        library.delete([1])
    else:
        library.rename("nod", "bend")
    (tmp_path / calibration_cache.FILE_OF_ALL).write_bytes(cached)
    _, fresh = _all_answers(library)
    assert len(computed) == 2
    (tmp_path / calibration_cache.FILE_OF_ALL).unlink()
    np.testing.assert_allclose(_all_answers(library)[1].scales, fresh.scales, rtol=1e-6)  # single precision, as above


def test_a_hostile_calibration_of_all_is_made_again(of_all, tmp_path):
    library, computed = of_all
    expected, _ = _all_expected(library)
    path = tmp_path / calibration_cache.FILE_OF_ALL
    cached, members = path.read_bytes(), members_of(library.store)
    key = calibration_cache._key(library.store, members)
    for changes in ({"novel own": np.full(12, -1.0)}, {"novel ends": np.array([0, 99, 12])}, {"novel own": None}):
        path.write_bytes(_archive(**changes)(cached, key))
        assert _all_answers(library)[0] == expected
        assert path.read_bytes() == cached
    assert len(computed) == 4
