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
from kineme.experiments.evaluation.protocols import PROTOCOLS
from kineme.experiments.evaluation.ranks import rank_rows
from kineme.experiments.evaluation.results import Results, collect
from kineme.experiments.evaluation.rows import Row, make_rows
from kineme.experiments.evaluation.score_split import Scores, does, score_split
from kineme.experiments.evaluation.trials import TASKS, Settings
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
    """The result of a run: tables, results, every value as a row, and the files written."""

    tables: list[Table]
    results: Results
    rows: list[Row]
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
    absent = {name: why for name in plan[1] if (why := METHODS[name].unavailable())}
    skipped = {name: why for name in plan[0] if (why := PROTOCOLS[name].unsuitable(data))}
    for name in set(plan[0]) - set(skipped):
        task = PROTOCOLS[name].task
        if not any(does(method, task) for method in plan[1]):
            skipped[name] = f"none of the methods can {TASKS[task].words}"
    jobs = _jobs(data, plan, settings, {*absent, *skipped})
    scores = dict(runner.progress(runner.run(data, jobs, settings), total=len(jobs)))
    ordered = {job: scores[job] for job in jobs}
    results, rows = collect(ordered, absent, skipped), make_rows(data, ordered)
    facts = {
        "data": data.name,
        "movements": len(demos),
        **settings._asdict(),
        "shots": list(settings.shots) or "each protocol's own",
        "versions": _versions(),
    }
    return _write(data, (results, rows), facts, out, time.perf_counter() - began)


def _jobs(data: DataSet, plan: tuple[Sequence[str], Sequence[str]], settings: Settings, without: set[str]) -> list[Job]:
    return [
        Job(protocol, method, split)
        for method in plan[1]
        if method not in without
        for protocol in plan[0]
        if protocol not in without and does(method, PROTOCOLS[protocol].task)
        for split in range(PROTOCOLS[protocol].n_splits(data, settings))
    ]


class Runner(NamedTuple):
    """How jobs are run: in this process, or side by side in others; `progress` is as `tqdm.tqdm`."""

    processes: int
    progress: Callable[..., Any]

    def run(self, data: DataSet, jobs: list[Job], settings: Settings) -> Iterator[tuple[Job, list[Scores]]]:
        """(job, its scores) as they come."""
        if self.processes == 1:
            yield from ((job, score_split(data, *job, settings)) for job in jobs)
            return
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.processes, context, _init_worker, (data,)) as pool:
            waiting = {pool.submit(_run_job, job, settings): job for job in jobs}
            for future in as_completed(waiting):
                yield waiting[future], future.result()


_shared: dict[str, DataSet] = {}  # the data of a worker process


def _init_worker(data: DataSet) -> None:
    """Prepare a worker process; it has one core, so neither kineme nor BLAS should start more threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    os.environ["KINEME_NUM_THREADS"] = "1"
    os.environ.setdefault("KINEME_COMPILED", "always")  # each job is small; together they repay loading Numba
    _shared["data"] = data


def _run_job(job: Job, settings: Settings) -> list[Scores]:
    return score_split(_shared["data"], *job, settings)


def _write(
    data: DataSet, found: tuple[Results, list[Row]], facts: dict[str, Any], out: Path, seconds: float
) -> Evaluation:
    from kineme.experiments.evaluation.report import make_tables, write_report

    results, rows = found
    tables = make_tables(results)
    html = write_report(data, results, tables, rank_rows(rows), facts)
    numbers = {"format": _FORMAT, **facts, "left_out": data.left_out, **results.numbers()}
    numbers["seconds"] = {"whole": round(seconds, 2), **results.seconds()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
    files = [
        write_atomically(out / "evaluation.html", html.encode()),
        write_atomically(out / "evaluation.json", text.encode()),
    ]
    return Evaluation(list(tables.values()), results, rows, files)


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
