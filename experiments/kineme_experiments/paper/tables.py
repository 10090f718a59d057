"""The paper's Tables 1 to 4: our numbers beside the printed ones, and the conclusions."""

from __future__ import annotations

from statistics import fmean

import numpy as np

from kineme.datasets.lasa import LASA_26
from kineme.reporting.table import Table
from kineme_experiments.paper import paper
from kineme_experiments.paper.columns import (
    CLOSEST,
    COLUMNS,
    DEFAULT,
    KERNELS,
    PRINTED,
    Draws,
    by_column,
    columns_of,
    over,
)
from kineme_experiments.paper.conclusions import (
    Printed,
    read_ahead,
    read_conventions,
    read_counts,
    read_left_out,
    read_nearer,
    read_order,
    read_penalty,
    read_perfect,
    read_placement,
    read_widths,
)
from kineme_experiments.paper.representations import READINGS, REPRESENTATIONS
from kineme_experiments.ranges import mean_and_range

_PAPER_SAYS = (
    'The paper says "f(t)" for what Eqs. (1) and (4) call f and for the shape-attractor, and prints neither gating nor '
    "divisions."
)


def make_tables(draws: dict[str, Draws]) -> tuple[list[Table], list[Table]]:
    """The tables of the nine letters, and those of all shapes, for the draws of each data set."""
    small, large = draws["paper"], draws["lasa-26"]
    letters, shapes = "nine letters", f"all {len(LASA_26)} single shapes of LASA"
    of_letters = [
        _counts(),
        _nearest(small, f"Table 2. Accuracy of 1-NN, leave one out, {letters}", with_paper=True),
        _parameters(small),
        _svm(small, f"Table 4. Accuracy of the SVM, leave one out, {letters}", with_paper=True),
        diagnosis(small),
        svm_diagnosis(small),
        penalty(small),
    ]
    of_shapes = [_nearest(large, f"Table 2 on {shapes}", with_paper=False)]
    if any("svm" in one for one in large):
        of_shapes.append(_svm(large, f"Table 4 on {shapes}", with_paper=False))
    return of_letters, of_shapes


def _counts() -> Table:
    n = len(paper.COUNTS)
    printed = [value for table in (paper.NEAREST_NEIGHBOR, *PRINTED.values()) for value in table.values()]
    return Table(
        "Table 1. Movements per letter",
        ("", *paper.COUNTS, "all"),
        [
            ("paper", *map(str, paper.COUNTS.values()), str(sum(paper.COUNTS.values()))),
            ("ours, each draw of the 7", *[str(paper.PER_CLASS)] * n, str(n * paper.PER_CLASS)),
        ],
        read_counts(printed, sum(paper.COUNTS.values()), n * paper.PER_CLASS),
    )


def _nearest(draws: Draws, title: str, with_paper: bool) -> Table:
    rows = [("paper", *(f"{paper.NEAREST_NEIGHBOR[cell]:.3f}" for cell in paper.CELLS))] if with_paper else []
    by_reading = {reading: columns_of(draws, "nearest", reading) for reading in READINGS}
    rows += [(reading, *map(mean_and_range, columns.values())) for reading, columns in by_reading.items()]
    correlation = [mean_and_range(over(draws, "correlation", key)) for key in ("original-w", "bio-w")]
    rows.append(("correlation of w (Ijspeert 2003)", *correlation, "-", "-"))
    return Table(f"{title} ({len(draws)} draws: mean, range)", ("", *COLUMNS), rows, read_nearest(draws, with_paper))


def read_nearest(draws: Draws, with_paper: bool) -> str:
    """Conclusions from the accuracies of 1-NN: the paper's among ours, the feature that is ahead, omitted movements."""
    by_reading = {reading: columns_of(draws, "nearest", reading) for reading in READINGS}
    sentences = []
    if with_paper:
        printed = by_column(paper.NEAREST_NEIGHBOR)
        sentences += [read_placement(reading.capitalize(), printed, columns) for reading, columns in by_reading.items()]
        sentences.append(read_nearer(printed, by_reading))
    for formulation in ("original", "bio-inspired"):
        pair = (by_reading[DEFAULT][f"{quantity}, {formulation}"] for quantity in ("f(t)", "weights"))
        sentences.append(read_order(f"{DEFAULT.capitalize()}, {formulation}", ("f(t)", "weights"), *pair))
    sentences.append(read_left_out(draws[0]["left_out"]))
    return " ".join(filter(None, sentences))


def _parameters(draws: Draws) -> Table:
    def widths(keys: tuple[str, ...], kernel: str) -> tuple[str, ...]:
        return tuple(f"{np.mean(over(draws, 'width', f'{key}/{kernel}')):.3g}" for key in keys)

    rows = [
        ("RBF sigma, paper", *(f"{paper.KERNELS[cell].rbf.sigma:.3g}" for cell in paper.CELLS)),
        (f"RBF sigma, median, {CLOSEST}", *widths(READINGS[CLOSEST], "rbf")),
        (f"RBF sigma, median, {DEFAULT}", *widths(READINGS[DEFAULT], "rbf")),
        ("TrE m, paper", *(f"{paper.KERNELS[cell].truncated.m:.3g}" for cell in paper.CELLS)),
        (f"TrE m, median, {CLOSEST}", *widths(READINGS[CLOSEST], "tre")),
        (f"TrE m, median, {DEFAULT}", *widths(READINGS[DEFAULT], "tre")),
    ]
    return Table("Table 3. Widths of the kernels", ("", *COLUMNS), rows, read_parameters(draws))


def read_parameters(draws: Draws) -> str:
    """The columns in which the paper's RBF widths are like the median distances of one reading, and of the other."""
    printed = {head: paper.KERNELS[cell].rbf.sigma or 0.0 for head, cell in zip(COLUMNS, paper.CELLS, strict=True)}
    medians = {
        reading: {head: fmean(values) for head, values in columns_of(draws, "width", reading, "/rbf").items()}
        for reading in READINGS
    }
    return " ".join(read_widths(reading.capitalize(), printed, columns) for reading, columns in medians.items())


def _svm(draws: Draws, title: str, with_paper: bool) -> Table:
    rows = []
    for name, kernel in KERNELS.items():
        if with_paper:
            rows.append((f"{kernel}: paper", *(f"{PRINTED[name][cell]:.3f}" for cell in paper.CELLS)))
        for reading, widths, words in (
            (CLOSEST, "paper", "Table 3 widths"),
            (CLOSEST, "median", "median widths"),
            (DEFAULT, "median", "median widths"),
        ):
            cells = map(mean_and_range, columns_of(draws, "svm", reading, f"/{name}/{widths}").values())
            rows.append((f"{kernel}: {reading}, {words}", *cells))
    n = sum("svm" in draw for draw in draws)
    reading = read_svm(draws, with_paper)
    return Table(f"{title} ({n} draws: mean, range; C = {paper.PENALTY:g})", ("", *COLUMNS), rows, reading)


def read_svm(draws: Draws, with_paper: bool) -> str:
    """Conclusions from the accuracies of the SVM: the paper's among ours, and the kernel that is ahead."""
    rbf, tre = (columns_of(draws, "svm", CLOSEST, f"/{name}/paper") for name in KERNELS)
    sentences = []
    if with_paper:
        sentences += [
            read_placement(f"{kernel} with the paper's widths", by_column(PRINTED[name]), columns)
            for (name, kernel), columns in zip(KERNELS.items(), (rbf, tre), strict=True)
        ]
    return " ".join([*sentences, read_ahead("With the paper's widths", ("TrE", "RBF"), tre, rbf)])


def diagnosis(draws: Draws) -> Table:
    """1-NN under each convention, with the distances that distinguish it."""
    rows: list[tuple[str, ...]] = [
        (
            row.formula,
            row.formulation,
            row.quantity,
            mean_and_range(over(draws, "nearest", row.key)),
            f"{paper.NEAREST_NEIGHBOR[row.formulation, row.quantity]:.3f}",
            f"{np.median(over(draws, 'distance', row.key)):.2g}",
            f"{paper.KERNELS[row.formulation, row.quantity].rbf.sigma:.2g}",
            row.why,
        )
        for row in REPRESENTATIONS.values()
    ]
    return Table(
        "Diagnosis. What the numbers depend on: 1-NN, leave one out, nine letters",
        ("feature", "formulation", "column", "ours", "paper", "median distance", "paper's sigma", "why"),
        rows,
        f"{_PAPER_SAYS} {read_diagnosis(draws)}",
    )


def conventions(draws: Draws, kind: str, column: tuple[str, str], suffix: str = "") -> dict[str, list[float]]:
    """Feature -> accuracies, of all conventions that a column of the paper can mean."""
    return {
        row.formula: over(draws, kind, row.key + suffix)
        for row in REPRESENTATIONS.values()
        if (row.formulation, row.quantity) == column
    }


def read_diagnosis(draws: Draws) -> str:
    """The conventions with the paper's accuracies, the cost of the division, and the features without errors."""
    accuracies = [
        Printed(head, paper.NEAREST_NEIGHBOR[cell], conventions(draws, "nearest", cell))
        for head, cell in zip(COLUMNS, paper.CELLS, strict=True)
    ]
    sentences = [read_conventions(accuracies)]
    for column, whole, divided in (("weights", "bio-w", "bio-w-over-s"), ("f(t)", "bio-f", "bio-f-over-s")):
        without, with_s = (over(draws, "nearest", key) for key in (whole, divided))
        sentences.append(read_order(f"Bio-inspired {column}", ("not divided by s", "divided by s"), without, with_s))
    by_feature = {
        f"{row.formula} ({row.formulation})": over(draws, "nearest", row.key) for row in REPRESENTATIONS.values()
    }
    sentences.append(read_perfect("Features that recognize every letter of every draw", by_feature))
    return " ".join(sentences)


def svm_diagnosis(draws: Draws) -> Table:
    """The SVM under each convention, with the printed widths."""
    rows = [
        (
            row.formula,
            row.formulation,
            row.quantity,
            *(
                text
                for name in KERNELS
                for text in (
                    mean_and_range(over(draws, "svm", f"{row.key}/{name}/paper")),
                    f"{PRINTED[name][row.formulation, row.quantity]:.3f}",
                )
            ),
        )
        for row in REPRESENTATIONS.values()
    ]
    accuracies = [
        Printed(f"{kernel}, {head}", PRINTED[name][cell], conventions(draws, "svm", cell, f"/{name}/paper"))
        for name, kernel in KERNELS.items()
        for head, cell in zip(COLUMNS, paper.CELLS, strict=True)
    ]
    return Table(
        "Diagnosis. Table 4 under each convention: SVM with the paper's own widths, leave one out, nine letters",
        ("feature", "formulation", "column", "RBF", "paper", "TrE", "paper"),
        rows,
        read_conventions(accuracies),
    )


def penalty(draws: Draws) -> Table:
    """The SVM for several penalties."""
    accuracies = {
        kernel: {
            **{C: over(draws, "penalty", f"original-sa/{name}/{C:g}") for C in paper.PENALTIES[:-1]},
            paper.PENALTY: over(draws, "svm", f"original-sa/{name}/median"),
        }
        for name, kernel in KERNELS.items()
    }
    at_bound = {kernel: over(draws, "at_bound", f"original-sa/{name}") for name, kernel in KERNELS.items()}
    return Table(
        "Diagnosis. Why an SVM can land at 1/9: the penalty C, shape-attractor, original, median widths",
        ("", *(f"C = {C:g}" for C in paper.PENALTIES)),
        [(kernel, *map(mean_and_range, by_penalty.values())) for kernel, by_penalty in accuracies.items()],
        f"{read_penalty(accuracies, at_bound, len(paper.COUNTS))} The tables above use C = {paper.PENALTY:g}.",
    )
