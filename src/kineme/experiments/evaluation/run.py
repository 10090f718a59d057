"""Run an evaluation: every method in every split of every protocol, in processes; then report and numbers."""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple

from kineme.experiments.evaluation.data import DataSet
from kineme.experiments.evaluation.methods import METHODS
from kineme.experiments.evaluation.protocols import PROTOCOLS, Settings
from kineme.experiments.evaluation.results import Results, collect
from kineme.experiments.evaluation.score_split import Scores, classifies_partial, score_split
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.output.atomic import write_atomically
from kineme.output.table import Table

_FORMAT = 1  # of evaluation.json
_PACKAGES = ("kineme", "numpy", "scipy", "scikit-learn", "dtaidistance", "tslearn", "aeon", "dollarpy", "hmmlearn")


class Job(NamedTuple):
    """One method in one split of one protocol."""

    protocol: str
    method: str
    split: int


class Evaluation(NamedTuple):
    """The result of a run: tables, numbers, and the files written."""

    tables: list[Table]
    results: Results
    files: list[Path]


def evaluate(
    data: DataSet, plan: tuple[Sequence[str], Sequence[str]], settings: Settings, out: Path, runner: Runner
) -> Evaluation:
    """Compute everything and write ``evaluation.html`` and ``evaluation.json``.

    Parameters
    ----------
    data : DataSet
    plan : tuple of two sequences
        Names of protocols, and of methods.
    settings : Settings
    out : Path
        Folder for the files; created if it does not exist.
    runner : Runner
        Number of processes, and how to show progress.

    Raises
    ------
    OSError
        The folder cannot be written; checked before the work begins.
    """
    out.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=out).close()  # a folder that cannot be written fails now, not after the work
    began = time.perf_counter()
    demos = data.demonstrations
    absent = {name: why for name in plan[1] if (why := METHODS[name].unavailable(demos.n_dims))}
    skipped = {name: why for name in plan[0] if (why := PROTOCOLS[name].unsuitable(demos))}
    if "earliness" in plan[0] and not any(map(classifies_partial, plan[1])):
        skipped["earliness"] = "none of the methods classifies movements before their end"
    jobs = _jobs(demos, plan, settings, {*absent, *skipped})
    scores = dict(runner.progress(runner.run(demos, jobs, settings), total=len(jobs)))
    results = collect({job: scores[job] for job in jobs}, absent, skipped)
    facts = {
        "data": data.name,
        "movements": len(demos),
        **settings._asdict(),
        "shots": list(settings.shots),
        "versions": _versions(),
    }
    return _write(data, results, facts, out, time.perf_counter() - began)


def _jobs(
    demos: Demonstrations, plan: tuple[Sequence[str], Sequence[str]], settings: Settings, without: set[str]
) -> list[Job]:
    """All jobs, slow methods first: otherwise they would run alone at the end."""
    methods = sorted((name for name in plan[1] if name not in without), key=lambda name: not METHODS[name].slow)
    return [
        Job(protocol, method, split)
        for method in methods
        for protocol in plan[0]
        if protocol not in without and (protocol != "earliness" or classifies_partial(method))
        for split in range(PROTOCOLS[protocol].n_splits(demos, settings))
    ]


class Runner(NamedTuple):
    """How jobs are run: in this process, or side by side in others; `progress` is as `tqdm.tqdm`."""

    processes: int
    progress: Callable[..., Any]

    def run(self, demos: Demonstrations, jobs: list[Job], settings: Settings) -> Iterator[tuple[Job, list[Scores]]]:
        """(job, its scores) as they come."""
        if self.processes == 1:
            yield from ((job, score_split(demos, *job, settings)) for job in jobs)
            return
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.processes, context, _init_worker, (demos,)) as pool:
            waiting = {pool.submit(_run_job, job, settings): job for job in jobs}
            for future in as_completed(waiting):
                yield waiting[future], future.result()


_shared: dict[str, Demonstrations] = {}  # the data of a worker process


def _init_worker(demos: Demonstrations) -> None:
    """Prepare a worker process; it has one core, so neither kineme nor BLAS should start more threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    os.environ["KINEME_NUM_THREADS"] = "1"
    os.environ.setdefault("KINEME_COMPILED", "always")  # each job is small; together they repay loading Numba
    _shared["demos"] = demos


def _run_job(job: Job, settings: Settings) -> list[Scores]:
    return score_split(_shared["demos"], *job, settings)


def _write(data: DataSet, results: Results, facts: dict[str, Any], out: Path, seconds: float) -> Evaluation:
    from kineme.experiments.evaluation.report import make_tables, write_report

    tables = make_tables(results)
    html = write_report(data, results, tables, facts)
    numbers = {"format": _FORMAT, **facts, "left_out": data.left_out, **results.numbers()}
    numbers["seconds"] = {"whole": round(seconds, 2), **results.seconds()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
    files = [
        write_atomically(out / "evaluation.html", html.encode()),
        write_atomically(out / "evaluation.json", text.encode()),
    ]
    return Evaluation(list(tables.values()), results, files)


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
