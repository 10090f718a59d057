"""Real recordings, written in every format, are read back to the last bit; each movement knows where it comes from."""

import hashlib
from pathlib import Path

import lasa_files
import numpy as np
import pytest

import kineme
from kineme.io.reading.formats import FORMATS
from kineme.io.reading.read_file import parsed_file
from kineme.io.reading.recordings import read_recording, read_recordings
from kineme.io.writing.write_movement import write_movement
from kineme.movements.tables.layout import Block, Detected, Layout, Parsed


@pytest.mark.parametrize("source", lasa_files.SOURCES)
def test_real_recordings_come_back_to_the_last_bit(tmp_path, source):
    read = read_recordings(lasa_files.SOURCES[source](tmp_path))
    expected = lasa_files.demonstrations()
    assert read.problems == ()
    assert read.demonstrations.labels.tolist() == expected.labels.tolist() == list(read.labels)
    np.testing.assert_array_equal(read.demonstrations.offsets, expected.offsets)
    np.testing.assert_array_equal(read.demonstrations.positions, expected.positions)
    np.testing.assert_array_equal(read.demonstrations.times, expected.times)
    np.testing.assert_array_equal(read.demonstrations.durations, expected.durations)


@pytest.mark.parametrize("source", lasa_files.SOURCES)
def test_every_movement_knows_its_file_and_its_place_there(tmp_path, source):
    path = lasa_files.SOURCES[source](tmp_path)
    read = read_recordings(path)
    folder = path if path.is_dir() else path.parent
    assert len(read) == len(read.sources) == len(read.demonstrations)
    assert len({(source.path, source.place) for source in read.sources}) == len(read)
    for origin, name in zip(read.sources, read.demonstrations.names, strict=True):
        file = folder / origin.path
        assert origin.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
        assert (origin.size, origin.mtime) == (file.stat().st_size, file.stat().st_mtime)
        assert name == (f"{origin.path}#{origin.place}" if origin.place else origin.path)
    assert sum(n for _, n in read.detected) == len({source.path for source in read.sources})


@pytest.mark.parametrize(
    ("source", "place"), [("csv_folder", ""), ("long_csv", "CShape_1"), ("numbered_npz", "0"), ("matlab_folder", "0")]
)
def test_the_place_is_the_key_or_the_index(tmp_path, source, place):
    assert read_recordings(lasa_files.SOURCES[source](tmp_path)).sources[0].place == place


def test_what_was_detected_is_told(tmp_path):
    (how, n) = read_recordings(lasa_files.long_semicolons(tmp_path)).detected[0]
    assert n == 1
    assert how.format == "CSV"
    assert how.layout == "long"
    assert (how.columns, how.time, how.movement, how.label) == (("x", "y"), "time", ("demo",), ("label",))
    assert (how.units, how.units_from, how.ignored) == ("s", "assumed", ())


def test_one_file_of_many_movements_is_refused_where_one_is_expected(tmp_path):
    with pytest.raises(
        kineme.errors.DataError, match=r"expected one movement in .*all\.csv, got 21; .*read_recordings"
    ):
        read_recording(lasa_files.long_csv(tmp_path))


def test_other_dimensions_than_most_are_a_problem(tmp_path, make_movement):
    for k, n_dims in enumerate((2, 3, 2, 1)):
        t, x = make_movement(k, n_dims)
        write_movement(tmp_path / f"{k}.json", {"times": t, "positions": x})
    read = read_recordings(tmp_path)
    assert [source.path for source in read.sources] == ["0.json", "2.json"]
    reasons = [(problem.file, problem.reason) for problem in read.problems]
    assert reasons == [("1.json", "3 dimensions where most have 2"), ("3.json", "1 dimensions where most have 2")]


def test_labels_are_on_all_demonstrations_or_on_none_but_always_with_the_sources(tmp_path, make_movement):
    (tmp_path / "wave").mkdir()
    for name in ("wave/a.csv", "b.csv"):
        t, x = make_movement(1)
        write_movement(tmp_path / name, {"times": t, "positions": x})
    read = read_recordings(tmp_path)
    assert tuple(read.labels) == (None, "wave")
    assert read.demonstrations.labels is None
    assert isinstance(read.labels, np.ndarray)  # as those of demonstrations: a label compared with it chooses movements
    assert [movement.name for movement in read[read.labels == "wave"]] == ["wave/a.csv"]
    with pytest.raises(ValueError, match="read-only"):
        read.labels[0] = "nod"
    assert repr(read).endswith(" samples each), 2 files, 0 problems)")


def test_nothing_to_read_is_an_error_with_the_first_reason(tmp_path):
    with pytest.raises(kineme.errors.DataError, match="found nothing at 'nowhere'"):
        read_recordings("nowhere")
    with pytest.raises(kineme.errors.DataError, match=r"expected recordings in .*, found none$"):
        read_recordings(tmp_path)
    (tmp_path / "a.csv").write_text("time,x\n0,1\n")
    (tmp_path / "b.gif").write_text("")
    with pytest.raises(
        kineme.errors.DataError, match=r"2 could not be read, the first a\.csv: expected at least 4 samples"
    ):
        read_recordings(tmp_path)


@pytest.mark.parametrize("ending", sorted(FORMATS))
@pytest.mark.parametrize(
    "data", [b"", b"\0" * 500, b"\xff\xd8\xff\xe0 a picture", b"PAR1PAR1", b"PK\x03\x04 an archive"]
)
def test_garbage_under_any_name_is_a_problem_never_a_crash(tmp_path, ending, data, make_movement):
    (tmp_path / f"bad{ending}").write_bytes(data)
    t, x = make_movement(1)
    write_movement(tmp_path / "good.csv", {"times": t, "positions": x})
    read = read_recordings(tmp_path)
    assert [problem.file for problem in read.problems] == [f"bad{ending}"]
    assert len(read) == 1
    with pytest.raises(kineme.errors.DataError, match=rf"bad\{ending}: \w+"):
        read_recording(tmp_path / f"bad{ending}")


def test_a_label_that_no_reader_should_give_costs_its_file_alone(make_movement):
    t, x = make_movement(1)
    block = Block(x, t, np.array([0, len(t)]), [object()], [""])
    detected = Detected("CSV", "wide", tuple("xyz"[: x.shape[1]]), "t", "s", "given")
    read = parsed_file(lambda _: Parsed(detected, block), FORMATS[".csv"], Path("a.csv"), Layout())
    assert [problem.file for problem in read.problems] == ["a.csv"]
    assert not read.block.labels


@pytest.mark.parametrize("source", ["npz_folder", "parquet_folder", "matlab_folder"])
def test_a_file_cut_or_altered_anywhere_gives_a_movement_or_a_problem(tmp_path, source):
    lasa_files.SOURCES[source](tmp_path)
    path = next(path for path in sorted(tmp_path.rglob("*")) if path.is_file())
    data, rng = path.read_bytes(), np.random.default_rng(5)
    for trial in range(60):
        damaged = bytearray(data[: rng.integers(len(data))] if trial % 2 else data)
        for place in rng.integers(max(1, min(len(damaged), 2000)), size=4 if damaged else 0):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_recordings(path)
        except kineme.errors.DataError:
            continue


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"units": "mm"}, "expected units to be one of s, ms, us, ns or a number of seconds, got 'mm'"),
        ({"units": -1.0}, "expected units to be a number above 0, got -1.0"),
        ({"skip": "file"}, r"expected skip to be one of \['movement', 'sample'\], got 'file'"),
    ],
)
def test_unknown_choices_are_refused(tmp_path, option, words):
    with pytest.raises(kineme.errors.SpecificationError, match=words):
        read_recordings(tmp_path, **option)
