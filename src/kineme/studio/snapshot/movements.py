"""What moves again: the primitives of the prototypes, and what fits and changes primitives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import decoder, smoothness_factor, trajectory_regression
from kineme.dmp.pose.pose_dmp import PosePrimitives
from kineme.studio.snapshot.snapshot import Snapshot


def movement_parts(primitives: Primitives, *, learns: bool = True) -> Snapshot:
    """Header and arrays of C primitives, one of each class, and of their specification.

    `learns` says whether the matrices are among them that fit other movements, and the same ones in other formulations.

    Weights are in single precision, as libraries store them; all else is in double. The matrix that fits the path has
    no goal in it, so that the runtime can fit any formulation: ``W = E (y - goal (g - x0))``, of which only `goal`
    differs.
    """
    dmp = primitives.dmp
    header = {
        "formulation": dmp.formulation,
        "n_dims": primitives.n_dims,
        "n_basis": dmp.n_basis,
        "n_points": dmp.n_points,
        "K": dmp.K,
        "D": dmp.D,
        "alpha": dmp.basis.phase.alpha,
        "overlap": dmp.overlap,
        "gating": dmp.gating,
        "encodes": learns and dmp.fit == "trajectory" and not dmp.preprocessing,
    }
    arrays: dict[str, NDArray[Any]] = {
        "weights": primitives.scaled_weights.astype(np.float32),
        **{f"primitive {name}": np.asarray(getattr(primitives, name), dtype=np.float64) for name in _BOUNDARY},
        "smooth": smoothness_factor(dmp),
    }
    if header["encodes"]:
        arrays |= _encoder(dmp)
    return Snapshot({"movements": header}, arrays)


_BOUNDARY = ("starts", "goals", "velocities", "durations", "extents")


def _encoder(dmp: DMP) -> dict[str, NDArray[Any]]:
    response = decoder(dmp, dmp.n_points)
    weights, velocity = trajectory_regression(
        response._replace(goal=np.zeros_like(response.goal)), dmp.K, dmp.ridge_strength
    )
    return {"encoder": weights, "encoder velocity": velocity}


def snapshot_of_primitive(primitive: Primitives | PosePrimitives) -> Snapshot | None:
    """A batch of one, for `openPrimitive` of the runtime; None if not every column is a position.

    Angles, orientations and discrete values are written in other columns than those that move, which the runtime does
    not know.
    """
    if isinstance(primitive, PosePrimitives) or any(channel.kind != "position" for channel in primitive.channels or ()):
        return None
    return movement_parts(primitive, learns=False)
