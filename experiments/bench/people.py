"""Movements of people that are no part of the project, and splits of them by person.

The folder of gestures3d.npz and letters2d.npz is named by the environment variable KINEME_RECORDINGS, by default
shared/data beside the checkout.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.by_person import FOLDER

Indices = NDArray[np.intp]
RATE = 100.0  # [Hz], of recordings without time stamps


class Recorded(NamedTuple):
    """Labeled movements, and who made each."""

    demos: kineme.Demonstrations
    labels: NDArray[Any]
    people: NDArray[Any]

    def take(self, chosen: NDArray[Any]) -> Recorded:
        """Some of the movements."""
        kept = np.arange(len(self.labels))[chosen]
        return Recorded(self.demos[kept], self.labels[kept], self.people[kept])


def recorded(name: str) -> Recorded | None:
    """The movements of an archive in the folder; None where it is not there, which is said."""
    path = FOLDER / name
    if not path.is_file():
        print(f"no {name} in {FOLDER}; name the folder in KINEME_RECORDINGS")
        return None
    with np.load(path) as z:
        ends, labels, people = z["offsets"][1:-1], z["labels"].astype(str), z["people"].astype(str)
        arrays = [one.astype(float) for one in np.split(z["positions"], ends)]
        if "times" in z:
            times = [one.astype(float) - float(one[0]) for one in np.split(z["times"], ends)]
        else:
            times = [np.arange(len(array)) / RATE for array in arrays]
    return Recorded(kineme.Demonstrations.from_arrays(arrays, labels, times), labels, people)


def handwriting() -> Recorded:
    """LASA, as of one person."""
    demos = kineme.load_lasa()
    labels = np.asarray(demos.labels).astype(str)
    return Recorded(demos, labels, np.zeros(len(labels), dtype=int))


def splits(
    one: Recorded, shots: int | None, draws: int, *, own: bool = False
) -> Iterator[tuple[Any, Indices, Indices]]:
    """(person tested, train, test), `draws` for each person: `shots` of each label by the others, or the person's own.

    `shots` None trains on all of the others. Where one person made all, templates are that person's own.
    """
    everyone = np.unique(one.people)
    own = own or len(everyone) == 1
    for k, person in enumerate(everyone):
        tested = one.people == person
        for draw in range(draws):
            rng = np.random.default_rng([0 if shots is None else shots, k, draw])
            pool = tested if own else ~tested
            by_label = [
                rng.permutation(np.flatnonzero(pool & (one.labels == label))) for label in np.unique(one.labels)
            ]
            train = np.sort(np.concatenate([some[:shots] for some in by_label]))
            yield person, train, np.setdiff1d(np.flatnonzero(tested), train)
