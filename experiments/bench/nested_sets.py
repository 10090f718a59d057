"""The sets of the nested validation: movements of people in space and in the plane, and of six sensors.

LASA comes with a dependency. gestures3d.npz and letters2d.npz are no part of the project, see `bench.people`.
BasicMotions (walking, resting, running, badminton; accelerations and rates of a watch on the wrist of four people) lies
inside the wheel of aeon, which is read without being imported; nothing is chosen on it, since its curves are no paths.
What is not there is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.by_person import FOLDER
from bench.people import recorded
from kineme_experiments.evaluation.conditions import TOGETHER

SHOTS = (1, 3)
COPIES, DRAWS, DRAWS_BY_PERSON = 4, 4, 4
SEED = 0

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Movements:
    """One set: `copies` of the same labeled movements, each perturbed otherwise; by `people`, where that is known.

    Only sets of `paths` choose values; the others are reported on.
    """

    name: str
    copies: tuple[kineme.Demonstrations, ...]
    labels: NDArray[Any]
    people: NDArray[Any] | None = None
    paths: bool = True

    def splits(self, without: Any = None) -> Iterator[tuple[int, Any, Indices, Indices]]:
        """(copy, person tested, train, test); templates by the other people only, and nothing of the person `without`.

        Where people are not known, templates are drawn at random, and the person is None.
        """
        there = np.ones(len(self.labels), bool) if self.people is None else self.people != without
        tested = [None] if self.people is None else list(np.unique(self.people[there]))
        for copy in range(len(self.copies)):
            for k, person in enumerate(tested):
                for shots in SHOTS:
                    for draw in range(DRAWS if self.people is None else DRAWS_BY_PERSON):
                        rng = np.random.default_rng([SEED, copy, k, shots, draw])
                        own = np.zeros(len(there), bool) if person is None else self.people == person
                        train = _drawn(rng, self.labels, there & ~own, shots)
                        test = there.copy() if person is None else own
                        test[train] = False
                        yield copy, person, train, np.flatnonzero(test)


def _drawn(rng: np.random.Generator, labels: NDArray[Any], pool: NDArray[np.bool_], shots: int) -> Indices:
    each = [rng.permutation(np.flatnonzero(pool & (labels == one)))[:shots] for one in np.unique(labels)]
    return np.sort(np.concatenate(each))


def movement_sets(quick: bool) -> list[Movements]:
    """Those that are there."""
    lasa = kineme.load_lasa()
    found = [_perturbed("LASA, all strongly", lasa, 1 if quick else COPIES)]
    letters, gestures = recorded("letters2d.npz"), recorded("gestures3d.npz")
    if letters is not None:
        unlabeled = kineme.Demonstrations.from_arrays([demo.positions for demo in letters.demos], letters.labels)
        found.append(_perturbed("letters, all strongly", unlabeled, 1 if quick else COPIES))
    if gestures is not None:
        digits = np.char.isdigit(gestures.labels)
        for name, chosen in (("digits by others", digits), ("solids by others", ~digits)):
            some = gestures.take(chosen)
            found.append(Movements(name, (some.demos,), some.labels, some.people))
    spec = find_spec("aeon")
    folder = Path(str(spec.origin)).parent / "datasets" / "data" / "BasicMotions" if spec else FOLDER
    parts = [folder / f"BasicMotions_{part}.ts" for part in ("TRAIN", "TEST")]
    if all(part.is_file() for part in parts):
        arrays, classes = zip(*(one for part in parts for one in _series(part)), strict=True)
        demos = kineme.Demonstrations.from_arrays(arrays, classes)
        found.append(Movements("BasicMotions", (demos,), np.array(classes), paths=False))
    return found


def _perturbed(name: str, demos: kineme.Demonstrations, copies: int) -> Movements:
    made = tuple(TOGETHER[2].apply(demos, [SEED, copy]) for copy in range(copies))
    return Movements(name, made, np.asarray(demos.labels).astype(str))


def _series(path: Path) -> Iterator[tuple[NDArray[Any], str]]:
    """Movements (T, d) and labels of a .ts file: a line each, dimensions and then the label behind colons."""
    lines = path.read_text(encoding="utf-8").splitlines()
    for line in lines[lines.index("@data") + 1 :]:
        *dimensions, label = line.split(":")
        yield np.array([dimension.split(",") for dimension in dimensions], dtype=float).T, label
