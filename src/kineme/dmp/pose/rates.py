"""Rates of a rotation vector, angular velocity and acceleration: the Jacobian of the logarithm.

For ``q = exp(p) r`` with a fixed r, and omega in the world frame,

    omega = J(p) p',    J(p) = I + a [p]x + b [p]x^2,    a = (1 - cos t) / t^2,    b = (t - sin t) / t^3,    t = |p|,

which leaves only p' parallel to p as it is (Sola, Deray and Atchuthan, "A micro Lie theory for state estimation
in robotics", 2018, Eq. 145). Taking p' itself for omega is what Koutras and Doulgeri (2020) correct in Ude et al.
(2014).

The formulas are written in components, which are arrays, or Python's floats where there is one vector: NumPy needs a
microsecond for each operation however small, which a step of live control has no time for.
"""

from __future__ import annotations

import math
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.movements.rotations import as_vectors
from kineme.validation import Array

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
    array = as_vectors(vectors)
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
