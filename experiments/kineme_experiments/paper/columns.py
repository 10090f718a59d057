"""The columns of the paper's tables, and their values in the draws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kineme_experiments.paper import paper
from kineme_experiments.paper.representations import READINGS

Draws = list[dict[str, Any]]  # results of `experiments.run_draw`, one per draw

CLOSEST, DEFAULT = READINGS

#: Names of the columns, in the order of `paper.CELLS`.
COLUMNS = tuple(f"{quantity}, {formulation}" for formulation, quantity in paper.CELLS)
KERNELS = {"rbf": "RBF", "tre": "TrE"}

#: Kernel -> cell -> accuracy of the SVM in the paper.
PRINTED = {"rbf": paper.SVM_RBF, "tre": paper.SVM_TRE}


def over(draws: Draws, kind: str, key: str) -> list[float]:
    """One value from each draw that has it."""
    return [draw[kind][key] for draw in draws if kind in draw]


def columns_of(draws: Draws, kind: str, reading: str, suffix: str = "") -> dict[str, list[float]]:
    """Column -> the accuracies of a reading, one per draw."""
    return {head: over(draws, kind, key + suffix) for head, key in zip(COLUMNS, READINGS[reading], strict=True)}


def by_column(cells: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """Column -> the paper's number."""
    return {head: cells[cell] for head, cell in zip(COLUMNS, paper.CELLS, strict=True)}
