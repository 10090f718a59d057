"""How the rates of a rotation vector relate to angular velocity and acceleration: the Jacobian of the logarithm.

For ``q = exp(p) r`` with a fixed r, and omega in the world frame,

    omega = J(p) p',    J(p) = I + a [p]x + b [p]x^2,    a = (1 - cos t) / t^2,    b = (t - sin t) / t^3,    t = |p|,

which leaves only p' parallel to p as it is (Sola, Deray and Atchuthan, "A micro Lie theory for state estimation
in robotics", 2018, Eq. 145). Taking p' itself for omega is what Koutras and Doulgeri (2020) correct in Ude et al. (2014).
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from kineme.validation import Array

_SMALL = 1.0  # rad; below it the closed forms cancel and the series converge fast
_TERMS = np.arange(10)
_SIGNS = (-1.0) ** _TERMS
_A = _SIGNS / [factorial(2 * k + 2) for k in _TERMS]  # in powers of t^2
_B = _SIGNS / [factorial(2 * k + 3) for k in _TERMS]
_DA, _DB = (2.0 * _TERMS[1:] * series[1:] for series in (_A, _B))  # (da/dt) / t, (db/dt) / t
_C = np.array([1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160])
_SMALL_C = 0.1


def angular_velocity(p: ArrayLike, p_rate: ArrayLike) -> Array:
    """Angular velocity in the world frame (..., 3) [rad/s] of ``exp(p) r`` from p [rad] and p' [rad/s]."""
    p, rate = _vectors(p, p_rate)
    a, b = _coefficients(p)[:2]
    turned = np.cross(p, rate)
    return rate + a * turned + b * np.cross(p, turned)


def angular_acceleration(p: ArrayLike, p_rate: ArrayLike, p_acceleration: ArrayLike) -> Array:
    """Angular acceleration in the world frame (..., 3) [rad/s^2]: the time derivative of `angular_velocity`."""
    p, rate, acceleration = _vectors(p, p_rate, p_acceleration)
    a, b, da, db = _coefficients(p)
    radial = (p * rate).sum(axis=-1, keepdims=True)  # t t'
    turned, twice = np.cross(p, rate), np.cross(p, acceleration)
    return (
        acceleration
        + a * twice
        + b * (np.cross(rate, turned) + np.cross(p, twice))
        + radial * (da * turned + db * np.cross(p, turned))
    )


def rotation_vector_rate(p: ArrayLike, omega: ArrayLike) -> Array:
    """The inverse of `angular_velocity`: p' (..., 3) [rad/s] from p [rad] and omega in the world frame [rad/s].

    ``p' = omega - [p]x omega / 2 + c [p]x^2 omega`` with ``c = (1 - (t/2) cot(t/2)) / t^2``. It does not exist at
    t = 2 pi, 4 pi, ..., where the axis of p can change without turning anything.
    """
    p, omega = _vectors(p, omega)
    t = np.linalg.norm(p, axis=-1, keepdims=True)
    small = t < _SMALL_C
    safe = np.where(small, 1.0, t)
    c = np.where(small, polyval(t**2, _C), (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2)
    turned = np.cross(p, omega)
    return omega - 0.5 * turned + c * np.cross(p, turned)


def _coefficients(p: Array) -> tuple[Array, Array, Array, Array]:
    """a, b, (da/dt) / t and (db/dt) / t, each (..., 1)."""
    t = np.linalg.norm(p, axis=-1, keepdims=True)
    small = t < _SMALL
    safe, z = np.where(small, 1.0, t), np.where(small, t, 0.0) ** 2
    sin, cos = np.sin(safe), np.cos(safe)
    return (
        np.where(small, polyval(z, _A), (1.0 - cos) / safe**2),
        np.where(small, polyval(z, _B), (safe - sin) / safe**3),
        np.where(small, polyval(z, _DA), (safe * sin - 2.0 * (1.0 - cos)) / safe**4),
        np.where(small, polyval(z, _DB), (3.0 * sin - 2.0 * safe - safe * cos) / safe**5),
    )


def _vectors(*arrays: ArrayLike) -> list[Array]:
    return [np.asarray(array, dtype=np.float64) for array in arrays]
