"""A child that is forked while threads learn, compare, compile, read and write does the same work, and ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import warnings

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from kineme import DMP, ActionLibrary, Trajectory
from kineme.errors import DataError
from kineme.kernels import Laplacian
from kineme.library.storage import safety
from kineme.runtime import compiled, forks, parallel
from soaking import slow

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")

SECONDS = 60


def fork(work):
    """Whether `work` runs to its end in a child that os.fork makes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of every fork beside threads
        child = os.fork()
    if child == 0:
        signal.alarm(SECONDS)
        try:
            work()
            os._exit(0)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def fork_by_multiprocessing(work):
    process = multiprocessing.get_context("fork").Process(target=work)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    process.join(SECONDS)
    if process.exitcode is None:
        process.kill()
    return process.exitcode == 0


@pytest.fixture(autouse=True)
def two_blas_threads():
    """As where nothing limits them: with one, OpenBLAS takes no locks that a child could inherit."""
    with threadpool_limits(limits=2, user_api="blas"):
        yield


@pytest.fixture
def movements():
    rng = np.random.default_rng(0)
    return [Trajectory(np.linspace(0, 2, 40) ** 1.1, rng.normal(size=(40, 2)).cumsum(axis=0)) for _ in range(12)]


@pytest.fixture
def library(tmp_path, movements):
    with ActionLibrary(tmp_path / "library", create=True) as library:
        library.learn(movements[:6], list("ababab"))
        yield library


@pytest.fixture
def beside(library):  # so that they end before the library is closed
    """Runs works again and again in threads, until the test is over; they must not fail."""
    stop, threads, failed = threading.Event(), [], []

    def start(*works):
        def again(work):
            try:
                while not stop.is_set():
                    work()
            except BaseException as error:
                failed.append(error)

        threads.extend(threading.Thread(target=again, args=(work,)) for work in works)
        for thread in threads:
            thread.start()

    yield start
    stop.set()
    for thread in threads:
        thread.join()
    assert not failed


@pytest.mark.parametrize("fork", [fork, slow(fork_by_multiprocessing)])
def test_children_work_while_threads_of_the_parent_do(monkeypatch, beside, library, movements, fork):
    monkeypatch.setenv("KINEME_NUM_THREADS", "2")
    rows = np.random.default_rng(1).normal(size=(300, 20))
    gram, weights = Laplacian(1.0)(rows), DMP().learn(movements).weights

    def work():
        np.testing.assert_allclose(Laplacian(1.0)(rows), gram)
        np.testing.assert_allclose(DMP().learn(movements).weights, weights)
        n = len(library)
        library.learn(movements[6:], list("cdcdcd"))
        assert len(library) >= n

    beside(
        lambda: DMP().learn(movements),
        lambda: Laplacian(1.0)(rows),
        lambda: library.learn(movements[:6]),
        library.history,
    )
    assert all(fork(work) for _ in range(5))
    assert len(library) == 12
    assert library.verify() == []


def test_a_fork_waits_for_locks_and_leaves_none(monkeypatch):
    """A lock that another thread holds for a moment is free in the child."""
    for lock in (compiled._loading, parallel._blas_lock):
        taken, done = threading.Event(), threading.Event()

        def hold(lock=lock, taken=taken, done=done):
            with lock:
                taken.set()
                done.wait(0.2)

        thread = threading.Thread(target=hold)
        thread.start()
        taken.wait()

        def free(lock=lock):
            assert compiled._loading.acquire(timeout=60)
            assert parallel._blas_lock.acquire(timeout=60)

        assert fork(free)
        thread.join()


def test_no_connection_is_open_over_a_fork(library):
    store = library.store
    assert not store._asleep
    forks._before()
    try:
        assert store._asleep
        assert not store.path.with_name(store.path.name + "-wal").exists()
    finally:
        forks._in_parent()
    assert len(library) == 6
    assert not store._asleep


def test_a_child_refuses_a_library_that_was_in_use_at_the_fork(monkeypatch, library):
    monkeypatch.setattr(safety, "_PATIENCE", 0.1)
    reading, done = threading.Event(), threading.Event()

    def read():
        with library.store.reading():
            reading.set()
            done.wait(30)

    thread = threading.Thread(target=read)
    thread.start()
    reading.wait()

    def work():
        for use in (lambda: len(library), lambda: ActionLibrary(library.store.folder)):
            with pytest.raises(DataError, match="forked while the library was being read or written"):
                use()

    assert fork(work)
    done.set()
    thread.join()
    assert len(library) == 6


def test_a_library_that_was_replaced_over_a_fork_is_not_opened(library):
    library.store.sleep()
    path = library.store.path
    path.rename(path.with_name("moved"))
    with pytest.raises(DataError, match="it was moved, deleted or replaced"):
        len(library)
    path.with_name("moved").rename(path)
    assert len(library) == 6
