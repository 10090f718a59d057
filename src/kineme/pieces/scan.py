"""The best k of many movements by the bounds of their reduced features, without comparing most of them.

The score of a movement is the bound of `similarity.bounds.log_bounds`, in double precision, rounded to single. In each
representation it depends on a distance, the norm of ``z_a - R z_b`` with z the reduced features and the norm of the
residual, R the best rotation that is allowed, and more under a prior. Numbers that no rotation changes differ by no
more than that (Cauchy-Schwarz): the norms of single coordinates of the reduced features over all dimensions, and the
norm of all that is left. These *marks* bound the score of a movement, and their least and greatest values in a block of
movements bound the scores of the block: a block, then a movement, whose bound is below the k-th best score is passed
over. So the result is exactly that of comparing all. Where nothing is rotated, marks are coordinates with their signs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.procrustes import Procrustes
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.similarity.bounds import ReducedFeatures, log_bounds
from kineme.similarity.similarity import AveragedSimilarity
from kineme.validation import Array

Single = NDArray[np.float32]
Rows = NDArray[np.int64]

BLOCK = 128  # movements
_ROTATED, _SIGNED = 6, 8  # marks of a representation besides the last one
_MEANS = ("arithmetic", "quadratic", "geometric", "harmonic", "min")
_SLACK = 1e-5  # of squared norms, and of logarithms, as of the compiled twin
_OPERATIONS = 200  # of a block's bound
_PLAIN_BLOCKS = 64  # at a time


class Index(NamedTuple):
    """Rows of reduced features, those with similar marks in one block of `BLOCK`."""

    marks: Single  # (blocks, M, BLOCK), far away where the last block has no rows
    lows: Single  # (blocks, M), the least marks
    highs: Single  # (blocks, M)
    reduced: Single  # (n, W), of each representation values, square and residual norm


class Query(NamedTuple):
    """The same of one movement, in the parts that the compiled loop takes."""

    marks: Single  # (M,)
    reduced: Array  # (W,)
    squares: Array  # (R,)
    residuals: Array  # (R,)


class Best(NamedTuple):
    """The best k rows so far, as a heap: the least score first."""

    scores: Single  # (k,), -inf where there is none yet
    rows: Rows  # (k,)
    state: Array  # (3,): a score that k others have reached; the largest one that had no place; rows compared


def best_of(k: int) -> Best:
    """Return room for the best k."""
    return Best(np.full(k, -np.inf, np.float32), np.full(k, -1), np.array([-np.inf, -np.inf, 0.0]))


@dataclass(frozen=True, eq=False)
class Plan:
    """How rows are compared: by R representations of widths and weights, each with so many reduced coordinates.

    `similarity` is over the representations compared sample by sample that have a weight.
    """

    similarity: AveragedSimilarity
    n_reduced: tuple[int, ...]  # k of each

    @property
    def procrustes(self) -> Procrustes:
        """The distance between rows."""
        return self.similarity.procrustes

    @cached_property
    def log_weights(self) -> Array:
        """Logarithms of what the kernels are multiplied by, (R,); in the arithmetic mean they are then added up."""
        logs = self.similarity.log_weights()
        return logs - math.log(len(logs)) if self.similarity.mean == "arithmetic" else logs

    @cached_property
    def kind(self) -> int:
        """0: no rotation; 1: in the plane, within a limit; 2: in the plane, under a prior; 3: in space."""
        p = self.procrustes
        if p.max_angle == 0 or p.n_dims not in (2, 3):
            return 0
        return 3 if p.n_dims == 3 else 1 if p.prior is None else 2

    @cached_property
    def begins(self) -> NDArray[np.intp]:
        """Where the values of each representation begin in a row, and the width of a row, (R + 1,)."""
        return np.cumsum([0, *(self.procrustes.n_columns * k + 2 for k in self.n_reduced)])

    @cached_property
    def n_marks(self) -> list[int]:
        """Marks of each representation."""
        d = self.procrustes.n_columns
        return [min(_ROTATED, k) + 1 if self.kind else min(_SIGNED, d * k) + 1 for k in self.n_reduced]

    @cached_property
    def numbers(self) -> tuple[NDArray[Any], ...]:
        """Return what the compiled loop takes."""
        turns, p = np.zeros((3, 3)), self.procrustes
        if self.kind == 1:
            turns[0, :2] = math.cos(p.max_angle), math.sin(p.max_angle)
        elif self.kind == 2 and p.prior is not None:
            turns[2, 2] = np.trace(p.prior.matrix(2))
        elif self.kind == 3 and p.prior is not None:
            turns[:] = p.prior.matrix(3)
        counts = np.array([p.n_columns * k for k in self.n_reduced])
        halves, mean = 0.5 / self.similarity.widths**2, _MEANS.index(self.similarity.mean)
        ends, codes = np.cumsum([0, *self.n_marks]), np.array([mean, self.kind])
        return ends, self.begins[:-1], counts, halves, self.log_weights, codes, turns

    def marks(self, reduced: NDArray[Any]) -> Single:
        """Return the marks (n, M) of rows (n, W)."""
        parts = []
        for r, features in enumerate(self.features(reduced)):
            coordinates = features.values.reshape(len(reduced), self.procrustes.n_columns, -1)
            if self.kind:
                coordinates = self.procrustes.by_points(features.values).reshape(coordinates.shape)
                squares = np.einsum("ndk,ndk->nk", coordinates, coordinates)
                signed = np.sqrt(squares)
            else:
                signed = coordinates.transpose(0, 2, 1).reshape(len(reduced), -1)
                squares = signed * signed
            most = self.n_marks[r] - 1
            left = np.sqrt(squares[:, most:].sum(axis=1) + features.residual_norms**2)
            parts += [signed[:, :most], left[:, None]]
        return np.concatenate(parts, axis=1).astype(np.float32)

    def features(self, reduced: NDArray[Any], dtype: Any = np.float64) -> tuple[ReducedFeatures, ...]:
        """Return rows (n, W) as reduced features of each representation, with the x of all points first."""
        columns = (
            reduced[:, first:last].astype(dtype) for first, last in zip(self.begins, self.begins[1:], strict=False)
        )
        return tuple(ReducedFeatures(part[:, :-2], part[:, -2], part[:, -1]) for part in columns)

    def queries(self, reduced: NDArray[Any]) -> list[Query]:
        """Return rows (n, W), each as a query."""
        rows, marks = reduced.astype(np.float64), self.marks(reduced)
        # Contiguous, as all else: for another layout the scan would be compiled again.
        squares, residuals = (np.take(rows, self.begins[1:] - k, axis=1) for k in (2, 1))
        return [Query(*parts) for parts in zip(marks, rows, squares, residuals, strict=True)]

    def index(self, reduced: Single) -> tuple[Index, Rows]:
        """Return rows (n, W) in the order in which they are searched, and that order (n,)."""
        marks: Single = self.marks(reduced)
        widths = np.repeat(self.similarity.widths, self.n_marks)
        order = np.concatenate(_halved(np.asarray(marks / widths, dtype=np.float32), np.arange(len(marks))))
        n, blocks = len(marks), -(-len(marks) // BLOCK)
        padded = np.full((blocks * BLOCK, marks.shape[1]), np.nan, np.float32)
        padded[:n] = marks[order]
        by_block = np.ascontiguousarray(padded.reshape(blocks, BLOCK, -1).transpose(0, 2, 1))
        lows, highs = np.nanmin(by_block, axis=2), np.nanmax(by_block, axis=2)
        return Index(np.nan_to_num(by_block, nan=1e15), lows, highs, reduced[order]), order


def plan_of(similarity: AveragedSimilarity, n_reduced: list[int]) -> tuple[Plan, list[int]]:
    """Return the plan for an average over R representations, and numbers of those that count in it.

    `similarity` is of those that are compared sample by sample, with `n_reduced` coordinates each.
    """
    chosen = np.flatnonzero(np.isfinite(similarity.log_weights()))
    weights = None if similarity.weights is None else similarity.weights[chosen]
    some = AveragedSimilarity(similarity.procrustes, similarity.widths[chosen], similarity.mean, weights)
    return Plan(some, tuple(n_reduced[r] for r in chosen.tolist())), chosen.tolist()


def _halved(marks: Single, rows: Rows) -> list[Rows]:
    """Divide rows again and again at the middle of the mark that varies most, into blocks."""
    blocks = -(-len(rows) // BLOCK)
    if blocks <= 1:
        return [rows]
    some, middle = marks[rows], blocks // 2 * BLOCK
    order = np.argpartition(some[:, some.var(axis=0).argmax()], middle)
    return [*_halved(marks, rows[order[:middle]]), *_halved(marks, rows[order[middle:]])]


def scan(plan: Plan, index: Index, query: Query, best: Best, first_row: int) -> None:
    """Go on with the best rows by those of an index, which are numbered from `first_row`."""
    if use_compiled(_OPERATIONS * len(index.lows)):
        compiled = compiled_module("kineme.pieces._compiled")
        compiled.scan(tuple(index), tuple(query), plan.numbers, *best, first_row)
        return
    scan_plain(plan, index, query, best, first_row)


def scan_plain(plan: Plan, index: Index, query: Query, best: Best, first_row: int) -> None:
    """Do the same without a compiler, up to 64 blocks at a time, those with the largest bounds first."""
    nearest = np.clip(query.marks, index.lows, index.highs)
    far = np.maximum(np.abs(index.lows), np.abs(index.highs))
    slack = _SLACK * _by_representation(plan, far.astype(np.float64) ** 2 + query.marks.astype(np.float64) ** 2)
    away = _by_representation(plan, (nearest.astype(np.float64) - query.marks) ** 2)
    bounds = _bounds(plan, away - slack)
    order = np.argsort(-bounds, kind="stable")
    asked = plan.features(query.reduced[None])
    start, count = 0, 1
    while start < len(order):
        blocks = order[start : start + count]
        start, count = start + count, min(2 * count, _PLAIN_BLOCKS)  # the first few set the bar
        blocks = blocks[bounds[blocks] >= _bar(best)]
        if not len(blocks):
            return
        away = (index.marks[blocks].astype(np.float64) - query.marks[:, None]) ** 2
        away = _by_representation(plan, away.transpose(0, 2, 1)) - slack[:, blocks, None]
        doubtful = (blocks[:, None] * BLOCK + np.arange(BLOCK))[_bounds(plan, away) >= _bar(best)]
        rows = doubtful[doubtful < len(index.reduced)]
        if len(rows):
            scores = _log_bounds(plan, asked, plan.features(index.reduced[rows]))
            _keep(best, scores, rows + first_row)


def _by_representation(plan: Plan, squares: Array) -> Array:
    """Add squares (..., M) up over the marks of each representation, (R, ...)."""
    parts = np.split(squares, np.cumsum(plan.n_marks)[:-1], axis=-1)
    return np.stack([part.sum(axis=-1) for part in parts])


def _bounds(plan: Plan, squares: Array) -> Array:
    """Bound scores by squared distances (R, ...)."""
    shape = (-1,) + (1,) * (squares.ndim - 1)
    halves = (0.5 / plan.similarity.widths**2).reshape(shape)
    logs = plan.log_weights.reshape(shape) - np.maximum(squares, 0.0) * halves
    if plan.similarity.mean == "arithmetic":
        return np.asarray(np.logaddexp.reduce(logs, axis=0))
    return np.asarray(logs.max(axis=0) if plan.similarity.mean == "quadratic" else logs.mean(axis=0))


def _bar(best: Best) -> float:
    """Return the score that a row needs, less the rounding of bounds."""
    bar = max(float(best.scores[0]), float(best.state[0]))
    return bar - _SLACK * (1.0 + abs(bar)) if bar > -math.inf else bar


def _log_bounds(plan: Plan, asked: tuple[ReducedFeatures, ...], stored: tuple[ReducedFeatures, ...]) -> Single:
    """Return the scores (n,) of rows."""
    points = plan.procrustes.by_points
    asked, stored = (tuple(part._replace(values=points(part.values)) for part in side) for side in (asked, stored))
    return np.asarray(log_bounds(plan.similarity, asked, stored)[0], dtype=np.float32)


def _keep(best: Best, scores: Single, rows: Rows) -> None:
    """Put scores among the best."""
    best.state[2] += len(scores)
    every, numbers = np.concatenate((best.scores, scores)), np.concatenate((best.rows, rows))
    order = np.argsort(every, kind="stable")
    least = len(scores)
    best.scores[:], best.rows[:] = every[order[least:]], numbers[order[least:]]
    best.state[1] = max(best.state[1], every[order[least - 1]])
    best.state[0] = max(best.state[0], best.scores[0])
