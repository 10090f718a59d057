"""Recognition of beginnings: right after each share of the path, and what is decided before the end.

On LASA, and on the gestures and letters of `bench.people`, where they are there; templates by the other people, or by
the same person where this is said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import kineme
from bench.people import Recorded, handwriting, recorded, splits
from bench.rows import Row
from kineme.recognition.early.evidence import cut
from kineme.recognition.early.stream import Live
from kineme_experiments.evaluation.data import load_data
from kineme_experiments.evaluation.methods import OURS
from kineme_experiments.evaluation.score_split import score_split
from kineme_experiments.evaluation.trials import Settings

FRACTIONS = (0.25, 0.5, 0.75, 0.9, 1.0)
SHOTS = (3, 8, None)
DRAWS = 3
OTHERS = ("strokes2d", "multistrokes2d", "exercises6d")
EARLIER = 100  # movements of a person in one stream, at most
SURE = 0.9  # the default confidence of a decision
RATE = 30.0  # of the streams that decide [Hz]


class Decided(NamedTuple):
    """What a stream said of one movement: the label that it decided before the end, if any, and when."""

    label: str | None
    share: float  # of the time
    sure_at_end: bool  # whether a class is as likely at the last sample as a decision asks


def measure(quick: bool) -> list[Row]:
    gestures, letters = recorded("gestures3d.npz"), recorded("letters2d.npz")
    rows, draws = _lasa(2 if quick else 10), 1 if quick else DRAWS
    decided = {"LASA": [_halved(handwriting(), 13, draw) for draw in range(draws)]}
    if letters is not None:
        everyone = letters._replace(people=np.zeros(len(letters.labels), dtype=int))  # who made which is not known
        decided["letters"] = [_halved(everyone, 17, draw) for draw in range(draws)]
    if gestures is not None:
        digits = np.char.isdigit(gestures.labels)
        for name, chosen in (("digits", digits), ("solids", ~digits)):
            rows += [row for shots in SHOTS for row in _by_share(name, gestures.take(chosen), shots, draws)]
        rows += _after_earlier(
            {"digits": gestures.take(digits), "solids": gestures.take(~digits), "twenty kinds": gestures}
            | {name: made for name in OTHERS if (made := recorded(f"{name}.npz")) is not None}
        )
        both = gestures.take(digits), gestures.take(~digits)
        decided |= {"digits by others": [both], "digits by the same person": [both]}
    for name, sets in decided.items():
        rows += _decisions(name, sets, own=name != "digits by others")
    return rows


def _lasa(n_splits: int) -> list[Row]:
    """The protocol "earliness" of `kineme evaluate lasa`."""
    data, settings = load_data("lasa"), Settings(n_splits, 0)
    by_split = [score_split(data, "earliness", OURS, k, settings) for k in range(n_splits)]
    return [
        Row(f"LASA, {one.condition.label}", "of 1", float(np.mean([found[k].values["accuracy"] for found in by_split])))
        for k, one in enumerate(by_split[0])
    ]


def _halved(one: Recorded, n_known: int, draw: int) -> tuple[Recorded, Recorded]:
    """The movements of some of the labels, drawn at random, and those of the others."""
    known = np.isin(one.labels, np.random.default_rng(draw).permutation(np.unique(one.labels))[:n_known])
    return one.take(known), one.take(~known)


def _by_share(name: str, one: Recorded, shots: int | None, draws: int) -> list[Row]:
    """Accuracy of beginnings, of wholes, and of halves where templates are halves too."""
    right: list[list[float]] = []
    halves = cut(one.demos, 0.5)
    for _, train, test in splits(one, shots, 1 if shots is None else draws):
        recognizer = kineme.Recognizer().fit(one.demos[train], one.labels[train])
        found = [recognizer.predict_partial(cut(one.demos[test], fraction)) for fraction in FRACTIONS]
        found.append(recognizer.predict(one.demos[test]))
        found.append(kineme.Recognizer().fit(halves[train], one.labels[train]).predict(halves[test]))
        right.append([float(np.mean(each == one.labels[test])) for each in found])
    shown = "all" if shots is None else str(shots)
    details = {"name": name, "shots": shown, "draws": len(right)}
    wheres = [*(f"{100 * fraction:.0f} %" for fraction in FRACTIONS), "predict", "halves"]
    return [
        Row(f"{name}, {shown} of each by others, {where}", "of 1", mean, details=details | {"where": where})
        for where, mean in zip(wheres, np.mean(right, axis=0).tolist(), strict=True)
    ]


def _after_earlier(sets: dict[str, Recorded]) -> list[Row]:
    """Halves that a stream names right before and after it has seen others of the person, three examples by others.

    A person's movements come in random order, at most 100, each as a half and then to its end. What the earlier ones
    were the stream says itself.
    """
    rows = []
    for name, one in sets.items():
        right: list[list[float]] = []
        for k, (_, train, test) in enumerate(splits(one, 3, 1)):
            recognizer = kineme.Recognizer().fit(one.demos[train], one.labels[train])
            order = np.random.default_rng(k).permutation(test)[:EARLIER]
            halves, live, said = cut(one.demos[order], 0.5), recognizer.stream(), []
            for i, half in zip(order.tolist(), halves, strict=True):
                said.append(live.update(half.times, half.positions).ranked[0].label == one.labels[i])
                live.reset()
                live.update(one.demos[i].times, one.demos[i].positions)
                live.next()
            new = recognizer.predict_partial(halves) == one.labels[order]
            right.append([float(np.mean(new)), float(np.mean(said)), float(np.mean(said[len(said) // 2 :]))])
        for where, value in zip(("alone", "after earlier", "second half"), np.mean(right, axis=0), strict=True):
            details = {"name": name, "earlier": where}
            rows.append(Row(f"{name}, 3 of each by others, halves {where}", "of 1", float(value), details=details))
    return rows


def _decisions(name: str, sets: list[tuple[Recorded, Recorded]], own: bool) -> list[Row]:
    """What streams decide of movements of known classes and of others, three demonstrations of each class."""
    said: list[Decided] = []
    truth: list[str] = []
    strange: list[Decided] = []
    for known, others in sets:
        for person, train, test in splits(known, 3, 1, own=own):
            live = kineme.Recognizer().fit(known.demos[train], known.labels[train]).stream()
            said += [_streamed(live, known.demos[int(k)]) for k in test]
            truth += known.labels[test].tolist()
            strange += [_streamed(live, others.demos[int(k)]) for k in np.flatnonzero(others.people == person)]
    details = {"name": name, "movements": len(said), "others": len(strange)}
    early = [(one, label) for one, label in zip(said, truth, strict=True) if one.label is not None]
    figures = {
        "decided": len(early) / len(said),
        "right": np.mean([one.label == label for one, label in early]),
        "after": np.median([one.share for one, _ in early]),
        "others decided": np.mean([one.label is not None for one in strange]),
        "others at the end": np.mean([one.sure_at_end for one in strange]),
    }
    return [
        Row(f"{name}, {what}", "of 1", float(value), details=details | {"figure": what})
        for what, value in figures.items()
    ]


def _streamed(live: Live, one: kineme.Trajectory) -> Decided:
    """The first label that is decided before the last sample, and what the last sample says."""
    live.reset()
    times = one.times if len(one.times) < one.duration * RATE else np.arange(one.times[0], one.times[-1], 1 / RATE)
    positions = np.column_stack([np.interp(times, one.times, x) for x in one.positions.T])
    label, share = None, np.nan
    for k, (t, x) in enumerate(zip(times, positions, strict=True)):
        state = live.update(t, x)
        if label is None and state.label is not None and k < len(times) - 1:
            label, share = str(state.label), float((t - times[0]) / one.duration)
    return Decided(label, share, state.ranked[0].confidence >= SURE)
