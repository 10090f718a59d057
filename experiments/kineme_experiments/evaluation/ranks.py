"""Whether methods differ over data sets: Friedman's test and Nemenyi's critical difference (Demsar, JMLR 2006)."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from kineme.validation import Array
from kineme_experiments.evaluation.rows import Row

LEVEL = 0.05  # of the test and of the critical difference
MIN_METHODS, MIN_BLOCKS = 3, 5
_SHARE = 0.5  # of the blocks that the busiest method went through: with fewer, a method would cost too many blocks

Block = tuple[str, str, str]  # data set, protocol, person


class Ranks(NamedTuple):
    """Mean ranks of methods over blocks, the best first.

    Attributes
    ----------
    methods : tuple of k str
    mean_ranks : tuple of k float
        1 is best; equal values share the mean of their ranks.
    n_blocks : int
    statistic, p_value : float
        Of Friedman's test that all methods are equally good.
    critical_difference : float
        Difference of two mean ranks from which on two methods differ at `LEVEL`, by Nemenyi's test.
    """

    methods: tuple[str, ...]
    mean_ranks: tuple[float, ...]
    n_blocks: int
    statistic: float
    p_value: float
    critical_difference: float

    def alike(self) -> list[tuple[int, int]]:
        """First and last of every longest run of methods that do not differ, two at least."""
        k, ranks = len(self.methods), self.mean_ranks
        ends = [max(j for j in range(i, k) if ranks[j] - ranks[i] < self.critical_difference) for i in range(k)]
        return [(i, end) for i, end in enumerate(ends) if end > i and (i == 0 or ends[i - 1] < end)]

    def numbers(self) -> dict[str, Any]:
        """As plain data, in six digits."""
        values = self._asdict()
        return {name: _short(value) for name, value in values.items()}


def _short(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_short(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def blocks_of(rows: Sequence[Row]) -> tuple[list[Block], list[str], Array]:
    """Mean accuracy by block and method, shape (b, k), over the conditions that all these methods went through.

    A block is one person's part in one protocol on one data set, or everybody's where people are not known. Methods
    that take part in reference trials only, or in some blocks only, are left out.
    """
    values: dict[tuple[Block, str], dict[tuple[str, int], float]] = {}
    for row in rows:
        if row.measure == "accuracy":
            own = values.setdefault(((row.data, row.protocol, row.person), row.method), {})
            own[row.condition, row.split] = row.value
    methods = list(dict.fromkeys(method for _, method in values))
    blocks = list(dict.fromkeys(block for block, _ in values))
    most = {block: max(len(values.get((block, method), ())) for method in methods) for block in blocks}
    entered = {m: {block for block in blocks if len(values.get((block, m), ())) == most[block]} for m in methods}
    largest = max((len(one) for one in entered.values()), default=0)
    methods = [method for method in methods if largest and len(entered[method]) >= _SHARE * largest]
    blocks = [block for block in blocks if all(block in entered[method] for method in methods)]
    means = [[fmean(values[block, method].values()) for method in methods] for block in blocks]
    return blocks, methods, np.array(means).reshape(len(blocks), len(methods))


def rank(methods: Sequence[str], values: Array) -> Ranks:
    """Rank methods over blocks.

    Parameters
    ----------
    methods : sequence of k str
        At least `MIN_METHODS`.
    values : ndarray of shape (b, k)
        Larger is better; at least two blocks.
    """
    n, k = values.shape
    mean_ranks = stats.rankdata(-values, axis=1).mean(axis=0)
    tied = bool((values == values[:, :1]).all())  # the statistic would be 0 / 0
    test = (0.0, 1.0) if tied else stats.friedmanchisquare(*values.T)
    order = np.argsort(mean_ranks, kind="stable")
    spread = float(stats.studentized_range.ppf(1.0 - LEVEL, k, np.inf)) / np.sqrt(2.0)
    difference = spread * float(np.sqrt(k * (k + 1) / (6.0 * n)))
    named = tuple(methods[i] for i in order)
    return Ranks(named, tuple(mean_ranks[order].tolist()), n, float(test[0]), float(test[1]), difference)


def rank_rows(rows: Sequence[Row]) -> Ranks | str:
    """The ranks of all methods, or why there are none."""
    blocks, methods, values = blocks_of(rows)
    if len(methods) < MIN_METHODS:
        return f"Ranks need at least {MIN_METHODS} methods that went through the same trials, these are {len(methods)}."
    if len(blocks) < MIN_BLOCKS:
        return (
            f"Ranks need at least {MIN_BLOCKS} data sets, protocols or people, these are {len(blocks)}; name more "
            "data, or data that say who made each movement."
        )
    return rank(methods, values)


def rank_sentence(ranks: Ranks) -> str:
    """What ranks say, for a person."""
    p = f"p = {ranks.p_value:.2g}" if ranks.p_value >= 1e-4 else "p < 0.0001"
    gap = f"critical difference {ranks.critical_difference:.2f} (Nemenyi, {LEVEL:g})"
    return (
        f"Mean ranks of the accuracy over {ranks.n_blocks} blocks of data set, protocol and person: Friedman {p}, "
        f"{gap}. Blocks of one data set share movements, so that the test is less strict than over as many data sets."
    )
