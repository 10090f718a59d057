"""Rhythmic DMPs on real recordings: period and path of walking and running; activities told apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.neighbors import KNeighborsClassifier

from bench.rhythm_data import load_basic_motions, load_clip, period_of, repeated
from bench.rows import Row
from kineme import Demonstrations, DMPFeatures, RhythmicDMP, RhythmicFeatures
from kineme.errors import DataError

SEED = 7
SPEC = RhythmicDMP()


def measure(quick: bool) -> list[Row]:
    """Rows of every data set that is installed; what is missing is said, not counted."""
    rows = []
    for part in (lambda: _gait("walk"), lambda: _gait("run"), _activities):
        try:
            rows += part()
        except DataError as error:
            print(f"skipped: {error}")
    return rows


def _gait(name: str) -> list[Row]:
    """The clips hold one cycle each; for the search of the period they are wrapped around."""
    clip = load_clip(name)
    period = period_of(clip)
    given = replace(SPEC, period=period).learn(clip)
    path = given.rollout(clip.duration / period, phase=given.phases, n_samples=len(clip)).positions[0]
    extent = float(np.ptp(clip.positions, axis=0).max())
    rms = float(np.sqrt(np.mean((path - clip.positions) ** 2)))
    worst = float(np.abs(path - clip.positions).max())
    details = {"dmp": repr(SPEC), "period_s": period, "samples": len(clip), "dims": clip.n_dims, "seed": SEED}
    rows = [
        Row(f"{name}: one cycle again, rms error", "% of extent", 100 * rms / extent, details=details),
        Row(f"{name}: one cycle again, largest error", "% of extent", 100 * worst / extent),
    ]
    for cycles, noise in ((1.6, 0.0), (1.6, 0.01), (4.3, 0.01)):
        found = SPEC.learn(repeated(clip, cycles, noise, SEED)).periods[0]
        what = f"{name}: period from {cycles} wrapped cycles, {noise:.0%} noise, relative error"
        rows.append(Row(what, "", abs(float(found) / period - 1)))
    return rows


def _activities() -> list[Row]:
    train, test = load_basic_motions("TRAIN"), load_basic_motions("TEST")
    rows = []
    for activity in ("Walking", "Running"):
        chosen = train[train.labels == activity]
        learned = replace(SPEC, aperiodic="accept").learn(chosen)
        details = {"periods_s": learned.periods.tolist(), "explained": learned.explained.tolist()}
        what = f"BasicMotions {activity}: variance that one repeated cycle explains, median of {len(chosen)}"
        rows.append(Row(what, "", float(np.median(learned.explained)), details=details))
    euclidean = _accuracy(lambda demos: demos.positions.reshape(len(demos), -1), train, test)
    transformers: dict[str, Any] = {"discrete DMPFeatures": DMPFeatures()}
    for feature in ("shape-attractor", "forcing", "weights"):
        transformers[f"RhythmicFeatures {feature}"] = RhythmicFeatures(feature, RhythmicDMP(aperiodic="accept"))
    for name, transformer in transformers.items():
        ours = _accuracy(transformer.fit(train).transform, train, test)
        what = f"BasicMotions, 1-NN, 40 test: {name}"
        rows.append(Row(what, "accuracy", ours, euclidean, "1-NN on the samples", ours / euclidean))
    return rows


def _accuracy(features: Callable[[Demonstrations], Any], train: Demonstrations, test: Demonstrations) -> float:
    nearest = KNeighborsClassifier(1).fit(features(train), train.labels)
    return float(nearest.score(features(test), test.labels))
