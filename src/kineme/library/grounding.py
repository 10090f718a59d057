"""Grounding of stored symbols: prototypes, parameters, and similarity to other symbols."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kineme.anchoring.grounding import SymbolName, ground, medoid_of
from kineme.anchoring.space import ConceptualSpace, conceptual_space
from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.generation.generate import Learned, has_orientation, learn_one
from kineme.dmp.recorded_as import recorded_as
from kineme.errors import SpecificationError, TrajectoryError
from kineme.library.members import described
from kineme.library.storage import read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import Symbol, symbol, symbols
from kineme.movements.channels.channel import Channels, learned_names
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.sampling import evenly_spaced
from kineme.units import is_unit_of, unit_named

_MEMBERS = 500  # members that a medoid is chosen from, at most, evenly spaced


def prototype_of(store: Store, of_symbol: Symbol) -> int:
    """Return the id of the prototype of a symbol: the one that was set, else the medoid."""
    if of_symbol.prototype is not None:
        return int(of_symbol.prototype)
    members = _some_members(of_symbol)
    return int(members[medoid_of(described(store, members), store.specification.comparison)])


def primitive_of(store: Store, who: str) -> Primitives:
    """Return the primitive of the prototype of a symbol, a batch of one."""
    return _primitives(store, np.array([prototype_of(store, symbol(store, who))]))


def learned_of(store: Store, who: str) -> Learned:
    """Return the primitive of a symbol's prototype with its recording; see `learned_movement`."""
    return learned_movement(store, prototype_of(store, symbol(store, who)))


def learned_movement(store: Store, movement: int) -> Learned:
    """Return the primitive of a movement with its recording; one with an orientation is learned anew."""
    ids = np.array([movement])
    recording = read.movements(store, ids)[0]
    if has_orientation(recording):
        return learn_one(recording, store.specification.dmp)
    primitive = replace(_primitives(store, ids), recorded_as=recorded_as(Demonstrations([recording])))
    return Learned(primitive, recording)


def ground_symbol(
    store: Store, who: str, by: str = "medoid", units: str | Sequence[str] | None = None
) -> dict[str, Any]:
    """Return a symbol for a planner; see `ActionLibrary.ground`."""
    grounded = symbol(store, who)
    typical = prototype_of(store, grounded)
    members = np.union1d(_some_members(grounded), [typical])
    name = SymbolName(grounded.id, grounded.name, grounded.description, grounded.parents)
    units = _units(store, units)
    medoid, like = int(np.searchsorted(members, typical)), store.specification.comparison
    grounding = ground(name, _primitives(store, members), by=by, units=units, medoid=medoid, like=like)
    grounding["prototype"]["medoid"] = typical  # its id, for queries to the library
    return grounding


def space_of(store: Store) -> ConceptualSpace:
    """Return the space of symbols, with distances of their prototypes; needs two symbols with movements."""
    shown = [each for each in symbols(store) if len(each)]
    if len(shown) < 2:
        raise SpecificationError(
            f"expected two symbols with movements or more, got {len(shown)}; learn recordings with labels, or name "
            "proposals"
        )
    prototypes = described(store, [prototype_of(store, each) for each in shown])
    return conceptual_space([each.name for each in shown], prototypes, store.specification.comparison)


def _units(store: Store, said: str | Sequence[str] | None) -> str | Sequence[str] | None:
    """Return the units that were said, else those of the recordings; refuse others than these have."""
    channels = store.channels or ()
    known = _units_recorded(channels)
    if said is None:
        return None if not known or None in known else [str(unit) for unit in known]
    each = [said] * len(known) if isinstance(said, str) else list(said)
    for name, unit, other in zip(learned_names(channels), known, each, strict=False):  # `ground` counts them
        if unit is not None and (unit_named(unit) or unit.lower()) != (unit_named(str(other)) or str(other).lower()):
            raise TrajectoryError(
                f"expected {unit} as the unit of {name}, as it was recorded, got {other}; leave the units out, or say "
                "those that the library knows: a unit converts no numbers"
            )
    return said


def _units_recorded(channels: Channels) -> list[str | None]:
    """Return the unit of each learned coordinate; turns are lengths beside positions, see `lever_of`, else [rad]."""
    lengths = [channel.unit for channel in channels if channel.kind == "position"]
    turns = "rad" if not lengths else lengths[0] if is_unit_of(lengths[0], "length") else None
    return [
        turns if channel.kind == "orientation" else channel.unit for channel in channels for _ in channel.coordinates
    ]


def _some_members(of_symbol: Symbol) -> Ids:
    if not len(of_symbol):
        raise SpecificationError(
            f"expected a symbol with movements, {of_symbol.name!r} has none; delete it, or learn some"
        )
    return np.asarray(of_symbol.members[evenly_spaced(len(of_symbol), _MEMBERS)])


def _primitives(store: Store, ids: Ids) -> Primitives:
    return read.primitives(store, ids, read.names_of(store, ids))
