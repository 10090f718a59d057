"""Check a trajectory before it is written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.reporting.table import Table
from kineme.robots.execution.joint_trajectory import (
    STANDS,
    Extreme,
    JointTrajectory,
    between,
    dense_times,
    extreme,
    knows_masses,
)
from kineme.robots.kinematics.descent import TaskPath, is_partial, kinematics
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_MARGIN = 0.005  # links closer than this count as touching [m]
_RANDOM_POSTURES = 100
_ALWAYS = 0.9  # of random postures in which a pair of shapes touches: it touches by design

TRACKED = 1e-3  # the tip may be this far from the path [m]
TURNED = 1.0  # and turned by so many degrees from it, where the orientation is followed

_STANDING = 0.02  # of the fastest instant as generated, or of the limits of velocity

SAMPLING = " between samples"  # the end of what these checks are called
_POSITION = 1e-6  # beyond a limit [rad, m]
_SLACK_BETWEEN = 1.001  # times the limit of velocity and acceleration between samples
_SINGULAR = 0.02  # the smallest singular value of the Jacobian below which an arm is said to be singular
_JUMP = 0.05  # a joint may deviate so far between two samples from what its velocities say [rad, m]
_SLACK = 1 + 1e-6


def preflight(
    robot: Robot, trajectory: JointTrajectory, path: TaskPath | None = None, follow: str = "full"
) -> Preflight:
    """Make every check of a trajectory.

    Parameters
    ----------
    robot : Robot
    trajectory : JointTrajectory
    path : TaskPath, optional
        What the tip was asked to follow, at times of the trajectory; before its first one lies the approach.
    follow : {"full", "axis", "free"}, default "full"
        How much of the orientation was to be followed; see `InverseKinematics`.

    Returns
    -------
    Preflight
        Limits of position, velocity, acceleration and torque for each joint; the same between samples, where a
        controller interpolates; jumps, standing at both ends, tracking, singularity and self-collision for the arm.

    Raises
    ------
    TrajectoryError
        A trajectory of other joints, of joints in another order or other units; with steps that are not as many as
        its samples; of numbers that are not finite; or whose times do not increase from 0.
    """
    _refuse_others(robot, trajectory)
    times = dense_times(robot, trajectory)
    dense = trajectory if len(times) == len(trajectory) else between(trajectory, times)
    state = along(robot, dense)
    checks = [*_at_limits(robot, trajectory), *_torques(robot, dense, state)]
    checks += [*between_samples(robot, trajectory), *_of_the_arm(robot, trajectory, dense, state)]
    if path is not None:
        checks += tracking(robot, trajectory, path, follow, (times, state))
    return Preflight(tuple(checks), tuple(_unchecked(robot)))


def _refuse_others(robot: Robot, trajectory: JointTrajectory) -> None:
    """Refuse what is no trajectory of this arm, or cannot be checked."""
    for name in ("joints", "units"):
        expected, got = (", ".join(getattr(of, name)) for of in (robot, trajectory))
        if got != expected:
            raise TrajectoryError(
                f"expected the {name} of {robot.name}, {expected}, in this order, got {got or 'none'}; "
                "order its columns so, or convert them"
            )
    n = max(2, trajectory.times.size)
    arrays = {name: getattr(trajectory, name) for name in ("positions", "velocities", "accelerations")}
    for name, values in arrays.items():
        if values.shape != (shape := (n, robot.n_joints)):
            raise TrajectoryError(f"expected {name} of shape {shape}, samples and joints, got {values.shape}")
    one_each = {"times": trajectory.times} | {f"steps of {name}": x for name, x in trajectory.steps.items()}
    for name, values in one_each.items():
        if values.shape != (n,):
            raise TrajectoryError(f"expected {name} of shape {(n,)}, one for each sample, got {values.shape}")
    finite = all(np.isfinite(values).all() for values in (*arrays.values(), *one_each.values()))
    if not finite or trajectory.times[0] != 0 or not np.all(np.diff(trajectory.times) > 0):
        raise TrajectoryError("expected a trajectory of finite numbers, whose times increase from 0")


def _at_limits(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    """Check position, velocity and acceleration of each joint at its worst sample."""
    arrays = trajectory.positions, trajectory.velocities, trajectory.accelerations
    for order, (values, (limits, centers)) in enumerate(zip(arrays, _limits(robot), strict=True)):
        shares = (values - centers) / limits
        for j, t in enumerate(np.argmax(np.abs(shares), axis=0).tolist()):
            yield _limited(robot, order, Extreme(float(shares[t, j]), j, _at(trajectory, t)), _SLACK)


def between_samples(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    """Positions, velocities and accelerations at their worst instant, whether a sample lies there or not."""
    for order, (limits, centers) in enumerate(_limits(robot)):
        yield _limited(robot, order, extreme(trajectory, order, limits, centers), _SLACK_BETWEEN, SAMPLING)


def _limits(robot: Robot) -> tuple[tuple[Array, Array], ...]:
    """Limits of positions, velocities and accelerations, each with what it is counted from."""
    half, middle = (robot.upper - robot.lower) / 2, (robot.upper + robot.lower) / 2
    return (half, middle), (robot.velocity, 0 * half), (robot.acceleration, 0 * half)


def _limited(robot: Robot, order: int, at: Extreme, slack: float, when: str = "") -> Check:
    """Check an extreme of the position (order 0), the velocity or the acceleration of a joint."""
    j, share = at.joint, abs(at.share)
    size, middle = (float(values[j]) for values in _limits(robot)[order])
    what, unit = ("position", "velocity", "acceleration")[order] + when, unit_of(robot, j, order)
    if order:
        passed, slower = share <= slack, share ** (1 / order)
        return Check(what, robot.joints[j], at.time, share * size, size, unit, passed, slower)
    passed = (share - 1) * size <= _POSITION
    limit, slower = float((robot.lower if at.share < 0 else robot.upper)[j]), 1.0 if passed else math.inf
    return Check(what, robot.joints[j], at.time, middle + at.share * size, limit, unit, passed, slower)


def _torques(robot: Robot, trajectory: JointTrajectory, state: Along) -> Iterator[Check]:
    """Of a movement k times as long the torque is ``holding + moving / k^2``."""
    if not knows_masses(robot):
        return
    for j in np.flatnonzero(~np.isnan(robot.effort)):
        holding, moving, limit = state.holding_torques[:, j], state.moving_torques[:, j], float(robot.effort[j])
        total = np.abs(holding + moving)
        t = int(np.argmax(total))
        passed = bool(total[t] <= limit * _SLACK)
        room = limit - holding * np.sign(moving)  # what is left in the direction in which the movement pushes
        is_hopeless = np.any((np.abs(holding) > limit) | (room <= 0))
        slower = math.inf if is_hopeless else float(np.sqrt(np.max(np.abs(moving) / room)))
        unit = "N" if robot.units[j] == "m" else "Nm"
        yield Check("torque", robot.joints[j], _at(trajectory, t), float(total[t]), limit, unit, passed, slower)


def _of_the_arm(robot: Robot, trajectory: JointTrajectory, dense: JointTrajectory, state: Along) -> Iterator[Check]:
    """Check jumps and standing at both ends; then singularity, self-collision and how far it goes below its base."""
    gaps = np.diff(trajectory.times)[:, None]
    expected = (trajectory.velocities[1:] + trajectory.velocities[:-1]) / 2 * gaps
    off = np.abs(np.diff(trajectory.positions, axis=0) - expected)
    t, j = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    worst, unit, slower = float(off[t, j]), unit_of(robot, j), max(1.0, math.sqrt(float(off[t, j]) / _JUMP))
    yield Check("jump", robot.joints[j], _at(trajectory, t), worst, _JUMP, unit, worst <= _JUMP, slower)
    shares = np.abs(trajectory.velocities[[0, -1]]) / robot.velocity
    end, j = map(int, np.unravel_index(int(np.argmax(shares)), shares.shape))
    worst, where, time = float(shares[end, j]), robot.joints[j], _at(trajectory, -end)
    slower = 1.0 if worst <= STANDS else math.inf
    unit = "of the velocity limit"
    yield Check("standing at the ends", where, time, worst, STANDS, unit, worst <= STANDS, slower)
    t = int(np.argmin(state.smallest_singular_values))
    worst, unit = float(state.smallest_singular_values[t]), f"(singular below {_SINGULAR:g})"
    yield Check("singularity", "tip", _at(dense, t), worst, math.nan, unit, True)
    if state.contacts:
        t, first, second = min(state.contacts)
        n, links = len(state.contacts), f"{first} and {second}"
        yield Check("self-collision", links, _at(dense, t), n, 0, "contacts", False, math.inf)
    else:
        yield Check("self-collision", "none", 0.0, 0, 0, "contacts", True)
    t, j = map(int, np.unravel_index(int(np.argmin(state.heights)), state.heights.shape))
    lowest, where = float(state.heights[t, j]), (*robot.joints, "tip")[j]
    if lowest < 0:
        unit = "m (the base stands at 0)"
        yield Check("lowest point", where, _at(dense, int(t)), lowest, math.nan, unit, True)


def _unchecked(robot: Robot) -> Iterator[str]:
    if not knows_masses(robot):
        yield "torques: the model has no masses"
    else:
        if np.isnan(robot.effort).any():
            named = ", ".join(np.array(robot.joints)[np.isnan(robot.effort)])
            yield f"torques of {named}: the model does not say the largest"
        bodies = list(robot.model.inertias)[1:]
        if weightless := [name for name, body in zip(robot.joints, bodies, strict=True) if body.mass <= 0]:
            yield f"the weight of what {', '.join(weightless)} move: the model has no masses there"
    if robot.geometry.ngeoms == 0:
        yield "self-collision: the model has no shapes"


def _at(trajectory: JointTrajectory, t: int) -> float:
    return float(trajectory.times[t])


class Steps(NamedTuple):
    """A discrete channel as it was generated, T samples."""

    name: str
    values: Array  # (T,)
    velocities: Array  # (T, n), of the joints


def steps_kept(robot: Robot, trajectory: JointTrajectory, generated: Steps) -> Check:
    """Every value of the channel is there, in the same order, and what changed while the arm stood does so still.

    Too few samples lose a short pulse, and the fastest timing the time in which an arm waits for its gripper.
    """
    name, sent = generated.name, trajectory.steps[generated.name]
    # The samples from which another value holds.
    before, now = (np.flatnonzero(np.diff(values)) + 1 for values in (generated.values, sent))
    if not np.array_equal(generated.values[[0, *before]], sent[[0, *now]]):
        return Check("steps", name, 0.0, len(now), len(before), "changes", False, math.inf)
    if len(now) == 0:
        return Check("steps", name, 0.0, 0, 0, "changes", True)
    speeds = np.abs(generated.velocities).max(axis=1)
    stood = speeds[before] <= _STANDING * speeds.max()
    shares = (np.abs(trajectory.velocities[now]) / robot.velocity).max(axis=1)
    passed = not np.any(stood & (shares > _STANDING))
    moving = passed and not stood.all()
    worst = int(np.argmax(np.where(stood, 0.0, shares) if moving else np.where(stood, shares, 0.0)))
    limit, unit = (math.nan, "of the velocity limit, moving") if moving else (_STANDING, "of the velocity limit")
    at, slower = float(trajectory.times[now[worst]]), 1.0 if passed else math.inf
    return Check("steps", name, at, float(shares[worst]), limit, unit, passed, slower)


class Check(NamedTuple):
    """The worst instant of one quantity beside its limit."""

    what: str  # "velocity", "self-collision", ...
    where: str  # the joint, the two links, or the tip
    time: float  # [s]
    worst: float
    limit: float  # nan where there is none to keep
    unit: str
    passed: bool
    slower: float = 1.0  # the movement would pass if it took so many times as long; inf: at no speed


@dataclass(frozen=True)
class Preflight:
    """All checks of one trajectory.

    - `checks`: for velocity, acceleration, position and torque the worst instant of each joint, then the arm as a
      whole.
    - `unchecked`: what could not be checked and why, one sentence each.
    """

    checks: tuple[Check, ...]
    unchecked: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True where every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass, the worst ratio to its limit first."""
        return tuple(sorted((c for c in self.checks if not c.passed), key=lambda c: -c.slower))

    @property
    def slower(self) -> float:
        """The least factor of the duration with which all pass; inf if no speed helps."""
        return max((check.slower for check in self.checks if not check.passed), default=1.0)


def unit_of(robot: Robot, joint: int, order: int = 0) -> str:
    """Unit of the position of a joint, of its velocity (order 1) or its acceleration (order 2)."""
    return robot.units[joint] + ("", "/s", "/s^2")[order]


def preflight_table(preflight: Preflight) -> Table:
    """One line for each check: the worst value beside its limit, when, and whether it passed."""
    rows = [
        (
            f"{check.what}, {check.where}",
            f"{check.worst:.3g}",
            "" if math.isnan(check.limit) else f"{check.limit:.4g}",
            check.unit,
            f"{check.time:.2f}",
            "" if math.isnan(check.limit) else "ok" if check.passed else "FAILED",
        )
        for check in preflight.checks
    ]
    unchecked = f"Not checked: {'; '.join(preflight.unchecked)}." if preflight.unchecked else ""
    return Table("Preflight", ("check", "worst", "limit", "unit", "at [s]", ""), rows, unchecked)


def checks_as_data(preflight: Preflight) -> list[dict[str, Any]]:
    """List the checks as plain data; None where a number is not finite."""
    rows = [check._asdict() for check in preflight.checks]
    return [
        {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in row.items()} for row in rows
    ]


def tracking(
    robot: Robot, trajectory: JointTrajectory, path: TaskPath, follow: str, dense: tuple[Array, Along]
) -> Iterator[Check]:
    """Check how far the tip is from its path, and how far turned, without limit where that is followed in part alone.

    Where the times of `dense` end with the path's, it is computed already.
    """
    times, state = dense
    n = len(path.times)
    if np.array_equal(times[-n:], path.times):
        positions, rotations = state.tip_positions[-n:], state.tip_rotations[-n:]
    else:
        positions, rotations = kinematics(robot, between(trajectory, path.times).positions)[:2]
    off = np.linalg.norm(positions - path.positions, axis=1)
    turned = np.degrees(_angles(rotations, path.rotations, follow))
    t, r = int(np.argmax(off)), int(np.argmax(turned))
    worst, angle = float(off[t]), float(turned[r])
    passed = worst <= TRACKED
    slower = 1.0 if passed else math.inf
    yield Check("tracking", "tip", float(path.times[t]), 1e3 * worst, 1e3 * TRACKED, "mm", passed, slower)
    limit = math.nan if follow == "free" or is_partial(robot) else TURNED
    passed = not angle > limit
    slower = 1.0 if passed else math.inf
    yield Check("turned away", "tip", float(path.times[r]), angle, limit, "deg", passed, slower)


def _angles(rotations: Array, wanted: Array, follow: str) -> Array:
    """Angles (T,) between orientations; with "axis", between the z axes of the tip."""
    if follow == "axis":
        cosines = np.einsum("ti,ti->t", rotations[:, :, 2], wanted[:, :, 2])
    else:
        cosines = (np.einsum("tji,tji->t", rotations, wanted) - 1) / 2
    return np.asarray(np.arccos(np.clip(cosines, -1, 1)))


class Along(NamedTuple):
    """Kinematics, torques and contacts of an arm at the T samples of a trajectory."""

    tip_positions: Array  # (T, 3) [m]
    tip_rotations: Array  # (T, 3, 3)
    heights: Array  # (T, n + 1), of the joints and the tip above the base [m]
    smallest_singular_values: Array  # (T,), of the Jacobian of the tip, its translation counted in meters
    holding_torques: Array  # (T, n), at rest in that posture [Nm]
    moving_torques: Array  # (T, n), what the movement adds
    contacts: tuple[Contact, ...]  # the first of each pair of links that touch


def along(robot: Robot, trajectory: JointTrajectory) -> Along:
    """Follow the trajectory through the model."""
    import pinocchio

    model, data = robot.model, robot.model.createData()
    positions, rotations, jacobians = kinematics(robot, trajectory.positions)
    n_samples, n = trajectory.positions.shape
    heights, holding, total = np.empty((n_samples, n + 1)), np.empty((n_samples, n)), np.empty((n_samples, n))
    samples = zip(trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)
    for t, (q, v, a) in enumerate(samples):
        pinocchio.forwardKinematics(model, data, q)
        heights[t] = [*(data.oMi[j].translation[2] for j in range(1, model.njoints)), positions[t, 2]]
        holding[t] = pinocchio.computeGeneralizedGravity(model, data, q)
        total[t] = pinocchio.rnea(model, data, q, v, a)
    singular = np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, min(6, n) - 1], dtype=np.float64)
    contacts = contacts_of(robot, trajectory.positions)
    return Along(positions, rotations, heights, singular, holding, total - holding, contacts)


class Contact(NamedTuple):
    """Two links that touch."""

    sample: int
    first: str
    second: str


def contacts_of(robot: Robot, positions: Array) -> tuple[Contact, ...]:
    """The first contact of each pair of shapes that touch, over joint positions (T, n)."""
    geometry, margins = _pair_geometry(robot)
    touching = _touching(robot, geometry, positions, margins)

    def link(shape: int) -> str:
        return str(robot.model.frames[geometry.geometryObjects[shape].parentFrame].name)

    pairs = [(int(k), geometry.collisionPairs[int(k)]) for k in np.flatnonzero(touching.any(axis=0))]
    return tuple(Contact(int(touching[:, k].argmax()), link(pair.first), link(pair.second)) for k, pair in pairs)


@lru_cache(maxsize=8)
def _pair_geometry(robot: Robot) -> tuple[Any, Array]:
    """The arm's shapes with the pairs that can touch, and the margin of each [m], 0 where it is passed at rest.

    Neighboring links are no pairs, and those that touch in nearly all postures, by design.
    """
    import pinocchio

    geometry = robot.geometry.copy()
    geometry.removeAllCollisionPairs()
    parents = list(robot.model.parents)
    for (i, first), (j, second) in combinations(enumerate(geometry.geometryObjects), 2):
        a, b = first.parentJoint, second.parentJoint
        if a != b and parents[a] != b and parents[b] != a:
            geometry.addCollisionPair(pinocchio.CollisionPair(i, j))
    postures = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_RANDOM_POSTURES, robot.n_joints))
    shares = _touching(robot, geometry, postures, _MARGIN).mean(axis=0)
    for k in np.flatnonzero(shares > _ALWAYS)[::-1]:
        geometry.removeCollisionPair(geometry.collisionPairs[int(k)])
    near, touching = (_touching(robot, geometry, robot.rest[None], margin)[0] for margin in (_MARGIN, 0.0))
    return geometry, np.where(near & ~touching, 0.0, _MARGIN)


def _touching(robot: Robot, geometry: Any, postures: Array, margins: ArrayLike) -> NDArray[np.bool_]:
    """Tell of each pair of shapes whether it is closer than its margin [m], in each posture: (T, pairs)."""
    import pinocchio

    data, shapes = robot.model.createData(), geometry.createData()
    touching = np.zeros((len(postures), len(geometry.collisionPairs)), dtype=bool)
    for request, margin in zip(shapes.collisionRequests, np.broadcast_to(margins, touching.shape[1]), strict=True):
        request.security_margin = float(margin)
    for t, q in enumerate(postures):
        if pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False):
            touching[t] = [result.isCollision() for result in shapes.collisionResults]
    return touching
