"""The environment changes speed, never results; and nothing of the caller's is changed."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from kineme import DMP, Demonstrations, Smooth, Trajectory, TrimRest
from kineme.dmp.discrete import encode
from kineme.errors import SpecificationError
from kineme.runtime import compiled, parallel


@pytest.fixture(scope="module")
def ragged(make_movement):
    return [Trajectory(*make_movement(seed, even=False)) for seed in range(30)]


@pytest.mark.parametrize("steps", [(), (TrimRest(), Smooth(15.0))], ids=["plain", "prepared"])
def test_compiled_and_plain_code_learn_the_same(monkeypatch, ragged, agree, steps):
    results = {}
    for choice in ("always", "never", "auto"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        results[choice] = DMP(preprocessing=steps).learn(ragged).weights
    agree(results["always"], results["never"], 1e-8)
    agree(results["auto"], results["never"], 1e-8)


def test_an_unknown_choice_of_compiled_code_is_refused(monkeypatch, ragged):
    monkeypatch.setenv("KINEME_COMPILED", "yes")
    with pytest.raises(SpecificationError, match=r"KINEME_COMPILED to be one of .*'always', 'never'.* got 'yes'"):
        DMP().learn(ragged)


def test_numba_is_loaded_for_a_large_job_or_after_many_small_ones(monkeypatch):
    monkeypatch.delenv("KINEME_COMPILED", raising=False)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    monkeypatch.setattr(compiled, "_load", lambda: True)
    monkeypatch.setattr(compiled, "_REPAYS_IMPORT", 1000)
    monkeypatch.setattr(compiled, "_spent", 0)
    assert [compiled.use_compiled(n) for n in (999, 1000)] == [False, True]
    monkeypatch.setattr(compiled, "_spent", 0)
    assert [compiled.use_compiled(300) for _ in range(4)] == [False, False, False, True]
    monkeypatch.setattr(compiled, "_spent", 0)
    assert [compiled.use_compiled(900, 10) for _ in range(100)] == [False] * 99 + [True]


def test_one_thread_and_two_learn_and_move_the_same(monkeypatch, ragged):
    monkeypatch.setattr(encode, "_TILE_SAMPLES", 2000)
    monkeypatch.setattr("kineme.dmp.discrete.rollout._TILE_SAMPLES", 2000)
    paths = []
    for threads in ("1", "2"):
        monkeypatch.setenv("KINEME_NUM_THREADS", threads)
        paths.append(DMP().learn(ragged).rollout().positions)
    np.testing.assert_allclose(paths[0], paths[1], rtol=1e-12)


@pytest.mark.parametrize("wanted", ["0", "-1", "two", "1.5", "", "²"])
def test_a_number_of_threads_that_is_none_is_refused(monkeypatch, ragged, wanted):
    monkeypatch.setenv("KINEME_NUM_THREADS", wanted)
    with pytest.raises(SpecificationError, match=f"KINEME_NUM_THREADS to be a whole number from 1, got '{wanted}'"):
        DMP().learn(ragged)


@pytest.fixture
def two_blas_threads(monkeypatch):
    """Two tiles at once, and two threads of BLAS to come back to."""
    monkeypatch.setenv("KINEME_NUM_THREADS", "2")
    with threadpool_limits(limits=2, user_api="blas"):
        yield


def _blas_threads():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.mark.parametrize("n_tiles", [1, 2])
def test_tiles_hold_blas_to_one_thread(two_blas_threads, n_tiles):
    seen = []
    parallel.for_tiles(lambda start, stop: seen.append(_blas_threads()), n_tiles, 1)
    assert seen == [{1}] * n_tiles


def test_every_thread_holds_blas_to_one_thread_and_gives_it_back(two_blas_threads):
    """Whichever thread set a limit first, and though it is still there."""

    def hold():
        with parallel.single_threaded_blas():
            return _blas_threads()

    for _ in range(2):
        assert hold() == {1}
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(hold).result() == {1}
            assert _blas_threads() == {2}
            assert hold() == {1}
    assert _blas_threads() == {2}


def test_the_threads_of_blas_are_as_before_after_concurrent_learners(monkeypatch, two_blas_threads, ragged):
    monkeypatch.setattr(encode, "_TILE_SAMPLES", 2000)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: DMP().learn(ragged), range(40)))
    assert _blas_threads() == {2}


def test_the_threads_of_blas_are_as_before_after_an_error(two_blas_threads):
    def fail(start, stop):
        raise ZeroDivisionError(f"{start} to {stop}")

    with pytest.raises(ZeroDivisionError, match="0 to 1"):
        parallel.for_tiles(fail, 4, 1)
    assert _blas_threads() == {2}


@pytest.mark.parametrize("n_rows", [0, 1, 7, 8])
def test_tiles_cover_all_rows_once(monkeypatch, n_rows):
    monkeypatch.setenv("KINEME_NUM_THREADS", "2")
    seen = np.zeros(n_rows, dtype=int)

    def count(start, stop):
        seen[start:stop] += 1

    parallel.for_tiles(count, n_rows, 3)
    assert (seen == 1).all()


def test_read_only_input_is_learned_and_left_as_it_is(dmp, make_movement):
    block = np.stack([make_movement(seed, n_samples=60)[1] for seed in range(3)])
    kept = block.copy()
    block.setflags(write=False)
    learned = dmp.learn(block)
    learned.shape_attractor()
    learned.rollout()
    np.testing.assert_array_equal(block, kept)


def test_results_cannot_write_into_the_input(make_movement):
    block = np.stack([make_movement(seed, n_samples=60)[1] for seed in range(3)])
    times = np.linspace(0, 1, 60)
    labels = np.array(["a", "b", "c"])
    demos = Demonstrations.from_arrays(block, labels, times)
    learned = DMP().learn(demos)
    for array in (
        demos.positions,
        demos.times,
        demos.labels,
        demos.offsets,
        learned.starts,
        learned.goals,
        learned.labels,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = array[-1]


def test_the_input_stays_writable(make_movement):
    block = np.stack([make_movement(seed, n_samples=60)[1] for seed in range(3)])
    DMP().learn(block)
    assert block.flags.writeable


def test_primitives_do_not_freeze_arrays_that_they_are_made_of(make_movement):
    learned = DMP().learn([make_movement(0)[1]])
    goals = learned.goals + 1.0
    type(learned)(**{**learned.__dict__, "goals": goals})
    assert goals.flags.writeable


def test_even_recordings_of_any_length_are_learned(agree):
    """20,000 samples: a dense spline would need 3 GB per intermediate."""
    u = np.linspace(0, 1, 20_001)
    path = np.column_stack((np.sin(3 * u), np.cos(2 * u) + u))
    dmp = DMP(n_basis=20)
    agree(dmp.learn([path]).weights, dmp.learn([path[::100]]).weights, 1e-4)
