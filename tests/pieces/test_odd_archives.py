"""Archives, functions and folders of parts that nobody should have: they are done right, or refused in words."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import piece_work
import pyarrow as pa
import pytest
from piece_work import lengths, write_archive
from pyarrow import ipc, parquet

import kineme
from kineme.errors import DataError, SpecificationError
from kineme.pieces import check, plan
from kineme.pieces import map as map_pieces
from kineme.pieces.archive import File, _copy
from kineme.pieces.gather import Asked, read_run, tables_of, write_run
from kineme.pieces.run import read_part
from kineme.pieces.tasks import job_of

SIZE = 6000


def _rows(outcomes, output):
    assert {outcome.state for outcome in outcomes} <= {"done", "skipped"}, outcomes
    paths = [output / f"part-{outcome.piece.key}.parquet" for outcome in outcomes]
    return [row for path in paths for row in parquet.ParquetFile(path).read().to_pylist()]


def _states(function, archive, output, **options):
    return {outcome.state for outcome in map_pieces(function, archive, output=output, **options)}


def test_files_of_any_name_are_read(tmp_path):
    archive = write_archive(tmp_path / "archive", 3)
    data = next(archive.rglob("*.csv")).read_bytes()
    for name in (b"a\xffb.csv", b"new\nline.csv", b"100%20 %s.csv", b"z" * 240 + b".csv", b"back\\slash.csv"):
        Path(os.fsdecode(os.path.join(os.fsencode(archive), name))).write_bytes(data)
    rows = _rows(map_pieces(lengths, archive, output=tmp_path / "out", size=SIZE), tmp_path / "out")
    assert [row["path"] for row in rows] == [source.path for source in kineme.read_recordings(archive).sources]
    assert _states(lengths, archive, tmp_path / "out", size=SIZE) == {"skipped"}


def test_archives_with_the_same_names_have_parts_of_their_own(tmp_path):
    archives = [write_archive(tmp_path / name, 6, seed=k) for k, name in enumerate(("first", "second"))]
    rows = _rows(map_pieces(lengths, archives, output=tmp_path / "out"), tmp_path / "out")
    assert [row["path"] for row in rows] == [source.path for source in kineme.read_recordings(archives).sources]
    twice = plan([str(archives[0]), f"{archives[0]}/", str(archives[0] / "arc")]).pieces
    assert sum(len(piece.units) for piece in twice) == 6
    (archives[0] / "link.csv").symlink_to("/etc/passwd")
    (problem,) = plan(list(map(str, archives))).problems
    assert problem.file == str(archives[0] / "link.csv")


@pytest.mark.parametrize("form", ["{}/", "{}/../archive 1", "file://{}", "link"])
def test_a_path_may_be_said_in_many_ways(tmp_path, form, monkeypatch):
    archive = write_archive(tmp_path / "archive 1", 4)
    map_pieces(lengths, archive, output=tmp_path / "out", size=SIZE)
    (tmp_path / "link").symlink_to(archive)
    monkeypatch.chdir(tmp_path)
    text = form.format(str(archive).replace(" ", "%20") if form.startswith("file") else archive)
    assert _states(lengths, text, tmp_path / "out", size=SIZE) == {"skipped"}
    monkeypatch.chdir(archive)
    assert _states(lengths, ".", tmp_path / "out", size=SIZE) == {"skipped"}


@pytest.mark.parametrize("folder", ["", "out", "arc/out"])
def test_parts_within_their_archive_are_refused(tmp_path, folder):
    archive = write_archive(tmp_path / "archive", 4)
    with pytest.raises(SpecificationError, match="outside of the archive"):
        map_pieces(lengths, archive, output=archive / folder)
    assert not list(archive.rglob("part-*"))


def test_options_that_json_writes_otherwise_are_the_same_options(tmp_path):
    archive = write_archive(tmp_path / "archive", 4)
    for state in ("done", "skipped"):
        assert _states(lengths, archive, tmp_path / "out", columns=("x",), label_by=Path("folder").name) == {state}


def _number(number, recordings):
    return {"number": [number]}


def _of_label(recordings):
    return {"known": [recordings.labels[0] in {"arc", "line", "wave"}]}


def _of_closure(number):
    def function(recordings):
        return {"number": [number]}

    return function


class _Number:
    def __init__(self, number):
        self.number = number

    def __call__(self, recordings):
        return {"number": [self.number]}


@pytest.mark.parametrize("make", [_of_closure, lambda number: partial(_number, number), _Number])
def test_functions_are_told_apart_by_what_they_carry(tmp_path, make):
    archive = write_archive(tmp_path / "archive", 4)
    states = [_states(make(number), archive, tmp_path / "out") for number in (3, 3, 4)]
    assert states == [{"done"}, {"skipped"}, {"done"}]


def test_functions_are_told_apart_by_their_code(tmp_path):
    archive = write_archive(tmp_path / "archive", 4)
    functions = [
        lambda recordings: {"n": [1]}, lambda recordings: {"n": [2]},
        lambda recordings: {"n": [len(recordings) + 2]}, lambda recordings: {"n": [len(recordings) - 2]},
        _of_label, _of_label,
    ]  # fmt: skip
    states = [_states(function, archive, tmp_path / "out") for function in functions]
    assert states == [{"done"}] * 5 + [{"skipped"}]
    held = object()  # pickle writes it; what a lock is, it does not
    assert _states(lambda recordings: {"n": [id(held)]}, archive, tmp_path / "out") == {"done"}


def test_what_cannot_be_written_down_is_done_each_time(tmp_path):
    import threading

    archive, lock = write_archive(tmp_path / "archive", 4), threading.Lock()
    for _ in range(2):
        assert _states(lambda recordings: {"n": [lock.locked()]}, archive, tmp_path / "out") == {"done"}


def _typed(recordings):
    number = int(recordings.sources[0].path[-6:-4])
    return {"value": [number if number % 2 else number / 4], **({} if number % 3 else {"text": ["a"]})}


def test_columns_of_a_piece_are_those_of_all_its_files(tmp_path):
    archive = write_archive(tmp_path / "archive", 7)
    rows = _rows(map_pieces(_typed, archive, output=tmp_path / "out"), tmp_path / "out")
    assert sorted(row["value"] for row in rows) == [0, 0.5, 1, 1, 1.5, 3, 5]
    assert [row["text"] for row in rows].count("a") == 3


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ({"a": [1], "b": [1, 2]}, "equally many values"),
        ({"a": 1}, "equally many values"),
        ([1, 2], "a dictionary of columns, or None for no rows, from the function, got list"),
        ((n for n in "ab"), "got generator"),
    ],
)
def test_rows_that_are_none_are_said(tmp_path, rows, words):
    (outcome,) = map_pieces(lambda recordings: rows, write_archive(tmp_path / "archive", 1), output=tmp_path / "out")
    assert (outcome.state, words in outcome.reason) == ("failed", True), outcome.reason


@pytest.mark.parametrize("function", [lambda recordings: None, _of_closure(1)])
def test_functions_that_no_other_process_finds_are_refused(tmp_path, function):
    with pytest.raises(SpecificationError, match="a function of a module that other processes can import"):
        map_pieces(function, write_archive(tmp_path / "archive", 1), output=tmp_path / "out", workers=1)


_WAIT = (
    "import sys, signal; sys.path.insert(0, sys.argv[3]); import piece_work; from kineme.pieces import map\n"
    "signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background, shells ignore it\n"
    "if __name__ == '__main__': map(piece_work.hanging, sys.argv[1], output=sys.argv[2], size=6000, workers=1)"
)


@pytest.mark.soak
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_processes_end_with_the_one_that_has_started_them(tmp_path, monkeypatch, how):
    monkeypatch.setenv("KINEME_TEST_MARK", str(tmp_path / "mark"))
    archive = write_archive(tmp_path / "archive", 3)
    command = [sys.executable, "-c", _WAIT, str(archive), str(tmp_path / "out"), os.path.dirname(piece_work.__file__)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "mark").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    worker = int((tmp_path / "mark").read_text())
    (os.kill if how == signal.SIGKILL else os.killpg)(process.pid, how)
    try:
        _, errors = process.communicate(timeout=30)  # a pipe that the worker holds, too
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    assert process.returncode != 0
    assert errors.count(b"Traceback") == (how == signal.SIGINT)  # that of the script alone
    with pytest.raises(ProcessLookupError):
        _await_end(worker, deadline)


def _await_end(process, deadline):
    while time.monotonic() < deadline:
        os.kill(process, 0)
        time.sleep(0.02)


def _part(path, about, report):
    table = pa.table({"a": [1]}).replace_schema_metadata({b"kineme": about, b"kineme.report": report})
    if path.suffix == ".parquet":
        parquet.write_table(table, path)
    else:
        with pa.OSFile(str(path), "wb") as sink, ipc.new_file(sink, table.schema) as writer:
            writer.write_table(table)


@pytest.mark.parametrize("ending", [".parquet", ".arrow"])
@pytest.mark.parametrize(
    ("about", "report"),
    [
        (b"[" * 100_000, b"{}"),
        (b"\xff", b"{}"),
        (b"{}", b"[]"),
        (b"{}", b'{"problems": 3, "recordings": 1, "seconds": 1, "rows": 1}'),
        (b"{}", b'{"problems": [], "recordings": 1e999, "seconds": 1, "rows": 1}'),
    ],
)
def test_a_part_that_says_nonsense_is_none(tmp_path, ending, about, report):
    _part(tmp_path / f"part{ending}", about, report)
    assert read_part(tmp_path / f"part{ending}") is None
    _part(tmp_path / f"part{ending}", b"{}", b'{"problems": [3], "recordings": 1, "seconds": 1, "rows": 1}')
    assert read_part(tmp_path / f"part{ending}").problems == ("3",)


def _inspected(tmp_path, output="out"):
    archive = write_archive(tmp_path / "archive", 4)
    asked = Asked("inspect", (str(archive),), {"reading": {}}, 10_000_000)
    write_run(tmp_path / output, asked)
    job = job_of("inspect", str(tmp_path / output), asked.options)
    from kineme.pieces.mapping import run

    assert {outcome.state for outcome in run(job, plan(str(archive), asked.size).pieces)} == {"done"}
    return archive, asked, job


def test_the_name_of_a_folder_is_no_column(tmp_path):
    _, _, job = _inspected(tmp_path, "run=3")
    (table,) = tables_of(job, check(tmp_path / "run=3"))
    assert "run" not in table.column_names


def test_damaged_rows_are_said(tmp_path):
    _, _, job = _inspected(tmp_path)
    (path,) = (tmp_path / "out").glob("part-*")
    data = bytearray(path.read_bytes())
    data[4:200] = bytes(196)
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"rows of a piece in .*part-.*, got a damaged file; remove it"):
        list(tables_of(job, check(tmp_path / "out")))


def test_an_archive_that_has_moved_is_said(tmp_path):
    archive, _, _ = _inspected(tmp_path)
    archive.rename(tmp_path / "elsewhere")
    with pytest.raises(DataError, match="where it has moved, call its command again"):
        check(tmp_path / "out")


@pytest.mark.parametrize(
    "change",
    [
        lambda said: "", lambda said: "[" * 100_000, lambda said: "[]", lambda said: "\xff",
        lambda said: json.dumps(said | {"options": [1, 2]}), lambda said: json.dumps(said | {"archives": "archive"}),
        lambda said: json.dumps(said | {"size": float("inf")}),
    ],
)  # fmt: skip
def test_a_damaged_run_is_said_and_written_anew_by_force(tmp_path, change):
    _, asked, _ = _inspected(tmp_path)
    path = tmp_path / "out" / "run.json"
    path.write_bytes(change(json.loads(path.read_text())).encode("latin1"))
    for call in (lambda: check(tmp_path / "out"), lambda: write_run(tmp_path / "out", asked)):
        with pytest.raises(DataError, match=r"without a run\.json that can be read; .* with --force"):
            call()
    write_run(tmp_path / "out", asked, replace=True)
    assert read_run(tmp_path / "out") == asked


def test_a_command_of_a_later_version_is_said(tmp_path):
    write_run(tmp_path, Asked("dream", (str(tmp_path),), {"reading": {}}))
    with pytest.raises(DataError, match="expected a command over pieces"):
        check(tmp_path)


def test_a_full_disk_is_not_one_of_the_store(tmp_path):
    class Source:
        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def read(self, size):
            raise OSError(28, "No space left on device")

    class System:
        def open_input_stream(self, path):
            return Source()

    with pytest.raises(OSError, match="No space") as error:
        _copy(System(), "a.csv", tmp_path / "a.csv", File("a.csv", 1, ""))
    assert not isinstance(error.value, DataError)


def test_an_archive_of_nothing_that_can_be_read_is_refused(tmp_path):
    (tmp_path / "meta").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "meta" / "info.json").write_text("{}")
    with pytest.raises(DataError, match="found none; the first problem"):
        plan(str(tmp_path))


def test_links_are_followed_when_asked_and_loops_end(tmp_path):
    archive = write_archive(tmp_path / "archive", 3)
    (archive / "loop").symlink_to(archive)
    (archive / "out.csv").symlink_to(next(write_archive(tmp_path / "other", 1).rglob("*.csv")))
    assert [problem.file for problem in plan(str(archive)).problems] == ["out.csv"]
    rows = _rows(map_pieces(lengths, archive, output=tmp_path / "out", follow_links=True), tmp_path / "out")
    assert len(rows) == 4
    assert np.unique([row["samples"] for row in rows]).tolist() == [60]


def test_parts_of_another_version_are_done_again(tmp_path, monkeypatch):
    archive = write_archive(tmp_path / "archive", 3)
    assert _states(lengths, archive, tmp_path / "out") == {"done"}
    monkeypatch.setattr("kineme.__version__", "99.0")
    assert _states(lengths, archive, tmp_path / "out") == {"done"}


def test_a_piece_that_fails_keeps_no_former_part(tmp_path):
    archive = write_archive(tmp_path / "archive", 3)
    for function, state in ((lengths, "done"), (piece_work.refusing, "failed")):
        assert _states(function, archive, tmp_path / "out") == {state}
    assert not list((tmp_path / "out").glob("part-*"))


@pytest.mark.parametrize("workers", [None, 1])
def test_processes_compile_and_use_one_thread(tmp_path, monkeypatch, workers):
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.setenv(name, "7")
    monkeypatch.delenv("KINEME_COMPILED", raising=False)
    outcomes = map_pieces(
        piece_work.environment, write_archive(tmp_path / "archive", 1), output=tmp_path / "out", workers=workers
    )
    threads = "7" if workers is None else "1"
    assert [*_rows(outcomes, tmp_path / "out")[0].values()] == [threads, threads, "always"]
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "KINEME_COMPILED" not in os.environ


def test_problems_of_the_listing_are_those_of_the_first_shard(tmp_path):
    archive = write_archive(tmp_path / "archive", 3)
    (archive / "out.csv").symlink_to("/etc/passwd")
    shards = [plan(str(archive), 1).shard(rank, 3) for rank in (1, 2, 3)]
    assert [len(shard.problems) for shard in shards] == [1, 0, 0]


def test_what_has_failed_is_checked_with_its_reason(tmp_path):
    archive, asked, job = _inspected(tmp_path)
    (piece,) = plan(str(archive), asked.size).pieces
    job.path(piece).unlink()
    assert check(tmp_path / "out").missing == (piece,)
    job.failure(piece).write_text(json.dumps({"reason": "poison"}))
    assert check(tmp_path / "out").failed == ((piece, "poison"),)
    job.failure(piece).write_text("[" * 100_000)
    assert check(tmp_path / "out").failed == ((piece, "its reason cannot be read"),)


def test_an_archive_may_move_and_a_library_learn_between_calls(tmp_path):
    options = {"reading": {}, "error_rate": 0.1, "library": "here", "library_id": "1", "library_version": 3}
    asked = Asked("annotate", ("archive",), options)
    write_run(tmp_path, asked)
    later = Asked("annotate", ("elsewhere",), options | {"library": "there", "library_version": 4})
    write_run(tmp_path, later)
    assert read_run(tmp_path) == later
    with pytest.raises(DataError, match=r"other options \(library_id\)"):
        write_run(tmp_path, Asked("annotate", ("elsewhere",), later.options | {"library_id": "2"}))


def test_a_run_sweeps_what_was_left_hours_ago(tmp_path):
    archive = write_archive(tmp_path / "archive", 1)
    (tmp_path / "out").mkdir()
    left = tmp_path / "out" / ".part-0123456789abcdef.parquet.123.01234567"
    left.write_text("half")
    for age, is_there in ((60, True), (7200, False)):
        os.utime(left, (time.time() - age,) * 2)
        map_pieces(lengths, archive, output=tmp_path / "out")
        assert left.exists() == is_there
