"""What stands for a symbol: its most typical member, and the mean of its members."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.average import AveragePrimitive, average
from kineme.dmp.styles.parameters import check_primitives
from kineme.errors import SpecificationError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.similarity.alignment import Maps, maps_onto, moved, paths_of
from kineme.similarity.describe import describe
from kineme.similarity.described import Described
from kineme.similarity.similarity import similarities
from kineme.similarity.specification import Compares
from kineme.similarity.widths import median_distances


@dataclass(frozen=True, eq=False)
class Prototype:
    """A symbol as one movement.

    Attributes
    ----------
    medoid : int
        The member most similar to the others.
    average : AveragePrimitive
        Mean of the members and their spread, each laid onto the medoid first; at the medoid's position, size and
        direction, and with the (geometric) mean of all durations.
    maps : Maps
        From each member onto the medoid.
    """

    medoid: int
    average: AveragePrimitive
    maps: Maps

    @property
    def primitive(self) -> Primitives:
        """The mean, a batch of one."""
        return self.average.primitive


def prototype(primitives: Primitives, medoid: int | None = None, like: Compares | None = None) -> Prototype:
    """The prototype of the members of one symbol.

    Parameters
    ----------
    primitives : Primitives
        Of the members.
    medoid : int, optional
        Where it is known; by default the member with the largest mean similarity to the others.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take out before the mean.

    Raises
    ------
    SpecificationError
        A medoid that is none of the members.
    """
    check_primitives(primitives)
    if medoid is not None and not 0 <= medoid < len(primitives):
        raise SpecificationError(f"expected medoid to be one of {len(primitives)} members, got {medoid!r}")
    paths = paths_of(primitives)
    if medoid is None:
        medoid = medoid_of(paths.transpose(0, 2, 1), like)
    maps = maps_onto(paths, paths[medoid], like)
    return Prototype(medoid, average(moved(primitives, maps)), maps)


def medoid_of(movements: Described | MovementsLike, like: Compares | None = None) -> int:
    """The movement with the largest mean similarity to the others; the first of one or two."""
    described = describe(movements, like)
    if len(described) < 3:
        return 0
    # One width serves all of them: it only weighs the representations, by how much they differ within the symbol.
    # Where they do not differ, as movements of one dimension do not in turning angles, all are equally typical.
    widths = median_distances(described)
    differ = np.flatnonzero(widths > 0)
    if not len(differ):
        return 0
    return int(similarities(described.select(differ), widths=widths[differ]).sum(axis=1).argmax())
