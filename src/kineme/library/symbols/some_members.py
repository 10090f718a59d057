"""Members of all symbols, as many as are compared with each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import symbols
from kineme.movements.trajectories.labels import label_array
from kineme.sampling import evenly_spaced

_MOST = 3000  # movements that are compared at most, equally many of each symbol


def evenly_many_members(store: Store) -> tuple[Ids, NDArray[Any]]:
    """At most 3000 members of symbols, equally many of each, and the names of their symbols."""
    shown = [symbol for symbol in symbols(store) if len(symbol)]
    share = max(1, _MOST // max(1, len(shown)))
    some = [one.members[evenly_spaced(len(one), share)] for one in shown]
    labels = np.repeat(label_array([one.name for one in shown]), [len(members) for members in some])
    return np.concatenate([np.empty(0, dtype=np.int64), *some]), labels
