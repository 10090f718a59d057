"""How the rates of a rotation vector relate to angular velocity and acceleration: the Jacobian of the logarithm.

For ``q = exp(p) r`` with a fixed r, and omega in the world frame,

    omega = J(p) p',    J(p) = I + a [p]x + b [p]x^2,    a = (1 - cos t) / t^2,    b = (t - sin t) / t^3,    t = |p|,

which leaves only p' parallel to p as it is (Sola, Deray and Atchuthan, "A micro Lie theory for state estimation
in robotics", 2018, Eq. 145). Taking p' itself for omega is what Koutras and Doulgeri (2020) correct in Ude et al.
(2014).
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from kineme.movements.rotations.rotation_vectors import as_vectors
from kineme.validation import Array

_SMALL = 1.0  # rad; below it the closed forms cancel and the series in t^2 converge fast
_TERMS = np.arange(10)
_SIGNS = (-1.0) ** _TERMS
_A = _SIGNS / [factorial(2 * k + 2) for k in _TERMS]
_B = _SIGNS / [factorial(2 * k + 3) for k in _TERMS]
_A_RATE, _B_RATE = (2.0 * _TERMS[1:] * series[1:] for series in (_A, _B))  # (da/dt) / t, (db/dt) / t
_C = np.array([1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160])
_SMALL_C = 0.1  # rad


def angular_velocity(p: ArrayLike, p_rate: ArrayLike) -> Array:
    """Angular velocity in the world frame (..., 3) [rad/s] of ``exp(p) r`` from p [rad] and p' [rad/s]."""
    v, rate = _components(p), _components(p_rate)
    a, b = _jacobian_factors(_dot(v, v))
    turned = _cross(v, rate)
    return np.moveaxis(rate + a * turned + b * _cross(v, turned), 0, -1)


def angular_acceleration(p: ArrayLike, p_rate: ArrayLike, p_acceleration: ArrayLike) -> Array:
    """Angular acceleration in the world frame (..., 3) [rad/s^2]: the time derivative of `angular_velocity`."""
    v, rate, acceleration = _components(p), _components(p_rate), _components(p_acceleration)
    z = _dot(v, v)
    a, b = _jacobian_factors(z)
    a_rate, b_rate = _factor_rates(z, a, b)
    radial = _dot(v, rate)  # t t'
    turned, pushed = _cross(v, rate), _cross(v, acceleration)
    omega_rate = acceleration + a * pushed + b * (_cross(rate, turned) + _cross(v, pushed))
    omega_rate += radial * a_rate * turned + radial * b_rate * _cross(v, turned)
    return np.moveaxis(omega_rate, 0, -1)


def rotation_vector_rate(p: ArrayLike, omega: ArrayLike) -> Array:
    """The inverse of `angular_velocity`: p' (..., 3) [rad/s] from p [rad] and omega in the world frame [rad/s].

    ``p' = omega - [p]x omega / 2 + c [p]x^2 omega`` with ``c = (1 - (t/2) cot(t/2)) / t^2``. It does not exist at
    t = 2 pi, 4 pi, ..., where the axis of p can change without turning anything.
    """
    v, turning = _components(p), _components(omega)
    z = _dot(v, v)
    small = z < _SMALL_C**2
    safe = np.sqrt(np.where(small, 1.0, z))
    c = np.where(small, polyval(np.where(small, z, 0.0), _C), (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2)
    turned = _cross(v, turning)
    return np.moveaxis(turning - 0.5 * turned + c * _cross(v, turned), 0, -1)


def _jacobian_factors(z: Array) -> tuple[Array, Array]:
    """The factors a and b of J at z = t^2."""
    t, small = np.sqrt(z), z < _SMALL**2
    a = 0.5 * np.sinc(0.5 / np.pi * t) ** 2  # (1 - cos t) / t^2 without its cancellation
    b = np.asarray((1.0 - np.sinc(t / np.pi)) / np.where(small, 1.0, z))
    b[small] = polyval(z[small], _B)
    return a, b


def _factor_rates(z: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """(da/dt) / t and (db/dt) / t; in closed form ``(1 - b z - 2 a) / z`` and ``(a - 3 b) / z``."""
    small = z < _SMALL**2
    safe = np.where(small, 1.0, z)
    a_rate, b_rate = np.asarray((1.0 - b * z - 2.0 * a) / safe), np.asarray((a - 3.0 * b) / safe)
    a_rate[small], b_rate[small] = polyval(z[small], _A_RATE), polyval(z[small], _B_RATE)
    return a_rate, b_rate


# Components lead inside this file: then every operation runs over long contiguous rows.
def _components(vectors: ArrayLike) -> Array:
    return np.moveaxis(as_vectors(vectors), -1, 0)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
