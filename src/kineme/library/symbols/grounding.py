"""What symbols mean: the movement that stands for one, how it may vary, and where it lies among the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.grounding.ground import SymbolName, ground
from kineme.anchoring.grounding.morph import morph
from kineme.anchoring.grounding.prototypes import medoid_of
from kineme.anchoring.grounding.space import ConceptualSpace, conceptual_space
from kineme.comparison.describe import describe_rows
from kineme.comparison.sampling import evenly_spaced
from kineme.errors import SpecificationError
from kineme.library.storage.symbols import Symbol
from kineme.primitives.discrete.primitives import Primitives

if TYPE_CHECKING:
    from kineme.library.library import ActionLibrary

Ids = NDArray[np.int64]

_MEMBERS = 500  # of a symbol that speak for it, at most, evenly spaced


def prototype_of(library: ActionLibrary, symbol: Symbol) -> int:
    """Id of the movement that stands for a symbol: the one that was named so, else the medoid."""
    if symbol.prototype is not None:
        return int(symbol.prototype)
    members = _some(symbol)
    described = describe_rows(library.features(members), library.n_dims or 0, library.specification.recognizer())
    return int(members[medoid_of(described, library.specification.recognizer())])


def primitive_of(library: ActionLibrary, who: str) -> Primitives:
    """The primitive of the movement that stands for a symbol, a batch of one."""
    return library.primitives(ids=[prototype_of(library, library[who])])


def ground_symbol(
    library: ActionLibrary, who: str, by: str = "medoid", units: str | Sequence[str] | None = None
) -> dict[str, Any]:
    """A symbol in a planner's terms; see `ActionLibrary.ground`."""
    symbol = library[who]
    typical = prototype_of(library, symbol)
    members = np.union1d(_some(symbol), [typical])
    name = SymbolName(symbol.id, symbol.name, symbol.description, symbol.parents)
    place = int(np.searchsorted(members, typical))
    like = library.specification.recognizer()
    grounding = ground(name, library.primitives(ids=members), by=by, units=units, medoid=place, like=like)
    grounding["prototype"]["medoid"] = typical  # as the library knows it, for a planner that asks it for more
    return grounding


def space_of(library: ActionLibrary) -> ConceptualSpace:
    """The symbols at distances, by the movements that stand for them; needs two symbols with movements."""
    symbols = [symbol for symbol in library.symbols() if len(symbol)]
    if len(symbols) < 2:
        raise SpecificationError(
            f"expected two symbols with movements or more, got {len(symbols)}; learn recordings with labels, or name "
            "proposals"
        )
    like = library.specification.recognizer()
    rows = library.features([prototype_of(library, symbol) for symbol in symbols])
    return conceptual_space([one.name for one in symbols], describe_rows(rows, library.n_dims or 0, like), like)


def morph_symbols(library: ActionLibrary, a: str, b: str, shares: Any) -> Primitives:
    """Movements on the way from one symbol to another; see `ActionLibrary.morph`."""
    return morph(primitive_of(library, a), primitive_of(library, b), shares, library.specification.recognizer())


def _some(symbol: Symbol) -> Ids:
    if not len(symbol):
        raise SpecificationError(
            f"expected a symbol with movements, {symbol.name!r} has none; delete it, or learn some"
        )
    return np.asarray(symbol.members[evenly_spaced(len(symbol), _MEMBERS)])
