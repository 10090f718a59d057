"""What joined and blended movements keep of their parts: labels, names, channels, and when discrete channels step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete_steps import DiscreteSteps
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.dmp.recorded_as import RecordedAs, merged
from kineme.validation import Array


def carried_over(
    made: Primitives, parts: Sequence[Primitives | PosePrimitives], when: Sequence[Array], switches: Array
) -> Primitives:
    """The movements with the labels and names that all their parts have in common, and with their channels.

    Parameters
    ----------
    made : Primitives
        n movements.
    parts : sequence of Primitives or PosePrimitives
        The p parts, each of n movements.
    when : sequence of ndarray of shape (n, 2 or more)
        Of each part, at even shares of its duration: when that is, as a share of the duration of the whole.
    switches : ndarray of shape (p - 1, n)
        From when on discrete channels are those of the next part.
    """
    labels, names = [one.labels for one in parts], [one.names for one in parts]
    first = labels[0]
    same = first is not None and all(one is not None and np.array_equal(one, first) for one in labels)
    about = merged([one.recorded_as for one in parts])
    steps = [one.recorded_as.steps for one in parts if one.recorded_as is not None]
    known = [one for one in steps if one is not None]
    if about is not None:
        whole = len(known) == len(parts)
        about = RecordedAs(about.channels, _one_after_another(known, when, switches) if whole else None)
    return replace(
        made,
        labels=first if same else None,
        names=names[0] if all(one == names[0] for one in names) else None,
        recorded_as=about,
    )


def _one_after_another(parts: Sequence[DiscreteSteps], when: Sequence[Array], switches: Array) -> DiscreteSteps:
    """The steps of all parts at their new times, each part from one switch to the next."""
    n = len(when[0])
    begins = np.vstack((np.zeros((1, n)), switches))
    ends = np.vstack((switches, np.full((1, n), np.inf)))
    values, shares, lengths = [], [], []
    for i in range(n):
        rows = [
            _within(one, i, at[i], (begins[k, i], ends[k, i]))
            for k, (one, at) in enumerate(zip(parts, when, strict=True))
        ]
        value, share = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
        kept = np.append(True, (value[1:] != value[:-1]).any(axis=1))
        values.append(value[kept])
        shares.append(share[kept])
        lengths.append(int(kept.sum()))
    return DiscreteSteps(np.concatenate(values), np.concatenate(shares), np.concatenate(([0], np.cumsum(lengths))))


def _within(part: DiscreteSteps, i: int, when: Array, stretch: tuple[float, float]) -> tuple[Array, Array]:
    """Values (m, c) and times (m,) of movement i: what is in force where the stretch begins, and all steps in it."""
    rows = slice(part.offsets[i], part.offsets[i + 1])
    times = np.interp(part.shares[rows], np.linspace(0.0, 1.0, len(when)), when)
    begin, end = stretch
    first = max(0, int(np.searchsorted(times, begin, side="right")) - 1)
    last = max(first + 1, int(np.searchsorted(times, end, side="left")))
    return part.values[rows][first:last], np.append(begin, times[first + 1 : last])
