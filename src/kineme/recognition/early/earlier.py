"""What movements that a person finished tell about the next one: examples of one's own, one's tempo, one's size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.early.hypotheses import Hypotheses, Prefixes, hypotheses
from kineme.recognition.spotting import shrunk_median
from kineme.similarity.comparison import References
from kineme.similarity.describe import Described
from kineme.validation import Array

MOST_OF_EACH = 3  # movements of a class that are kept, the last ones
#: Spread of log sizes and log durations of one person, as a share of that over people, before it is measured, and how
#: many movements that counts for.
OWN_SPREAD, OWN_PRIOR = 0.6, 3.0


class Earlier(NamedTuple):
    """One finished movement of the person: its class, its beginnings, and its log size and log duration.

    The last two are differences from the median of the class's demonstrations.
    """

    label: int
    begun: Hypotheses
    size: float
    tempo: float


def earlier(stored: Hypotheses, movement: Demonstrations, label: int) -> Earlier:
    """Describe one finished movement of a class, as the stored ones are."""
    described = stored.comparison.describe(movement)
    begun = hypotheses(stored.comparison, References.of(movement, described, np.array([label])), stored.early)
    G, ends = len(stored.progress), np.append(stored.first, len(stored.durations))
    own = slice(int(ends[label]), int(ends[label + 1]))
    size, tempo = (
        float(mine[-1] - np.median(theirs[G - 1 :: G][own]))
        for mine, theirs in ((begun.log_lengths, stored.log_lengths), (begun.log_durations, stored.log_durations))
    )
    return Earlier(label, begun, size, tempo)


def remembered(before: Sequence[Earlier], now: Earlier) -> list[Earlier]:
    """Return earlier movements in order of time, the last three of each class."""
    same = [k for k, movement in enumerate(before) if movement.label == now.label]
    too_old = same[: len(same) + 1 - MOST_OF_EACH]
    return [movement for k, movement in enumerate(before) if k not in too_old] + [now]


def with_earlier(stored: Hypotheses, before: Sequence[Earlier]) -> Hypotheses:
    """Return the stored movements, in the size and tempo of the person, and beside them the person's earlier ones.

    Of log sizes, and of log durations, the person's mean is normal around 0 with variance ``(1 - w^2) s^2``, where s is
    the spread in `Early` and w is 0.6; a movement is normal around that mean, with a variance v that begins at
    ``w^2 s^2`` as if from three movements. After n movements whose differences have the median m,
    ``v = (3 w^2 s^2 + sum (r_i - m)^2) / (n + 2)``, the stored movements are shifted by ``m n / (n + k)`` with
    ``k = v / ((1 - w^2) s^2)``, and the spread of the next difference is ``sqrt(v (1 + 1 / (n + k)))``: somebody who
    changes pace is not held to one. Widths and speeds at the end stay those of the demonstrations.
    """
    if not before:
        return stored
    G = len(stored.progress)
    counts = np.diff(stored.first, append=len(stored.durations))
    labels = np.append(np.repeat(np.arange(len(counts)), counts), [movement.label for movement in before])
    order = np.argsort(labels, kind="stable")
    rows = (order[:, None] * G + np.arange(G)).ravel()
    size, size_spread = _manner([movement.size for movement in before], stored.early.size_spread)
    tempo, tempo_spread = _manner([movement.tempo for movement in before], stored.early.duration_spread)
    shifted = stored._replace(log_lengths=stored.log_lengths + size, log_durations=stored.log_durations + tempo)
    parts = [shifted, *(movement.begun for movement in before)]

    def joined(name: str, chosen: NDArray[np.intp]) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])[chosen]

    return stored._replace(
        early=replace(stored.early, size_spread=size_spread, duration_spread=tempo_spread),
        wholes=_joined([part.wholes for part in parts], order),
        paths=joined("paths", order),
        durations=joined("durations", order),
        prefixes=Prefixes(*(np.concatenate(same)[rows] for same in zip(*(p.prefixes for p in parts), strict=True))),
        described=_joined([part.described for part in parts], rows),
        log_lengths=joined("log_lengths", rows),
        log_durations=joined("log_durations", rows),
        timing_squares=joined("timing_squares", rows),
        first=np.searchsorted(labels[order], np.arange(len(counts))),
    )


def _manner(ratios: Sequence[float], spread: float) -> tuple[float, float]:
    """Return how far the person's movements are shifted, and the spread of the next one's size or tempo."""
    if math.isinf(spread):
        return 0.0, spread
    differences, n = np.array(ratios), len(ratios)
    squares = float(((differences - np.median(differences)) ** 2).sum())
    variance = (OWN_PRIOR * (OWN_SPREAD * spread) ** 2 + squares) / (OWN_PRIOR + n - 1.0)
    prior = variance / ((1.0 - OWN_SPREAD**2) * spread**2)
    return shrunk_median(differences, prior), math.sqrt(variance * (1.0 + 1.0 / (n + prior)))


def _joined(parts: Sequence[Described], order: NDArray[np.intp]) -> Described:
    """Return movements described in the same way as one, in an order."""
    room, start = parts[0].empty(sum(map(len, parts))), 0
    for part in parts:
        room.put(start, part)
        start += len(part)
    return room.take(order)
