"""The handwriting of LASA in space: a third dimension that bends with the other two."""

from __future__ import annotations

import numpy as np

import kineme


def lifted(demos: kineme.Demonstrations) -> kineme.Demonstrations:
    """The same movements with z = 0.3 x + 5 sin(y / 10), in their unit."""
    positions = [
        np.column_stack((demo.positions, 0.3 * demo.positions[:, 0] + 5 * np.sin(demo.positions[:, 1] / 10)))
        for demo in demos
    ]
    return kineme.Demonstrations.from_arrays(positions, demos.labels, [demo.times for demo in demos])
