"""From orientations to rotation vectors relative to the goal, where an ordinary DMP applies, and back.

For ``q = exp(p) r`` with a fixed r, and omega in the world frame, the Jacobian of the logarithm gives

    omega = J(p) p',    J(p) = I + a [p]x + b [p]x^2,    a = (1 - cos t) / t^2,    b = (t - sin t) / t^3,    t = |p|,

(Sola, Deray and Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, Eq. 145). Taking p' itself for
omega is what Koutras and Doulgeri (2020) correct in Ude et al. (2014).

Formulas are in components, arrays or Python's floats: a step of live control has no time for NumPy's microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.recorded_as import primitive_columns
from kineme.errors import TrajectoryError
from kineme.movements import rotations
from kineme.movements.channels.channel import is_plain, learned_names
from kineme.movements.preparation.trim import Step, preprocess
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, describe

#: x, y and z: arrays of one shape, or floats.
Components = tuple[Any, Any, Any]

_SMALL = 1.0  # rad; below it the closed forms cancel and the series in t^2 converge fast
_TERMS = np.arange(10)
_SIGNS = (-1.0) ** _TERMS
_A = (_SIGNS / [factorial(2 * k + 2) for k in _TERMS]).tolist()
_B = (_SIGNS / [factorial(2 * k + 3) for k in _TERMS]).tolist()
_A_RATE, _B_RATE = ((2.0 * _TERMS[1:] * series[1:]).tolist() for series in (_A, _B))  # (da/dt) / t, (db/dt) / t
_C = [1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160]
_SMALL_C = 0.1  # rad

# Per radian turned, the rotation vector moves up to (t/2) / sin(t/2): 1.6 at t = pi, 5 at 5.2, without bound at 2 pi.
_STRETCH = 5.0
_SLACK = 0.1  # rad

COLUMNS = (4, 7)
_ROUNDING = 1e-13  # rad; below it quaternions do not know whether they turn
_TILE_SAMPLES = 10_000  # samples in one tile: with its intermediate results it stays in a core's cache


def to_tangent(movements: MovementsLike, steps: Iterable[Step] = ()) -> tuple[Demonstrations, Array]:
    """Replace quaternion columns by the rotation vector from the goal to the orientation, continuous along time.

    ``p(t) = 2 log(q(t) conj(q_goal))``, in the world frame, so that ``q(t) = exp(p(t)) q_goal`` and p ends at 0.
    Koutras and Doulgeri (2020) write ``e_Q = 2 log(q_goal conj(q)) = -p``; the DMP is linear, so the movement is one.

    Parameters
    ----------
    movements : Demonstrations, Trajectory, sequence of Trajectory or of arrays, or (n, T, d) array
        d = 4: orientations (w, x, y, z). d = 7: poses, a position and an orientation. Movements with `channels` may be
        any mixture of p positions and angles with k >= 1 orientations; their columns are taken with the positions and
        angles first, and discrete channels are left out.
    steps : iterable of preprocessing steps, default ()
        Applied to positions and rotation vectors; the goal is read again from what remains.

    Returns
    -------
    demonstrations : Demonstrations
        Of 3 dimensions (rotation vector [rad]), 6 (position, rotation vector) or p + 3 k, with the times, labels and
        names.
    references : ndarray of shape (n, 4 k)
        The goal orientations q_goal, one after the other.

    Raises
    ------
    TrajectoryError
        Another number of columns; a quaternion that is not of norm 1; more than a full turn about a changing axis.
    """
    demos, k = with_orientations_last(movements)
    tangent, references = _to_tangent(demos, k)
    steps = tuple(steps)
    if not steps:
        return tangent, references
    return _to_tangent(from_tangent(preprocess(tangent, steps), references), k)


def _to_tangent(demos: Demonstrations, k: int) -> tuple[Demonstrations, Array]:
    """`to_tangent` of movements whose last columns are k orientations."""
    p = demos.n_dims - 4 * k
    positions, references = np.empty((len(demos.positions), p + 3 * k)), np.empty((len(demos), 4 * k))
    positions[:, :p] = demos.positions[:, :p]

    def tile(start: int, stop: int) -> None:
        rows = slice(demos.offsets[start], demos.offsets[stop])
        for i in range(k):
            goals, vectors = _rotation_vectors(demos, slice(p + 4 * i, p + 4 * i + 4), start, stop)
            references[start:stop, 4 * i : 4 * i + 4] = goals
            positions[rows, p + 3 * i : p + 3 * i + 3] = vectors

    for_tiles(tile, len(demos), max(1, _TILE_SAMPLES * len(demos) // len(positions)))
    return _with_positions(demos, positions), references


def with_orientations_last(movements: MovementsLike) -> tuple[Demonstrations, int]:
    """Movements in columns with the orientations (w, x, y, z) last, and how many these are."""
    demos = Demonstrations.of(movements)
    k = sum(channel.kind == "orientation" for channel in demos.channels or ())
    if k and demos.channels is not None:
        return _with_positions(demos, demos.recorded[:, primitive_columns(demos.channels)]), k
    return as_poses(demos), 1


def as_poses(movements: MovementsLike) -> Demonstrations:
    """Movements of 4 columns (w, x, y, z) or 7, a position before it; see `to_tangent`."""
    demos = Demonstrations.of(movements)
    if demos.channels is not None and not is_plain(demos.channels):
        kinds = [channel.kind for channel in demos.channels]
        if kinds.count("orientation") != 1 or len(learned_names(demos.channels)) not in (3, 6):
            raise TrajectoryError(
                "expected channels that are an orientation, or an orientation and three positions, got "
                f"{', '.join(f'{channel.name} ({channel.kind})' for channel in demos.channels)}; "
                "choose the columns by columns= of read_recordings, in the shell --columns"
            )
        return _with_positions(demos, demos.recorded[:, primitive_columns(demos.channels)])
    if demos.n_dims not in COLUMNS:
        raise TrajectoryError(
            "expected movements of 4 columns, an orientation (w, x, y, z), or 7, a position (x, y, z) and an "
            f"orientation, got {demos.n_dims} columns"
        )
    return demos


def _rotation_vectors(demos: Demonstrations, columns: slice, start: int, stop: int) -> tuple[Array, Array]:
    """Goals (m, 4) and rotation vectors (samples, 3) of the orientation in these columns, of movements start:stop."""
    first, last = demos.offsets[[start, stop]]
    offsets = demos.offsets[start : stop + 1] - first

    def where(row: int) -> str:
        i = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"{describe(start + i, demos.names)}: sample {row - offsets[i]}"

    q = rotations.normalized_rows(demos.positions[first:last, columns], where)
    goals = q[offsets[1:] - 1]
    relative = rotations.product(q, rotations.conjugate(np.repeat(goals, np.diff(offsets), axis=0)))
    p = unwrapped(relative, offsets, where)
    p[offsets[1:] - 1] = 0.0  # but for rounding they are
    # Rounding is no movement, and no axis that the original formulation could divide by.
    flat = np.maximum.reduceat(np.abs(p), offsets[:-1]) < _ROUNDING
    p[np.repeat(flat, np.diff(offsets), axis=0)] = 0.0
    return goals, p


def from_tangent(tangent: Demonstrations, references: Array) -> Demonstrations:
    """The inverse of `to_tangent`: ``q = exp(p) q_goal``, movements of 4 or 7 columns, or of p + 4 k.

    Parameters
    ----------
    tangent : Demonstrations
        Of 3 or 6 dimensions, or of p + 3 k.
    references : ndarray of shape (n, 4 k)
        The goal orientations.
    """
    n_vectors = 3 * (references.shape[1] // 4)
    vectors = tangent.positions[:, -n_vectors:].reshape(len(tangent.positions), -1, 3)
    q = rotations.product(
        rotations.exp(vectors), np.repeat(references.reshape(len(references), -1, 4), tangent.lengths, axis=0)
    )
    columns = np.concatenate((tangent.positions[:, :-n_vectors], q.reshape(len(q), -1)), axis=1)
    return _with_positions(tangent, columns)


def _with_positions(demos: Demonstrations, positions: Array) -> Demonstrations:
    return Demonstrations.of_movements(
        replace(demos.movements, positions=positions, dimensions=None, channels=None, recorded=None), demos.steps
    )


def unwrapped(q: Array, offsets: NDArray[np.intp], where: Callable[[int], str]) -> Array:
    """Logarithms (total, 3) of unit quaternions (total, 4) relative to the last of each movement, continuous along it.

    Every rotation has the rotation vectors ``(t + 2 pi k) axis``. The last sample of a movement, which is 1, gets 0,
    every other the one that continues its neighbor's, so that a tool that turns 4 rad about an axis gets 4 rad and not
    2 pi - 4 rad the other way. `where` names the movement and the sample of a row, for the message: a full turn or more
    from the last sample about an axis that changes has no continuous rotation vector.
    """
    movement = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    last = (offsets[1:] - 1)[movement]
    odd = rotations.odd_flips(q)
    odd = odd ^ odd[last]
    q = np.where(odd[:, None], -q, q)  # along time a double cover: angles run from 0 to 2 pi and come back
    w, v = q[:, :1], q[:, 1:]
    length = np.linalg.norm(v, axis=1, keepdims=True)
    axis = _axes(v, length, offsets, movement)
    angle = 2.0 * np.arctan2(length, w)
    # Past 2 pi the axis turns over and the angle decreases: count that as going on.
    reversed_ = rotations.odd_flips(axis)
    axis = np.where(reversed_[:, None], -axis, axis)
    signed = np.where(reversed_, -angle[:, 0], angle[:, 0])
    jumps = np.round(np.diff(signed, prepend=signed[0]) / (4.0 * np.pi))
    turns = -np.cumsum(jumps)
    turns -= turns[last]  # what came before the movement drops out too
    at_full_turn = (length < rotations.TINY) & (w < 0)
    principal = np.where(at_full_turn, signed[:, None] * axis, rotations.logarithm_factor(w, length) * v)
    p = principal + (4.0 * np.pi * turns)[:, None] * axis
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    steps[offsets[1:-1] - 1] = 0.0
    suspects = np.flatnonzero(steps > _SLACK)
    turned = rotations.angle_between(q[suspects], q[suspects + 1])
    broken = steps[suspects] > _SLACK + _STRETCH * turned
    if broken.any():
        k = int(np.argmax(broken))
        row = int(suspects[k])
        raise TrajectoryError(
            f"{where(row)}: expected orientations within a full turn of the goal, or turning about one fixed axis "
            f"beyond it, got a rotation vector that jumps by {steps[row]:.3g} rad to the next sample while the "
            f"orientation turns by {turned[k]:.3g} rad; split the movement there"
        )
    return p


def _axes(v: Array, length: Array, offsets: NDArray[np.intp], movement: NDArray[np.intp]) -> Array:
    """Unit axes (total, 3); where v has none, that of the sample before, at the start that of the next one."""
    rows = np.arange(len(v))
    clear = length[:, 0] >= rotations.TINY
    before = np.maximum.accumulate(np.where(clear, rows, -1))
    after = np.minimum.accumulate(np.where(clear, rows, len(v))[::-1])[::-1]
    chosen = np.where(before >= offsets[movement], before, after)
    chosen = np.where(chosen < offsets[movement + 1], chosen, rows)  # no sample of this movement has an axis
    return v[chosen] / np.where(clear[chosen], length[chosen, 0], 1.0)[:, None]


def angular_velocity(p: ArrayLike, p_rate: ArrayLike) -> Array:
    """Angular velocity in the world frame (..., 3) [rad/s] of ``exp(p) r`` from p [rad] and p' [rad/s]."""
    return _vectors(velocity_components(_components(p), _components(p_rate)))


def angular_acceleration(p: ArrayLike, p_rate: ArrayLike, p_acceleration: ArrayLike) -> Array:
    """Angular acceleration in the world frame (..., 3) [rad/s^2]: the time derivative of `angular_velocity`."""
    return _vectors(acceleration_components(_components(p), _components(p_rate), _components(p_acceleration)))


def rotation_vector_rate(p: ArrayLike, omega: ArrayLike) -> Array:
    """The inverse of `angular_velocity`: p' (..., 3) [rad/s] from p [rad] and omega in the world frame [rad/s].

    ``p' = omega - [p]_x omega / 2 + c [p]_x^2 omega`` with ``c = (1 - (t/2) cot(t/2)) / t^2``. It does not exist at
    ``t = 2 pi, 4 pi, ...``, where the axis of p can change without turning anything.
    """
    return _vectors(rate_components(_components(p), _components(omega)))


def rate_components(v: Components, turning: Components) -> Components:
    """`rotation_vector_rate` in components."""
    turned = _cross(v, turning)
    return _sum(turning, (-0.5, turned), (_inverse_factor(_dot(v, v)), _cross(v, turned)))


def velocity_components(v: Components, rate: Components) -> Components:
    """`angular_velocity` in components."""
    a, b = _jacobian_factors(_dot(v, v))
    turned = _cross(v, rate)
    return _sum(rate, (a, turned), (b, _cross(v, turned)))


def acceleration_components(v: Components, rate: Components, acceleration: Components) -> Components:
    """`angular_acceleration` in components."""
    z = _dot(v, v)
    a, b = _jacobian_factors(z)
    a_rate, b_rate = _factor_rates(z, a, b)
    radial = _dot(v, rate)  # t t'
    turned, pushed = _cross(v, rate), _cross(v, acceleration)
    bent = _sum(_cross(rate, turned), (1.0, _cross(v, pushed)))
    return _sum(acceleration, (a, pushed), (b, bent), (radial * a_rate, turned), (radial * b_rate, _cross(v, turned)))


def _jacobian_factors(z: Any) -> tuple[Any, Any]:
    """The factors a and b of J at z = t^2."""
    if isinstance(z, float):
        if z < _SMALL**2:
            return _series(z, _A), _series(z, _B)
        t = math.sqrt(z) if z < math.inf else math.nan
        return 2.0 * (math.sin(0.5 * t) / t) ** 2, (1.0 - math.sin(t) / t) / z
    t, small = np.sqrt(z), z < _SMALL**2
    a = 0.5 * np.sinc(0.5 / np.pi * t) ** 2  # (1 - cos t) / t^2 without its cancellation
    b = (1.0 - np.sinc(t / np.pi)) / np.where(small, 1.0, z)
    b[small] = _series(z[small], _B)
    return a, b


def _factor_rates(z: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """(da/dt) / t and (db/dt) / t; in closed form ``(1 - b z - 2 a) / z`` and ``(a - 3 b) / z``."""
    if isinstance(z, float):
        if z < _SMALL**2:
            return _series(z, _A_RATE), _series(z, _B_RATE)
        return (1.0 - b * z - 2.0 * a) / z, (a - 3.0 * b) / z
    small = z < _SMALL**2
    safe = np.where(small, 1.0, z)
    a_rate, b_rate = (1.0 - b * z - 2.0 * a) / safe, (a - 3.0 * b) / safe
    a_rate[small], b_rate[small] = _series(z[small], _A_RATE), _series(z[small], _B_RATE)
    return a_rate, b_rate


def _inverse_factor(z: Any) -> Any:
    """The factor c of the inverse of J at z = t^2."""
    if isinstance(z, float):
        t = math.sqrt(z) if z < math.inf else math.nan
        return _series(z, _C) if t < _SMALL_C else (1.0 - 0.5 * t / math.tan(0.5 * t)) / z
    small = z < _SMALL_C**2
    safe = np.sqrt(np.where(small, 1.0, z))
    return np.where(small, _series(np.where(small, z, 0.0), _C), (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2)


def _series(z: Any, coefficients: list[float]) -> Any:
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * z + coefficient
    return total


def _components(vectors: ArrayLike) -> Components:
    """One array each, contiguous where movements are computed in tiles; of one vector floats."""
    array = rotations.as_vectors(vectors)
    x, y, z = array.tolist() if array.ndim == 1 else np.moveaxis(array, -1, 0)
    return x, y, z


def _vectors(components: Components) -> Array:
    return np.array(components) if isinstance(components[0], float) else np.stack(components, axis=-1)


def _dot(a: Components, b: Components) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Components, b: Components) -> Components:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sum(first: Components, *scaled: tuple[Any, Components]) -> Components:
    """The first, plus factors times others."""
    x, y, z = first
    for factor, (dx, dy, dz) in scaled:
        x, y, z = x + factor * dx, y + factor * dy, z + factor * dz
    return x, y, z
