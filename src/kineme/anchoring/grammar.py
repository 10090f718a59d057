"""A grammar of symbols: what follows what, and sequences of pieces labeled by it and by how alike they are.

An episode may hold each kind of movement once. Pieces of it then tell little about the kinds; pieces of all episodes,
and their order, do. A bigram with a begin and an end is the least that knows an order, and is learned from few episodes.

Sources: L. R. Rabiner, "A tutorial on hidden Markov models and selected applications in speech recognition",
Proceedings of the IEEE 77, 1989 (Viterbi, forward-backward); S.-Z. Yu, "Hidden semi-Markov models", Artificial
Intelligence 174, 2010 (states that last, here over a lattice of possible boundaries); D. J. C. MacKay, L. C. Bauman
Peto, "A hierarchical Dirichlet language model", Natural Language Engineering 1, 1995 (smoothing).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

_RARE = 0.05  # probability from which on the text of a grammar says that a symbol follows


@dataclass(frozen=True, eq=False)
class Grammar:
    """Probabilities of what follows what in sequences of symbols.

    Attributes
    ----------
    symbols : tuple of str
        K symbols.
    initial : ndarray of shape (K,)
        Probability that a sequence begins with each.
    transitions : ndarray of shape (K, K + 1)
        Probability that each is followed by each; the last column is the end of the sequence. Rows sum to 1.
    counts : ndarray of shape (K + 1, K + 1)
        How often each was followed by each; the last row is the begin, the last column the end.
    """

    symbols: tuple[str, ...]
    initial: Array
    transitions: Array
    counts: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.symbols)

    def __repr__(self) -> str:
        return f"Grammar({len(self)} symbols, {int(self.counts[-1].sum())} sequences)"

    def __str__(self) -> str:
        rows = [("begin", self.initial), *zip(self.symbols, self.transitions, strict=True)]
        return "\n".join(f"{name} -> {_likely(self.symbols, shares)}" for name, shares in rows)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data: the symbols, probabilities, and counts."""
        return {
            "symbols": list(self.symbols),
            "initial": self.initial.tolist(),
            "transitions": self.transitions.tolist(),
            "counts": self.counts.tolist(),
        }


class Parse(NamedTuple):
    """The most probable path through a lattice."""

    edges: NDArray[np.intp]  # (p,) of the edges, in order
    labels: NDArray[np.intp]  # (p,) the symbol of each
    probability: Array  # (p,) of that symbol on that edge, among all paths
    log_probability: float  # of the path and what was observed together


def estimate_grammar(
    sequences: Sequence[Sequence[str]], prior: float = 0.5, symbols: Sequence[str] | None = None
) -> Grammar:
    """Estimate a grammar from sequences of symbols, such as the annotations of episodes.

    A transition that was counted n times among N from a symbol has the probability ``(n + prior m) / (N + prior)``: the
    mean of its posterior under a Dirichlet prior around m, which is even over the K symbols and the end. So nothing is
    impossible, and what is rare is no more likely than it was.

    Parameters
    ----------
    sequences : sequence of sequences of str
    prior : float, default 0.5
        Weight of the prior, in observations; above 0.
    symbols : sequence of str, optional
        The symbols; by default those of the sequences, ordered by where in a sequence they are on average.

    Raises
    ------
    SpecificationError
        No symbols, a prior that is not above 0, or sequences with other symbols than those given.
    """
    check_number("prior", prior, above=0.0)
    names = tuple(in_order(sequences) if symbols is None else symbols)
    if not names:
        raise SpecificationError("expected sequences with symbols, got none; say symbols, or annotate movements first")
    number = {name: k for k, name in enumerate(names)}
    if strange := {name for sequence in sequences for name in sequence} - number.keys():
        raise SpecificationError(f"expected sequences of the symbols {list(names)}, got {min(strange)!r}")
    end = len(names)
    counts = np.zeros((end + 1, end + 1), dtype=np.intp)
    for sequence in filter(len, sequences):
        path = np.array([end, *(number[name] for name in sequence), end])
        np.add.at(counts, (path[:-1], path[1:]), 1)
    return _of_counts(names, counts, prior)


def in_order(sequences: Sequence[Sequence[str]]) -> list[str]:
    """Return the symbols of sequences by their mean place, from 0 at the begin to 1 at the end; then by name."""
    places: dict[str, list[float]] = {}
    for sequence in sequences:
        for i, name in enumerate(sequence):
            places.setdefault(name, []).append((i + 0.5) / len(sequence))
    return sorted(places, key=lambda name: (round(float(np.mean(places[name])), 6), name))


def parse(grammar: Grammar, edges: ArrayLike, log_likelihoods: Array) -> Parse:
    """Label the most probable path through a lattice of pieces, by Viterbi, with probabilities by forward-backward.

    The probability of a path is ``initial(s1) L(e1, s1) transitions(s1, s2) L(e2, s2) ... transitions(sp, end)``.

    Parameters
    ----------
    grammar : Grammar
    edges : array_like of shape (E, 2)
        From which point to which later one each piece leads; paths lead from the first point, 0, to the last. One piece
        after the other, ``[[0, 1], [1, 2], ...]``, relabels pieces whose boundaries stay: see `chain`.
    log_likelihoods : ndarray of shape (E, K)
        ``log L(e, s)``: of what is observed during each piece, if it shows each symbol.

    Raises
    ------
    SpecificationError
        Arrays of other shapes, edges that lead back, or no path from the first point to the last.
    """
    lattice = np.asarray(edges, dtype=np.intp).reshape(-1, 2)
    if log_likelihoods.shape != (len(lattice), len(grammar)) or not len(lattice):
        raise SpecificationError(
            f"expected log likelihoods of shape {(len(lattice), len(grammar))}, a row for each edge and a column for "
            f"each symbol, got {np.shape(log_likelihoods)}"
        )
    if (lattice[:, 0] >= lattice[:, 1]).any() or lattice.min() < 0:
        raise SpecificationError("expected edges from a point to a later one, counted from 0, got one that leads back")
    with np.errstate(divide="ignore"):
        initial, follow = np.log(grammar.initial), np.log(grammar.transitions)
    best, before = _forward(lattice, log_likelihoods, initial, follow, viterbi=True)
    last = int(lattice[:, 1].max())
    total = best[last] + follow[:, -1]
    if not np.isfinite(total).any():
        raise SpecificationError("expected edges that lead from the first point to the last, got none that do")
    path, point, symbol = [], last, int(total.argmax())
    log_probability = float(total.max())
    while point > 0:
        edge, previous = before[point, symbol].tolist()
        path.append((edge, symbol))
        point, symbol = int(lattice[edge, 0]), previous
    edge_of, labels = np.array(path[::-1], dtype=np.intp).T
    return Parse(
        edge_of, labels, _posteriors(lattice, log_likelihoods, initial, follow)[edge_of, labels], log_probability
    )


def chain(n: int) -> NDArray[np.intp]:
    """Return the edges (n, 2) of n pieces, one after the other."""
    return np.column_stack((np.arange(n), np.arange(1, n + 1)))


def _of_counts(names: tuple[str, ...], counts: NDArray[np.intp], prior: float) -> Grammar:
    even = np.full(len(names) + 1, 1.0 / (len(names) + 1))
    initial = counts[-1, :-1] + prior / len(names)
    transitions = counts[:-1] + prior * even
    return Grammar(
        names, initial / initial.sum(), transitions / transitions.sum(axis=1, keepdims=True), counts
    )


def _likely(symbols: Sequence[str], shares: Array) -> str:
    order = np.argsort(-shares, kind="stable")
    names = [*symbols, "end"]
    return ", ".join(f"{names[k]} {shares[k]:.2f}" for k in order if shares[k] >= _RARE) or "anything"


def _forward(
    edges: NDArray[np.intp], log_likelihoods: Array, initial: Array, follow: Array, viterbi: bool
) -> tuple[Array, NDArray[np.intp]]:
    """Return the log maximum or sum (points, K) over paths to each point whose last piece shows each symbol.

    Of the maximum also the edge and the symbol before that it comes from, (points, K, 2).
    """
    n, K = int(edges[:, 1].max()) + 1, len(initial)
    arrived = np.full((n, K), -np.inf)
    before = np.full((n, K, 2), -1, dtype=np.intp)
    order = np.argsort(edges[:, 1], kind="stable")
    starts = np.searchsorted(edges[order, 1], np.arange(n + 1))
    for point in range(1, n):
        own = order[starts[point] : starts[point + 1]]
        if not len(own):
            continue
        sources = edges[own, 0]
        ways = arrived[sources][:, :, None] + follow[:, :-1]  # (edges, symbol before, symbol)
        entered = ways.max(axis=1) if viterbi else logsumexp(ways, axis=1)
        entered[sources == 0] = initial
        reached = entered + log_likelihoods[own]
        if viterbi:
            which = reached.argmax(axis=0)
            arrived[point] = reached[which, np.arange(K)]
            before[point, :, 0] = own[which]
            before[point, :, 1] = ways.argmax(axis=1)[which, np.arange(K)]
        else:
            arrived[point] = logsumexp(reached, axis=0)
    return arrived, before


def _posteriors(edges: NDArray[np.intp], log_likelihoods: Array, initial: Array, follow: Array) -> Array:
    """Return the probability (E, K) that the sequence has each edge with each symbol (forward-backward)."""
    ahead, _ = _forward(edges, log_likelihoods, initial, follow, viterbi=False)
    n, K = ahead.shape
    left = np.full((n, K), -np.inf)  # of all that follows a point, by the symbol before it
    left[-1] = follow[:, -1]
    order = np.argsort(edges[:, 0], kind="stable")
    starts = np.searchsorted(edges[order, 0], np.arange(n + 1))
    for point in range(n - 2, 0, -1):
        own = order[starts[point] : starts[point + 1]]
        if len(own):
            ways = (log_likelihoods[own] + left[edges[own, 1]])[:, None] + follow[None, :, :-1]
            left[point] = logsumexp(ways, axis=(0, 2))
    with np.errstate(invalid="ignore"):
        entered = logsumexp(ahead[edges[:, 0]][:, :, None] + follow[:, :-1], axis=1)
    entered[edges[:, 0] == 0] = initial
    joint = entered + log_likelihoods + left[edges[:, 1]]
    return np.asarray(np.exp(joint - logsumexp(ahead[-1] + follow[:, -1])))
