"""A grammar of symbols, what follows what with which probability, and sequences that are labeled by it.

An episode may hold each kind of movement once. Its pieces then tell little about the kinds; those of all episodes, and
their order, do. A bigram with a begin and an end is the least that knows an order, and few episodes suffice for it.

Sources: L. R. Rabiner, "A tutorial on hidden Markov models and selected applications in speech recognition",
Proceedings of the IEEE 77, 1989 (Viterbi, forward-backward); D. J. C. MacKay, L. C. Bauman Peto, "A hierarchical
Dirichlet language model", Natural Language Engineering 1, 1995 (smoothing).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

_RARE = 0.05  # probability from which on the text of a grammar says that a symbol follows


@dataclass(frozen=True, eq=False)
class Grammar:
    """Probabilities of what follows what in sequences of symbols.

    - `symbols`: K symbols.
    - `initial` (K,): probability that a sequence begins with each.
    - `transitions` (K, K + 1): probability that each is followed by each; the last column is the end of the sequence.
      Rows sum to 1.
    - `counts` (K + 1, K + 1): how often each was followed by each; the last row is the begin, the last column the end.
      Expected counts are no whole numbers.
    """

    symbols: tuple[str, ...]
    initial: Array
    transitions: Array
    counts: Array

    def __len__(self) -> int:
        return len(self.symbols)

    def __repr__(self) -> str:
        return f"Grammar({len(self)} symbols, {self.counts[-1].sum():.0f} sequences)"

    def __str__(self) -> str:
        rows = [("begin", self.initial), *zip(self.symbols, self.transitions, strict=True)]
        names = [*self.symbols, "end"]
        lines = []
        for name, shares in rows:
            likely = [k for k in np.argsort(-shares, kind="stable").tolist() if shares[k] >= _RARE]
            lines.append(f"{name} -> " + (", ".join(f"{names[k]} {shares[k]:.2f}" for k in likely) or "anything"))
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data: the symbols, probabilities, and counts."""
        return {name: np.asarray(value).tolist() for name, value in vars(self).items()}


class Posterior(NamedTuple):
    """Symbols of a sequence of n pieces as far as they are known (forward-backward)."""

    probabilities: Array  # (n, K) of each symbol at each piece
    counts: Array  # (K + 1, K + 1) expected transitions, as `Grammar.counts`
    log_probability: float  # of what was observed


def estimate_grammar(
    sequences: Sequence[Sequence[str]], symbols: Sequence[str] | None = None, prior: float = 0.5
) -> Grammar:
    """Estimate a grammar from sequences of symbols, such as the annotations of episodes.

    Parameters
    ----------
    sequences : sequence of sequences of str
    symbols : sequence of str, optional
        The symbols; by default those of the sequences, ordered by where in a sequence they are on average.
    prior : float, default 0.5
        As of `grammar_of_counts`.

    Raises
    ------
    SpecificationError
        No symbols, a prior that is not above 0, or sequences with other symbols than those given.
    """
    names = tuple(in_order(sequences) if symbols is None else symbols)
    number = {name: k for k, name in enumerate(names)}
    if strange := {name for sequence in sequences for name in sequence} - number.keys():
        raise SpecificationError(f"expected sequences of the symbols {list(names)}, got {min(strange)!r}")
    end = len(names)
    counts = np.zeros((end + 1, end + 1))
    for sequence in filter(len, sequences):
        path = np.array([end, *(number[name] for name in sequence), end])
        np.add.at(counts, (path[:-1], path[1:]), 1.0)
    return grammar_of_counts(names, counts, prior)


def grammar_of_counts(symbols: Sequence[str], counts: Array, prior: float = 0.5) -> Grammar:
    """Return the grammar of symbols that followed each other so often, counts (K + 1, K + 1).

    A transition that was counted n times among N from a symbol has the probability ``(n + prior m) / (N + prior)``: the
    mean of its posterior under a Dirichlet prior around m, which is even over the K symbols and the end. So nothing is
    impossible. Raises `SpecificationError`: no symbols, or a prior that is not above 0.
    """
    check_number("prior", prior, above=0.0)
    if not len(symbols):
        raise SpecificationError("expected sequences with symbols, got none; say symbols, or annotate movements first")
    K = len(symbols)
    initial, follow = counts[-1, :-1] + prior / K, counts[:-1] + prior / (K + 1)
    return Grammar(tuple(symbols), initial / initial.sum(), follow / follow.sum(axis=1, keepdims=True), counts)


def in_order(sequences: Sequence[Sequence[str]]) -> list[str]:
    """Return the symbols of sequences by their mean place, from 0 at the begin to 1 at the end; then by name."""
    places: dict[str, list[float]] = {}
    for sequence in sequences:
        for i, name in enumerate(sequence):
            places.setdefault(name, []).append((i + 0.5) / len(sequence))
    return sorted(places, key=lambda name: (round(float(np.mean(places[name])), 6), name))


def most_probable(grammar: Grammar, log_likelihoods: Array) -> NDArray[np.intp]:
    """Return the most probable symbols (n,) of a sequence of n pieces (Viterbi).

    They maximize ``initial(s1) L(1, s1) transitions(s1, s2) L(2, s2) ... transitions(sn, end)``. `log_likelihoods`
    (n, K) are log L: of what is observed during each piece if it shows each symbol.
    """
    initial, follow = _logs(grammar, log_likelihoods)
    n = len(log_likelihoods)
    before = np.zeros(log_likelihoods.shape, dtype=np.intp)
    best = initial
    for i, likelihoods in enumerate(log_likelihoods):
        if i:
            ways = best[:, None] + follow[:, :-1]
            before[i], best = ways.argmax(axis=0), ways.max(axis=0)
        best = best + likelihoods
    labels = np.zeros(n, dtype=np.intp)
    if n:
        labels[-1] = (best + follow[:, -1]).argmax()
    for i in range(n - 1, 0, -1):
        labels[i - 1] = before[i, labels[i]]
    return labels


def posterior(grammar: Grammar, log_likelihoods: Array) -> Posterior:
    """Return the probabilities of the symbols of a sequence, and the counts of transitions for Baum-Welch."""
    initial, follow = _logs(grammar, log_likelihoods)
    n, K = log_likelihoods.shape
    counts = np.zeros((K + 1, K + 1))
    if not n:
        return Posterior(np.zeros((0, K)), counts, 0.0)
    ahead, behind = np.empty((n, K)), np.empty((n, K))
    ahead[0], behind[-1] = initial + log_likelihoods[0], follow[:, -1]
    for i in range(1, n):
        ahead[i] = logsumexp(ahead[i - 1][:, None] + follow[:, :-1], axis=0) + log_likelihoods[i]
    for i in range(n - 2, -1, -1):
        behind[i] = logsumexp(follow[:, :-1] + (log_likelihoods[i + 1] + behind[i + 1]), axis=1)
    total = float(logsumexp(ahead[-1] + follow[:, -1]))
    probabilities = np.exp(ahead + behind - total)
    pairs = ahead[:-1, :, None] + follow[:, :-1] + (log_likelihoods[1:] + behind[1:])[:, None] - total
    counts[:-1, :-1] = np.exp(pairs).sum(axis=0)
    counts[-1, :-1], counts[:-1, -1] = probabilities[0], probabilities[-1]
    return Posterior(probabilities, counts, total)


def _logs(grammar: Grammar, log_likelihoods: Array) -> tuple[Array, Array]:
    """Return the logarithms of the probabilities of a grammar, and refuse likelihoods of other symbols."""
    if log_likelihoods.ndim != 2 or log_likelihoods.shape[1] != len(grammar):
        raise SpecificationError(
            f"expected log likelihoods of shape (n, {len(grammar)}), a column for each symbol, got "
            f"{log_likelihoods.shape}"
        )
    return np.log(grammar.initial), np.log(grammar.transitions)
