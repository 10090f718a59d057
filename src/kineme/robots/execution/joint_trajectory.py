"""Trajectories that are sent to an arm: joint positions and rates over time, also between samples."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array

_APART = 0.05  # between two postures that are looked at no joint moves farther [rad, m]
_HALVINGS = 40  # of an interval between samples, which leave 1e-12 of it


@dataclass(frozen=True, eq=False, repr=False)
class JointTrajectory:
    """Joint positions of one arm over time, T samples of n joints.

    Attributes
    ----------
    joints : tuple of str
    times : ndarray of shape (T,)
        From 0 [s].
    positions, velocities, accelerations : ndarray of shape (T, n)
        [rad, m], per second, per second squared.
    steps : dict of str to ndarray of shape (T,)
        Channels beside the joints, such as a gripper: the value that holds from each sample on.
    units : tuple of n str
        "rad", or "m" of joints that slide; by default "rad".
    """

    joints: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    steps: dict[str, Array]
    units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", tuple(self.units) or ("rad",) * len(self.joints))

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        return f"JointTrajectory({len(self.joints)} joints, {len(self)} samples, {self.duration:.2f} s)"


def joined(first: JointTrajectory, second: JointTrajectory) -> JointTrajectory:
    """One after the other; the second begins where and when the first ends."""

    def both(name: str) -> Array:
        return np.concatenate((getattr(first, name)[:-1], getattr(second, name)))

    times = np.concatenate((first.times[:-1], second.times + first.duration))
    held = {name: np.concatenate((np.full(len(first) - 1, values[0]), values)) for name, values in second.steps.items()}
    return JointTrajectory(
        second.joints, times, both("positions"), both("velocities"), both("accelerations"), held, second.units
    )


def between(trajectory: JointTrajectory, times: Array) -> JointTrajectory:
    """The trajectory at other times (m,) within its own.

    Between two samples lies the polynomial of the fifth order that has the positions, velocities and accelerations of
    both at its ends: that is how the joint_trajectory_controller of ROS interpolates. Discrete channels hold.
    """
    held = np.searchsorted(trajectory.times, times, "right") - 1
    k = np.clip(held, 0, len(trajectory) - 2)
    h = np.diff(trajectory.times)[k, None]
    u = (times - trajectory.times[k])[:, None] / h
    c = _polynomials(trajectory)[:, k]
    velocities = _derivative(c)
    return JointTrajectory(
        trajectory.joints,
        times,
        _values(c, u),
        _values(velocities, u) / h,
        _values(_derivative(velocities), u) / h**2,
        {name: values[held] for name, values in trajectory.steps.items()},
    )


class Extreme(NamedTuple):
    """The largest value of any joint at any time, as a share of its limit."""

    share: float  # below 0 of a value below the center
    joint: int
    time: float  # [s]


def extreme(trajectory: JointTrajectory, order: int, limits: Array, centers: Array | float = 0.0) -> Extreme:
    """The largest ``|x_j - center_j| / limit_j``, between samples too: of the derivative of that order.

    The maximum of a polynomial lies at an end or where its derivative vanishes. Only those are searched whose Bernstein
    coefficients, which bound them, are beyond all samples.
    """
    gaps = np.diff(trajectory.times)
    c = _polynomials(trajectory)
    c[0] -= centers
    for _ in range(order):
        c = _derivative(c)
    c = c / (limits * gaps[:, None] ** order)
    ends = np.maximum(np.abs(_values(c, 0.0)), np.abs(_values(c, 1.0)))
    bounds = np.abs(np.tensordot(_bernstein(len(c) - 1), c, 1)).max(axis=0)
    k, j = np.nonzero((bounds > ends.max()) | (ends == ends.max()))
    u = np.concatenate((np.zeros((1, len(k))), _roots(_derivative(c[:, k, j])), np.ones((1, len(k)))))
    shares = _values(c[:, k, j], u)
    at = np.unravel_index(int(np.argmax(np.abs(shares))), shares.shape)
    gap = int(k[at[1]])
    return Extreme(float(shares[at]), int(j[at[1]]), float(trajectory.times[gap] + u[at] * gaps[gap]))


def _polynomials(trajectory: JointTrajectory) -> Array:
    """Coefficients (6, T - 1, n) of the powers of u, which goes from 0 to 1 between two samples."""
    h = np.diff(trajectory.times)[:, None]
    q, v, a = trajectory.positions, h * trajectory.velocities[:-1], h**2 * trajectory.accelerations[:-1]
    distance = np.diff(q, axis=0) - v - a / 2
    more = h * trajectory.velocities[1:] - v - a
    most = h**2 * trajectory.accelerations[1:] - a
    c3, c4, c5 = (
        10 * distance - 4 * more + most / 2,
        -15 * distance + 7 * more - most,
        6 * distance - 3 * more + most / 2,
    )
    return np.stack((q[:-1], v, a / 2, c3, c4, c5))


def _values(c: Array, u: Array | float) -> Array:
    """Polynomials with coefficients c (k + 1, ...) at u."""
    total = c[-1]
    for lower in c[-2::-1]:
        total = lower + u * total
    return np.asarray(total + 0 * u)


def _derivative(c: Array) -> Array:
    return np.asarray(c[1:] * np.arange(1, len(c)).reshape(-1, *[1] * (c.ndim - 1)))


def _bernstein(degree: int) -> Array:
    """From coefficients of powers to those of Bernstein polynomials, between which the values on [0, 1] lie."""
    return np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])


def _roots(c: Array) -> Array:
    """Points (k, m) of [0, 1], among which all roots there are of m polynomials with coefficients c (k + 1, m).

    Between two neighboring roots of the derivative a polynomial is monotone: bisection finds its root, if it has one.
    """
    ends = np.zeros((1, c.shape[1])), np.ones((1, c.shape[1]))
    edges = np.sort(
        np.concatenate((ends[0], _roots(_derivative(c)), ends[1])) if len(c) > 2 else np.concatenate(ends), 0
    )
    low, high = edges[:-1], edges[1:]
    positive = _values(c, low) > 0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        before = (_values(c, middle) > 0) == positive
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return low


def dense_times(robot: Robot, trajectory: JointTrajectory) -> Array:
    """The times of the samples, and evenly between them so many that no joint moves farther than 0.05 rad or m.

    Its speed is that at the samples, or from one to the next on average, but not beyond its limit: where it is faster
    in between, it moves up to twice as far.
    """
    times = trajectory.times
    gaps = np.diff(times)[:, None]
    speeds = np.maximum(np.abs(trajectory.velocities[1:]), np.abs(trajectory.velocities[:-1]))
    speeds = np.maximum(speeds, np.abs(np.diff(trajectory.positions, axis=0)) / gaps)
    moved = (gaps * np.minimum(np.nan_to_num(speeds), robot.velocity)).max(axis=1)
    parts = np.maximum(1, np.ceil(moved / _APART)).astype(int)
    first = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    return np.append(times[first] + share * gaps[first, 0], times[-1])
