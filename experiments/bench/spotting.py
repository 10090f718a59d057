"""Known movements found in recordings: precision and recall, with rests and without, and among movements of no class.

Recordings are joined from movements whose labels are known, as `kineme evaluate --protocol spotting` does. Three
demonstrations of each class, by the same person or by others, who are given as groups. Once with white noise, as that
of cameras that see depth.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import add
from typing import Any

import numpy as np

import kineme
from bench.people import Recorded, handwriting, recorded, splits
from bench.rows import Row
from kineme_experiments.evaluation.spotting import Counts, concatenate_all, count_spotted

SHOTS = 3
UNKNOWN_PER_KNOWN = 0.25
#: How movements are joined: whether with rests, and the deviation of noise along each axis, in extents of a movement.
HOW = {"with rests": (True, 0.0), "without": (False, 0.0), "with rests, noise 3 %": (True, 0.03)}


def measure(quick: bool) -> list[Row]:
    rows = []
    for name, one, others in _sets():
        if quick and name != "digits":
            continue
        for own in (True, False) if len(np.unique(one.people)) > 1 else (True,):
            who = f"{name}, {'same person' if own else 'other people'}" if len(np.unique(one.people)) > 1 else name
            for among in (False, True) if others is not None else (False,):
                for how, (rests, noise) in HOW.items():
                    if among and noise:
                        continue
                    counts = _counts(one, others if among else None, own, rests, noise)
                    label = how + (", among unknown" if among else "")
                    details, target = {"who": who, "how": label}, None if own or label != "with rests" else (">=", 0.95)
                    rows += [
                        Row(
                            f"{who}, {label}, {figure}", "of 1", getattr(counts, figure), target=target, details=details
                        )
                        for figure in ("precision", "recall")
                    ]
    return rows


def _sets() -> Iterator[tuple[str, Recorded, Recorded | None]]:
    """Name, movements of known classes, and of others, where there are any."""
    gestures = recorded("gestures3d.npz")
    if gestures is not None:
        digits = np.char.isdigit(gestures.labels)
        yield "digits", gestures.take(digits), gestures.take(~digits)
        yield "solids", gestures.take(~digits), gestures.take(digits)
        yield "twenty kinds", gestures, None
    strokes = recorded("strokes2d.npz")
    if strokes is not None:
        yield "single strokes at three speeds", strokes, None
    letters = handwriting()
    known = np.isin(letters.labels, np.random.default_rng(0).permutation(np.unique(letters.labels))[:18])
    yield "18 shapes of LASA", letters.take(known), letters.take(~known)


def _counts(one: Recorded, others: Recorded | None, own: bool, rests: bool, noise: float) -> Counts:
    """What is found in all recordings; among movements of no known class, one for each four."""
    found = []
    deviation = noise * float(np.median([np.linalg.norm(np.ptp(movement.positions, axis=0)) for movement in one.demos]))
    for k, (person, train, test) in enumerate(splits(one, SHOTS, 1, own=own)):
        groups = None if own else one.people[train]
        recognizer = kineme.Recognizer().fit(one.demos[train], one.labels[train], groups=groups)
        asked, labels = one.demos[test], list[Any](one.labels[test])
        if others is not None:
            rng = np.random.default_rng(k)
            strange = np.flatnonzero(others.people == person)
            some = np.sort(rng.permutation(strange)[: round(UNKNOWN_PER_KNOWN * len(test))])
            asked = kineme.Demonstrations([*asked, *others.demos[some]])
            labels += [None] * len(some)
        for joined in concatenate_all(asked, labels, [k], rests=rests):
            times, x = joined.recording.times, joined.recording.positions
            x = x + deviation * np.random.default_rng(k).normal(size=x.shape)
            found.append(count_spotted(recognizer.spot(kineme.Trajectory(times, x)), joined.truth))
    return reduce(add, found)
