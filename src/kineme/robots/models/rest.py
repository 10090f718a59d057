"""The posture from which an arm starts: as it is given, or where nobody says one."""

from __future__ import annotations

from itertools import combinations, product
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers

_BEND = pi / 3  # of a joint that is bent [rad]
_MOST_BENT = 3  # joints
_FREE = 0.05  # the smallest singular value of the Jacobian from which on a posture is good to start from
_ALIKE = 6  # digits to which two postures are as good as each other


def checked_rest(rest: ArrayLike, lower: Array, upper: Array, joints: tuple[str, ...]) -> Array:
    """A rest posture (n,) as it is given.

    Raises
    ------
    SpecificationError
        One of another number of joints, or outside the limits; with the joint.
    """
    posture = as_numbers(rest, "rest")
    if posture.shape != lower.shape:
        raise SpecificationError(f"expected a rest posture of {len(joints)} joints, got shape {posture.shape}")
    outside = ~((posture >= lower) & (posture <= upper))
    if outside.any():
        i = int(np.argmax(outside))
        raise SpecificationError(
            f"rest posture: expected {joints[i]} within [{lower[i]:.4g}, {upper[i]:.4g}], got {posture[i]:.4g}"
        )
    return posture


def rest_posture(model: Any, tip: str, lower: Array, upper: Array) -> tuple[Array, bool]:
    """The middle of the limits (n,); if the arm is singular there, as a straight one is, the same with joints bent.

    Of the postures with up to three joints turned by 60 degrees, within the limits and with no link lower than in the
    middle or than the base, that whose Jacobian has the largest smallest singular value. Whether
    joints are bent comes second.
    """
    wide = upper - lower > 2 * pi + 1e-9
    middle = np.where(wide, np.clip(0.0, lower, upper), (lower + upper) / 2)
    best, lowest = _manipulability(model, tip, middle)
    if best >= _FREE:
        return middle, False
    floor, chosen = min(0.0, lowest), middle
    for bent in _bends(len(middle)):
        q = middle + bent
        if np.all((q >= lower) & (q <= upper)):
            value, lowest = _manipulability(model, tip, q)
            if lowest >= floor - 1e-6 and round(value, _ALIKE) > round(best, _ALIKE):
                best, chosen = value, q
    return np.asarray(chosen, dtype=np.float64), chosen is not middle


def _bends(n: int) -> list[Array]:
    bends = []
    for count in range(1, _MOST_BENT + 1):
        for joints in combinations(range(n), count):
            for signs in product((1.0, -1.0), repeat=count):
                bent = np.zeros(n)
                bent[list(joints)] = _BEND * np.array(signs)
                bends.append(bent)
    return bends


def _manipulability(model: Any, tip: str, q: Array) -> tuple[float, float]:
    """The smallest singular value of the Jacobian of the tip, and how high its lowest joint or the tip is [m]."""
    import pinocchio

    data = model.createData()
    frame = model.getFrameId(tip)
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.updateFramePlacement(model, data, frame)
    jacobian = pinocchio.getFrameJacobian(model, data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    heights = [data.oMf[frame].translation[2], *(data.oMi[j].translation[2] for j in range(1, model.njoints))]
    return float(np.linalg.svd(jacobian.reshape(6, -1), compute_uv=False)[min(6, len(q)) - 1]), float(min(heights))


def bent_in_words(rest: Array) -> str:
    """The sentence about a posture that `rest_posture` bent."""
    posture = ",".join(f"{value:.4g}" for value in rest)
    return f"in the middle of its limits the arm is singular: it rests at {posture} (choose with rest=, --rest)"
