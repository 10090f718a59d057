"""Rotation vectors that follow a movement past half a turn instead of jumping to the other end of the axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.rotations.quaternions import angle_between
from kineme.movements.rotations.rotation_vectors import TINY, logarithm_factor
from kineme.validation import Array

# Per radian turned, the rotation vector moves up to (t/2) / sin(t/2): 1.6 at t = pi, 5 at 5.2, without bound at 2 pi.
_STRETCH = 5.0
_SLACK = 0.1  # rad


def unwrapped(q: Array, offsets: NDArray[np.intp], where: Callable[[int], str]) -> Array:
    """Logarithms of unit quaternions relative to the last of each movement, continuous along it.

    Every rotation has the rotation vectors ``(t + 2 pi k) axis``. The last sample of a movement gets 0, every other
    the one that continues its neighbor's, so that a tool that turns 4 rad about an axis gets
    4 rad and not 2 pi - 4 rad the other way. The signs of the quaternions do not matter.

    Parameters
    ----------
    q : ndarray of shape (total, 4)
        All movements, one after the other, each ending at 1; consecutive samples less than half a turn apart.
    offsets : ndarray of shape (n + 1,)
        Where each movement begins.
    where : callable
        Names the movement and the sample of a row, for the message.

    Returns
    -------
    ndarray of shape (total, 3)
        Rotation vectors [rad].

    Raises
    ------
    TrajectoryError
        A full turn or more from the last sample about an axis that changes: there is no continuous rotation vector
        then, since at 2 pi all axes are the same orientation.
    """
    movement = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    last = (offsets[1:] - 1)[movement]
    odd = _parity((q[1:] * q[:-1]).sum(axis=1) < 0)
    odd = odd ^ odd[last]
    q = np.where(odd[:, None], -q, q)  # along time a double cover: angles run from 0 to 2 pi and come back
    w, v = q[:, :1], q[:, 1:]
    length = np.linalg.norm(v, axis=1, keepdims=True)
    axis = _axes(v, length, offsets, movement)
    angle = 2.0 * np.arctan2(length, w)
    # Past 2 pi the axis turns over and the angle decreases: count that as going on.
    reversed_ = _parity((axis[1:] * axis[:-1]).sum(axis=1) < 0)
    axis = np.where(reversed_[:, None], -axis, axis)
    signed = np.where(reversed_, -angle[:, 0], angle[:, 0])
    jumps = np.round(np.diff(signed, prepend=signed[0]) / (4.0 * np.pi))
    turns = -np.cumsum(jumps)
    turns -= turns[last]  # what came before the movement drops out too
    at_full_turn = (length < TINY) & (w < 0)
    principal = np.where(at_full_turn, signed[:, None] * axis, logarithm_factor(w, length) * v)
    p = principal + (4.0 * np.pi * turns)[:, None] * axis
    _check_continuous(p, q, offsets, where)
    return p


def _parity(flips: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether an odd number of flips (total - 1,) lies before each sample, shape (total,).

    Counted through all movements: only differences within a movement matter.
    """
    odd: NDArray[np.bool_] = np.logical_xor.accumulate(np.concatenate(([False], flips)))
    return odd


def _axes(v: Array, length: Array, offsets: NDArray[np.intp], movement: NDArray[np.intp]) -> Array:
    """Unit axes (total, 3); where v has none, that of the sample before, at the start that of the next one."""
    rows = np.arange(len(v))
    clear = length[:, 0] >= TINY
    before = np.maximum.accumulate(np.where(clear, rows, -1))
    after = np.minimum.accumulate(np.where(clear, rows, len(v))[::-1])[::-1]
    chosen = np.where(before >= offsets[movement], before, after)
    chosen = np.where(chosen < offsets[movement + 1], chosen, rows)  # no sample of this movement has an axis
    return v[chosen] / np.where(clear[chosen], length[chosen, 0], 1.0)[:, None]


def _check_continuous(p: Array, q: Array, offsets: NDArray[np.intp], where: Callable[[int], str]) -> None:
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    steps[offsets[1:-1] - 1] = 0.0
    suspects = np.flatnonzero(steps > _SLACK)
    turned = angle_between(q[suspects], q[suspects + 1])
    broken = steps[suspects] > _SLACK + _STRETCH * turned
    if broken.any():
        k = int(np.argmax(broken))
        row = int(suspects[k])
        raise TrajectoryError(
            f"{where(row)}: expected orientations within a full turn of the goal, or turning about one fixed axis "
            f"beyond it, got a rotation vector that jumps by {steps[row]:.3g} rad to the next sample while the "
            f"orientation turns by {turned[k]:.3g} rad; split the movement there"
        )
