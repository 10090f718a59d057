"""In what two movements of different style differ: their paths, or their forcing terms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kineme.dmp.discrete.dmp import DMP
from kineme.dmp.discrete.operators import forcing_matrix
from kineme.dmp.styles.parameters import map_rows, path_matrix
from kineme.validation import Array


def _relative_path(dmp: DMP) -> Array:
    """To the path minus its start: position in space is no style."""
    matrix = path_matrix(dmp, dmp.n_points)
    matrix[-3] -= 1.0
    return matrix


def _forcing(dmp: DMP) -> Array:
    """To the forcing term times the formulation's scale, the target of Matsubara et al. (2011)."""
    return np.vstack((forcing_matrix(dmp, dmp.n_points).T, np.zeros((3, dmp.n_points))))


#: Name -> matrix (N + 3, T) from theta of `kineme.dmp.styles.parameters` to what is compared.
METRICS: dict[str, Callable[[DMP], Array]] = {"path": _relative_path, "forcing": _forcing}


def compared(metric: str, dmp: DMP, theta: Array) -> Array:
    """What the styles explain, shape (n, d T): its Euclidean norm is the root mean square over the T phases."""
    return map_rows(theta, METRICS[metric](dmp) / np.sqrt(dmp.n_points)).reshape(len(theta), -1)
