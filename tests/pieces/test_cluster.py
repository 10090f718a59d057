"""Pieces on the workers of a cluster of Dask, one of which is killed."""

from __future__ import annotations

import os
import signal
import time

import piece_work
import pytest
from piece_work import lengths, parts_of, write_archive

from kineme.errors import DataError
from kineme.pieces import executors
from kineme.pieces import map as map_pieces
from kineme.pieces.executors import cluster_client

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore")  # of distributed, when a worker is killed


@pytest.fixture(scope="module")
def cluster():
    """Two workers, which find the functions of this folder."""
    from pathlib import Path

    folder = str(Path(__file__).parent)
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([folder, *filter(None, [before])])
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        yield cluster
    os.environ["PYTHONPATH"] = before


@pytest.fixture
def client(cluster):
    with distributed.Client(cluster, set_as_default=False) as client:
        yield client


def test_workers_write_the_same_bytes(client, tmp_path):
    archive = write_archive(tmp_path / "archive")
    map_pieces(lengths, archive, output=tmp_path / "here", size=6000)
    outcomes = map_pieces(lengths, archive, client, output=tmp_path / "there", size=6000)
    assert {outcome.state for outcome in outcomes} == {"done"}
    assert parts_of(tmp_path / "there") == parts_of(tmp_path / "here")


@pytest.mark.soak
def test_a_killed_worker_costs_no_piece(client, tmp_path):
    archive = write_archive(tmp_path / "archive", 120)
    killed = []

    def kill(outcome):
        if not killed:
            killed.append(next(iter(client.run(os.getpid).values())))
            os.kill(killed[0], signal.SIGKILL)

    outcomes = map_pieces(piece_work.slowly, archive, client, output=tmp_path / "there", size=6000, progress=kill)
    assert killed
    assert "failed" not in {outcome.state for outcome in outcomes}
    map_pieces(piece_work.slowly, archive, output=tmp_path / "here", size=6000)
    assert parts_of(tmp_path / "there") == parts_of(tmp_path / "here")
    deadline = time.monotonic() + 20
    while len(client.run(os.getpid)) < 2 and time.monotonic() < deadline:  # for the next test
        time.sleep(0.1)


def test_poison_is_listed_and_more_pieces_than_a_scheduler_takes_are_done(client, tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "_SUBMITTED", 3)
    outcomes = map_pieces(
        piece_work.poisoned, write_archive(tmp_path / "archive"), client, output=tmp_path / "out", size=6000
    )
    assert {outcome.state for outcome in outcomes} == {"done", "failed"}


def test_another_version_on_a_worker_is_refused(client, tmp_path, monkeypatch):
    monkeypatch.setattr("kineme.__version__", "99.0")
    with pytest.raises(DataError, match=r"expected kineme 99\.0 on all workers"):
        map_pieces(lengths, write_archive(tmp_path / "archive", 3), client, output=tmp_path / "out")


@pytest.mark.soak
def test_a_scheduler_that_is_not_there_is_said():
    with (
        pytest.raises(DataError, match="expected a scheduler of Dask"),
        cluster_client("tcp://127.0.0.1:9", timeout=0.3),
    ):
        pass
