"""Parts are the same bytes whoever makes them, whatever is killed, changed or poisoned meanwhile."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
import time

import piece_work
import pytest
from piece_work import lengths, parts_of, write_archive
from pyarrow import parquet

from kineme.errors import SpecificationError
from kineme.pieces import map as map_pieces
from kineme.pieces import plan, run
from kineme.pieces.executors import execute
from kineme.pieces.mapping import job_of_function
from kineme.pieces.run import read_part

SIZE = 6000


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    return write_archive(tmp_path_factory.mktemp("archive"))


@pytest.fixture(scope="module")
def parts(archive, tmp_path_factory):
    """The parts of one process."""
    output = tmp_path_factory.mktemp("parts")
    outcomes = map_pieces(lengths, archive, output=output, size=SIZE)
    assert {outcome.state for outcome in outcomes} == {"done"}
    assert sum(outcome.recordings for outcome in outcomes) == sum(outcome.rows for outcome in outcomes) == 40
    return parts_of(output)


def test_rows_of_all_parts_are_those_of_all_recordings(archive, parts, tmp_path):
    for name, data in parts.items():
        (tmp_path / name).write_bytes(data)
    tables = [parquet.read_table(tmp_path / f"part-{piece.key}.parquet") for piece in plan(str(archive), SIZE).pieces]
    rows = [row for table in tables for row in table.to_pylist()]
    assert [row["path"] for row in rows] == sorted(str(path.relative_to(archive)) for path in archive.rglob("*.csv"))
    assert all(row["path"].startswith(row["label"]) and row["samples"] == 60 for row in rows)


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_write_the_same_bytes(archive, parts, tmp_path, workers):
    map_pieces(lengths, archive, output=tmp_path, size=SIZE, workers=workers)
    assert parts_of(tmp_path) == parts


def test_shards_write_the_same_bytes(archive, parts, tmp_path):
    job = job_of_function(lengths, tmp_path, {})
    for rank in (4, 1, 3, 5, 2):
        assert {o.state for o in execute(job, plan(str(archive), SIZE).shard(rank, 5).pieces)} == {"done"}
    assert parts_of(tmp_path) == parts


def test_what_is_done_is_not_done_again(archive, tmp_path):
    first = map_pieces(lengths, archive, output=tmp_path, size=SIZE)
    again = map_pieces(lengths, archive, output=tmp_path, size=SIZE)
    assert {outcome.state for outcome in again} == {"skipped"}
    assert [outcome.rows for outcome in again] == [outcome.rows for outcome in first]
    chosen = map_pieces(lengths, archive, output=tmp_path, size=SIZE, columns=("x",))
    assert {outcome.state for outcome in chosen} == {"done"}  # other options make other rows


def test_a_changed_file_makes_its_part_stale(tmp_path):
    archive = write_archive(tmp_path / "archive")
    map_pieces(lengths, archive, output=tmp_path / "out", size=SIZE)
    path = archive / "arc" / "0003.csv"
    path.write_text(path.read_text() + "1.5,1,1\n")
    states = [outcome.state for outcome in map_pieces(lengths, archive, output=tmp_path / "out", size=SIZE)]
    assert states.count("done") == 1
    assert states.count("skipped") == len(states) - 1


@pytest.mark.parametrize("damage", [b"", b"PAR1", None])
def test_a_damaged_part_is_made_again(archive, parts, tmp_path, damage):
    map_pieces(lengths, archive, output=tmp_path, size=SIZE)
    path = next(tmp_path.glob("part-*"))
    path.write_bytes(path.read_bytes()[:-40] if damage is None else damage)
    assert read_part(path) is None
    states = [outcome.state for outcome in map_pieces(lengths, archive, output=tmp_path, size=SIZE)]
    assert states.count("done") == 1
    assert parts_of(tmp_path) == parts


@pytest.mark.parametrize("workers", [None, 2])
def test_a_poisoned_piece_stops_nothing(archive, tmp_path, workers):
    outcomes = map_pieces(piece_work.poisoned, archive, output=tmp_path, size=SIZE, workers=workers)
    bad = [outcome for outcome in outcomes if outcome.state == "failed"]
    assert bad
    assert all(outcome.reason == "ValueError: these cannot be done" for outcome in bad)
    assert {outcome.state for outcome in outcomes} == {"done", "failed"}
    reasons = [json.loads(path.read_text())["reason"] for path in tmp_path.glob("failed-*")]
    assert reasons == [bad[0].reason] * len(bad)
    assert not [path for path in tmp_path.glob("part-*") if path.stem.partition("-")[2] in {o.piece.key for o in bad}]


def test_a_piece_that_ends_its_process_fails_alone(archive, tmp_path):
    outcomes = map_pieces(piece_work.deadly, archive, output=tmp_path, size=SIZE, workers=2)
    (bad,) = [outcome for outcome in outcomes if outcome.state == "failed"]
    assert "more memory" in bad.reason
    assert any(unit.name.endswith("0005.csv") for unit in bad.piece.units)
    assert len(outcomes) == len(plan(str(archive), SIZE).pieces)


@pytest.mark.soak
def test_a_process_that_is_ended_once_costs_nothing(archive, parts, tmp_path, monkeypatch):
    monkeypatch.setenv("KINEME_TEST_MARK", str(tmp_path / "mark"))
    outcomes = map_pieces(piece_work.deadly_once, archive, output=tmp_path / "out", size=SIZE, workers=2)
    assert (tmp_path / "mark").exists()
    assert "failed" not in {outcome.state for outcome in outcomes}
    assert parts_of(tmp_path / "out").keys() == parts.keys()


@pytest.mark.skipif(os.name != "posix", reason="a library of C of POSIX")
def test_a_process_that_hangs_is_ended_and_its_piece_fails(archive, tmp_path):
    before = time.monotonic()
    outcomes = map_pieces(piece_work.stuck, archive, output=tmp_path, size=SIZE, workers=2, time_limit=8.0)
    assert time.monotonic() - before < 120
    (bad,) = [outcome for outcome in outcomes if outcome.state == "failed"]
    assert "not done within 0.133333 min" in bad.reason
    assert any(unit.name.endswith("0005.csv") for unit in bad.piece.units)
    assert [json.loads(path.read_text())["reason"] for path in tmp_path.glob("failed-*")] == [bad.reason]
    assert len(outcomes) == len(plan(str(archive), SIZE).pieces)
    again = map_pieces(piece_work.stuck, archive, output=tmp_path, size=SIZE, workers=1, time_limit=4.0)
    assert [outcome.state for outcome in again].count("skipped") == len(outcomes) - 1


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan")])
def test_a_time_that_is_none_is_refused(archive, tmp_path, limit):
    with pytest.raises(SpecificationError, match="a time above 0"):
        map_pieces(lengths, archive, output=tmp_path, size=SIZE, workers=1, time_limit=limit)


def test_a_file_that_changes_while_it_is_read_fails_its_piece(tmp_path, monkeypatch):
    archive = write_archive(tmp_path / "archive")
    monkeypatch.setenv("KINEME_TEST_MARK", str(archive))
    outcomes = map_pieces(piece_work.touching, archive, output=tmp_path / "out", size=SIZE)
    (bad,) = [outcome for outcome in outcomes if outcome.state == "failed"]
    assert "has changed or vanished while it was read" in bad.reason
    again = map_pieces(lengths, archive, output=tmp_path / "out", size=SIZE)
    assert "failed" not in {outcome.state for outcome in again}
    assert not list((tmp_path / "out").glob("failed-*"))


def test_files_that_cannot_be_read_are_problems_and_vanished_ones_fail(tmp_path):
    archive = write_archive(tmp_path / "archive", 6)
    (archive / "arc" / "0000.csv").write_text("no movement\n")
    outcomes = map_pieces(lengths, archive, output=tmp_path / "out")
    assert [outcome.state for outcome in outcomes] == ["done"]
    assert [problem.partition(":")[0].partition(",")[0] for problem in outcomes[0].problems] == ["arc/0000.csv"]
    pieces = plan(str(archive), 1).pieces
    (archive / "line" / "0001.csv").unlink()
    job = job_of_function(lengths, tmp_path / "out", {})
    states = {str(outcome.piece): outcome.state for outcome in execute(job, pieces)}
    assert states["line/0001.csv"] == "failed"
    assert list(states.values()).count("done") == 5


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_forbidden_file_is_a_problem(tmp_path):
    archive = write_archive(tmp_path / "archive", 6)
    (archive / "arc" / "0000.csv").chmod(0)
    assert "0000.csv" in map_pieces(lengths, archive, output=tmp_path / "out")[0].problems[0]


def test_a_full_disk_stops_the_run(archive, tmp_path, monkeypatch):
    def full(*arguments, **options):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(run, "_write", full)
    with pytest.raises(OSError, match="No space"):
        map_pieces(lengths, archive, output=tmp_path, size=SIZE)


def test_two_ways_at_once_are_refused(archive, tmp_path):
    with pytest.raises(SpecificationError, match="not both"):
        map_pieces(lengths, archive, object(), output=tmp_path, workers=2)
    with pytest.raises(SpecificationError, match="at least one worker"):
        map_pieces(lengths, archive, output=tmp_path, workers=0)


_RUN = (
    "import sys; sys.path.insert(0, sys.argv[3]); import piece_work; from kineme.pieces import map\n"
    "if __name__ == '__main__': map(piece_work.slowly, sys.argv[1], output=sys.argv[2], size=6000)"
)


@pytest.mark.parametrize("kills", [6, pytest.param(100, marks=pytest.mark.soak)])
def test_a_run_that_is_killed_goes_on(archive, parts, tmp_path, kills):
    """Two runs at a time into one folder, each killed with -9 at a random moment."""
    command = [sys.executable, "-c", _RUN, str(archive), str(tmp_path), os.path.dirname(piece_work.__file__)]
    moments = random.Random(0)
    for _ in range(kills // 2):
        both = [subprocess.Popen(command, stderr=subprocess.DEVNULL) for _ in range(2)]
        deadline = time.monotonic() + 20
        before = len(list(tmp_path.glob("part-*")))
        while len(list(tmp_path.glob("part-*"))) == before and time.monotonic() < deadline and both[0].poll() is None:
            time.sleep(0.005)
        time.sleep(moments.uniform(0, 0.05))
        for process in both:
            process.send_signal(signal.SIGKILL)
            process.wait()
    map_pieces(piece_work.slowly, archive, output=tmp_path, size=SIZE)
    rows = [parquet.read_table(path).num_rows for path in tmp_path.glob("part-*")]
    assert sum(rows) == 40
    assert parts_of(tmp_path).keys() == parts.keys()
