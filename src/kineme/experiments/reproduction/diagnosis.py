"""The tables that explain the paper's numbers: conventions, widths and the penalty of the SVM."""

from __future__ import annotations

import numpy as np

from kineme.experiments.reproduction import paper
from kineme.experiments.reproduction.columns import COLUMNS, KERNELS, PRINTED, Draws, over
from kineme.experiments.reproduction.conclusions import (
    Printed,
    read_conventions,
    read_order,
    read_penalty,
    read_perfect,
)
from kineme.experiments.reproduction.representations import REPRESENTATIONS
from kineme.output.table import Table, mean_and_range

_PAPER_SAYS = (
    'The paper says "f(t)" for what Eqs. (1) and (4) call f and for the shape-attractor, and prints neither gating nor '
    "divisions."
)


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


def _conventions(draws: Draws, kind: str, column: tuple[str, str], suffix: str = "") -> dict[str, list[float]]:
    """Feature -> accuracies, of all conventions that a column of the paper can mean."""
    return {
        row.formula: over(draws, kind, row.key + suffix)
        for row in REPRESENTATIONS.values()
        if (row.formulation, row.quantity) == column
    }


def read_diagnosis(draws: Draws) -> str:
    """The conventions with the paper's accuracies, the cost of the division, and the features without errors."""
    accuracies = [
        Printed(head, paper.NEAREST_NEIGHBOR[cell], _conventions(draws, "nearest", cell))
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
        Printed(f"{kernel}, {head}", PRINTED[name][cell], _conventions(draws, "svm", cell, f"/{name}/paper"))
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
