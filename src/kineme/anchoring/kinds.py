"""Kinds of pieces of movements that nobody named: a mixture of Gaussians, then the states of a hidden Markov model.

A piece is described linearly, so that a kind's covariance says by itself what the kind keeps. Where all its pieces
begin at one place, that direction is narrow and another place is another kind; where they begin anywhere but move
alike, the difference of end and begin is narrow instead. A way there and the way back differ in sign.

Sources: G. McLachlan, D. Peel, "Finite mixture models", 2000; G. Schwarz, "Estimating the dimension of a model", Annals
of Statistics 6, 1978; L. R. Rabiner, Proceedings of the IEEE 77, 1989.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from kineme.anchoring.grammar import Grammar, grammar_of_counts, posterior
from kineme.validation import Array

_NOISE = 0.12  # standard deviation in which features of one kind differ at least, in that of all features
_ROUNDS = 15  # of expectation and maximization of kinds and grammar together, at most
_GAIN = 1e-3  # of the log likelihood of a piece, below which rounds stop
_UNDONE, _ALWAYS = 0.4, 0.8  # of an excursion, see there
_FEWEST = 4  # pieces of a kind
_AXES = 3  # principal axes along which a kind is divided, beside the features themselves


@dataclass(frozen=True, eq=False)
class Kinds:
    """K Gaussians over features of pieces, and what follows what."""

    means: Array  # (K, f)
    roots: Array  # (K, f, f), lower Cholesky factors of the covariances
    grammar: Grammar  # of the kinds in the sequences that they were learned from

    def __len__(self) -> int:
        return len(self.means)


def describe_pieces(paths: Array) -> Array:
    """Return features (n, 3 d) of paths (n, 3, d): center of begin and end, end minus begin, middle minus center."""
    begin, middle, end = paths[:, 0], paths[:, 1], paths[:, 2]
    center = 0.5 * (begin + end)
    return np.concatenate((center, end - begin, middle - center), axis=1)


def excursions(kinds: Kinds, n_axes: int) -> list[tuple[int, int]]:
    """Return pairs of kinds (a, b) that are one movement: b always undoes what a did right before it.

    So a press is, down and up, or a glass that is tilted and put upright again. Kind b is preceded by a in 0.8 of the
    times, or more, and the sum of their mean displacements is less than 0.4 of the longer one. Where a begins or b ends
    most of their sequences, as in a way there and a way back, nothing around tells that they belong together.
    `n_axes` is the number d of columns of paths, as in `describe_pieces`, whose features come first.
    """
    counts, K = kinds.grammar.counts, len(kinds)
    preceded = counts[:-1, :-1] / np.maximum(counts[:, :-1].sum(axis=0), 1e-9)
    way = kinds.means[:, n_axes : 2 * n_axes]
    size = np.linalg.norm(way, axis=1)
    undone = np.linalg.norm(way[:, None] + way, axis=2) < _UNDONE * np.maximum(np.maximum(size[:, None], size), _NOISE)
    begins = counts[-1, :-1] / np.maximum(counts[:, :-1].sum(axis=0), 1e-9)
    ends = counts[:-1, -1] / np.maximum(counts[:-1].sum(axis=1), 1e-9)
    inner = (begins[:, None] < 0.5) | (ends < 0.5)
    pairs = np.argwhere((preceded >= _ALWAYS) & undone & inner & (size > _NOISE) & ~np.eye(K, dtype=bool))
    return [(int(a), int(b)) for a, b in pairs]


def log_densities(means: Array, roots: Array, features: Array) -> Array:
    """Return the log density (n, K) of features (n, f) under each Gaussian."""
    f = features.shape[1]
    columns = []
    for mean, root in zip(means, roots, strict=True):
        whitened = solve_triangular(root, (features - mean).T, lower=True)
        columns.append(-0.5 * (whitened**2).sum(axis=0) - np.log(np.diag(root)).sum() - 0.5 * f * np.log(2.0 * np.pi))
    return np.stack(columns, axis=1)


def learn_kinds(features: Array, lengths: Sequence[int], n_correlated: int = 0, most: int = 40) -> Kinds:
    """Learn kinds from features (n, f) of pieces, in sequences of so many pieces (`lengths`).

    A kind is divided while that lowers the Bayesian information criterion (X-means, with covariances), with the first
    `n_correlated` features correlated within a kind, or not: whichever is lower. Then kinds and grammar are learned
    together (Baum-Welch), so that what is alike and follows other things comes apart.
    """
    mixtures = []
    for correlated in {0, n_correlated}:
        related = np.eye(features.shape[1], dtype=bool)
        related[:correlated, :correlated] = True
        mixtures.append((*_divided(features, related, most), related))
    _, responsibilities, related = min(mixtures, key=lambda mixture: mixture[0])
    return _in_order_of_sequences(features, related, lengths, responsibilities)


def _divided(features: Array, related: NDArray[np.bool_], most: int) -> tuple[float, Array]:
    """Return the information criterion and the responsibilities (n, K) of a mixture, divided from one kind on."""
    score, responsibilities = _mixture(features, related, np.ones((len(features), 1)))
    final: set[int] = set()  # pieces of kinds that need not be divided, as sums of their indices
    while responsibilities.shape[1] < most:
        owner, columns = responsibilities.argmax(axis=1), []
        for k in range(responsibilities.shape[1]):
            members = np.flatnonzero(owner == k)
            key = hash(members.tobytes())
            part = None if key in final or len(members) < 2 * _FEWEST else _halved(features[members], related)
            if part is None:
                final.add(key)
                columns.append(responsibilities[:, k])
                continue
            second = np.zeros(len(features))
            second[members] = part
            columns += [responsibilities[:, k] * (1.0 - second), responsibilities[:, k] * second]
        if len(columns) == responsibilities.shape[1]:
            break
        lower, candidate = _mixture(features, related, np.stack(columns, axis=1))
        if lower >= score:
            break
        score, responsibilities = lower, candidate
    return score, responsibilities


def _halved(features: Array, related: NDArray[np.bool_]) -> Array | None:
    """Return how much each piece (m,) belongs to the second half of a kind; None where it is better in one."""
    undivided, _ = _mixture(features, related, np.ones((len(features), 1)))
    centered = features - features.mean(axis=0)
    spread = centered.std(axis=0)
    axes = np.linalg.svd(centered / np.maximum(spread, _NOISE), full_matrices=False)[2][:_AXES]
    sides = np.column_stack((centered[:, spread > _NOISE], centered @ axes.T)) > 0
    halves = [
        _mixture(features, related, np.column_stack((~side, side)).astype(np.float64), 8)
        for side in np.unique(sides, axis=1).T
        if min(side.sum(), (~side).sum()) >= _FEWEST
    ]
    if not halves:
        return None
    best, responsibilities = min(halves, key=lambda pair: pair[0])
    return responsibilities[:, 1] if best < undivided else None


def _mixture(
    features: Array, related: NDArray[np.bool_], responsibilities: Array, rounds: int = 60
) -> tuple[float, Array]:
    """Return the information criterion and the responsibilities (n, K) of a mixture (expectation-maximization)."""
    (n, f), K = features.shape, responsibilities.shape[1]
    before = -np.inf
    for _ in range(rounds):
        weights = np.maximum(responsibilities.mean(axis=0), 1e-12)
        joint = log_densities(*_gaussians(features, related, responsibilities), features) + np.log(weights)
        each = logsumexp(joint, axis=1)
        responsibilities = np.exp(joint - each[:, None])
        if each.mean() - before < _GAIN:
            break
        before = float(each.mean())
    parameters = K * (f + (related.sum() + f) / 2 + 1) - 1
    return float(-2.0 * each.sum() + parameters * np.log(n)), responsibilities


def _gaussians(features: Array, related: NDArray[np.bool_], responsibilities: Array) -> tuple[Array, Array]:
    """Return means (K, f) and Cholesky factors (K, f, f) of weighted features, which differ by some noise at least."""
    sizes = np.maximum(responsibilities.sum(axis=0), 1e-9)
    means = responsibilities.T @ features / sizes[:, None]
    floor = _NOISE**2 * np.eye(features.shape[1])
    roots = []
    for mean, weights, size in zip(means, responsibilities.T, sizes, strict=True):
        away = features - mean
        roots.append(np.linalg.cholesky(np.where(related, (away * weights[:, None]).T @ away / size, 0.0) + floor))
    return means, np.stack(roots)


def _in_order_of_sequences(
    features: Array, related: NDArray[np.bool_], lengths: Sequence[int], responsibilities: Array
) -> Kinds:
    """Learn kinds and grammar together from responsibilities (n, K) to begin with."""
    ends = np.cumsum(lengths)
    K, before = responsibilities.shape[1], -np.inf
    names = [str(k + 1) for k in range(K)]
    grammar = grammar_of_counts(names, np.ones((K + 1, K + 1)))
    for _ in range(_ROUNDS):
        means, roots = _gaussians(features, related, responsibilities)
        densities = log_densities(means, roots, features)
        parts = [posterior(grammar, densities[a:b]) for a, b in zip(ends - lengths, ends, strict=True)]
        responsibilities = np.concatenate([part.probabilities for part in parts])
        grammar = grammar_of_counts(names, np.sum([part.counts for part in parts], axis=0))
        total = sum(part.log_probability for part in parts) / max(len(features), 1)
        if total - before < _GAIN:
            break
        before = total
    return Kinds(means, roots, grammar)
