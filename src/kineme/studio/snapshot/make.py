"""Snapshots of libraries and of fitted recognizers."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.errors import SpecificationError
from kineme.library.grounding import prototype_of
from kineme.library.library import ActionLibrary
from kineme.library.members import Members, members_of
from kineme.library.recognize import known_members
from kineme.library.storage import read
from kineme.library.storage.symbols import symbol
from kineme.recognition.classifiers import fit_prototype
from kineme.recognition.early.hypotheses import Early
from kineme.recognition.known_classes import FittedRecognizer, KnownClasses, known_classes
from kineme.sampling import evenly_spaced
from kineme.similarity.describe import N_POINTS
from kineme.studio.snapshot.movements import movement_parts
from kineme.studio.snapshot.recognition import early_part, recognition_parts
from kineme.studio.snapshot.snapshot import Snapshot

#: Numbers of the stored paths, at most: 1.3 MB in base64, so that a page with all else stays below 2 MB.
MOST_NUMBERS = 240_000


def snapshot_of_library(library: ActionLibrary, most: int | None = None, early: Early | None = None) -> Snapshot:
    """The symbols of a library with their movements.

    Of symbols with many movements some are taken, evenly spaced, as many of each as add up to `most`; by default as
    many as fit into 2 MB, 603 in the plane and 402 in space. Widths and calibration are those of the movements taken,
    as if a library held these alone. ``header["n_all"]`` says of how many. `early` is how movements are recognized
    under way; by default as `kineme.Recognizer.stream` does.

    Raises
    ------
    SpecificationError
        No movement belongs to a symbol; more symbols than fit; what the runtime does not have, see `recognition_parts`.
    """
    store = library.store
    members = members_of(store)
    fitting = MOST_NUMBERS // (N_POINTS * (store.n_dims or 1))
    taken = some_members(members, fitting if most is None else most)
    known = known_members(store, taken)
    prototypes = [prototype_of(store, symbol(store, str(name))) for name in members.names]
    primitives = read.primitives(store, np.array(prototypes, dtype=np.int64))
    made = _snapshot(known, primitives, early)
    made.header["n_all"] = len(members.ids)
    made.header["ids"] = taken.ids.tolist()
    made.header["channels"] = None if store.channels is None else [channel.name for channel in store.channels]
    return made


def snapshot_of_recognizer(recognizer: FittedRecognizer, dmp: DMP | None = None) -> Snapshot:
    """A fitted recognizer, with a primitive of the medoid of each class."""
    known = known_classes(recognizer)
    demos = known.references.all_movements()
    medoids = fit_prototype(known.comparison, known.references).medoids
    return _snapshot(known, (dmp or DMP()).learn(demos[medoids]))


def some_members(members: Members, most: int) -> Members:
    """At most `most` members in all: of each symbol the same number, evenly spaced, or all that it has."""
    counts = np.diff(members.first, append=len(members.ids))
    if most < len(counts):
        raise SpecificationError(
            f"expected at most {most} symbols, as many as there may be movements, got {len(counts)}; take more of "
            "these, in the shell with --most, or make a library of some of the symbols"
        )
    each = int(counts.max(initial=1))
    while np.minimum(counts, each).sum() > most:
        each -= 1
    chosen = np.concatenate(
        [start + evenly_spaced(int(n), min(each, int(n))) for start, n in zip(members.first, counts, strict=True)]
    )
    first = np.concatenate(([0], np.cumsum(np.minimum(counts, each))[:-1])).astype(np.intp)
    groups = None if members.groups is None else members.groups[chosen]
    return Members(members.ids[chosen], members.names, first, groups)


def _snapshot(known: KnownClasses, primitives: Primitives, early: Early | None = None) -> Snapshot:
    recognition, movements = recognition_parts(known), movement_parts(primitives)
    header: dict[str, Any] = {**recognition.header, **movements.header, "early": early_part(known, early)}
    return Snapshot(header, recognition.arrays | movements.arrays)
