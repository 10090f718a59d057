"""An arm in MuJoCo among objects: driven by torques, pushed, watched, and stopped on its path."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.io.records import needs
from kineme.movements.rotations import quaternion_of
from kineme.robots.execution.joint_trajectory import JointTrajectory, Torques, between, knows_masses, n_samples
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import Robot, check_robot
from kineme.robots.planning.robot_movement import InfeasibleError, RobotMovement
from kineme.validation import Array, as_numbers, as_point, check_number

_STEP = 0.001  # [s]
_LOOKS = 10  # steps from one look of `watch`, and one sample of a `Run`, to the next
_STIFFNESS, _DAMPING = 1600.0, 80.0  # [1/s^2], [1/s], of a unit inertia: critically damped, 40 rad/s
_SETTLES, _LONGEST = 0.2, 2.0  # so long the arm stands after its last sample [s]; longer where it is not there yet
_STANDS = 0.01  # from where the joints stand a movement may begin [rad, m]
_MASS, _RADIUS = 0.1, 0.02  # of an object [kg], [m]
_STIFF = [0.005, 1.0]  # time constant [s] and damping ratio of the grip and of stops

_FIRST_RAMP, _LONGER = 0.05, 1.25  # seconds of a brake, and the factor to the next one that is tried
_SLACK = 1.001  # of limits between samples

State = dict[str, Any]
Watch = Callable[[float, Array], bool]


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A movement as the simulated arm made it, T samples, 100 of them in a second.

    - `times` (T,): since the movement began [s], below 0 in the approach; at its end the arm stands for 0.2 s at least.
    - `joints` (T, n): as measured [rad, m].
    - `sent` (T, n): where they were sent.
    - `tips` (T, 3): as measured [m].
    - `objects`: name -> where it was (T, 3) [m]; nan where it was gone.
    - `stopped`: when `watch` stopped the arm [s]; None where it came to the end.
    - `tip_error`, `joint_error`: largest distance from what was sent, of the tip [m] and of any joint [rad, m].
    - `effort`: largest torque of any joint, as a share of its limit; nan where none is known.
    """

    times: Array
    joints: Array
    sent: Array
    tips: Array
    objects: dict[str, Array]
    stopped: float | None
    tip_error: float
    joint_error: float
    effort: float

    def __repr__(self) -> str:
        end = "to its end" if self.stopped is None else f"stopped at {self.stopped:.2f} s"
        return f"Run({end}, tip at most {1e3 * self.tip_error:.2g} mm off)"


class Simulation:
    """An arm in MuJoCo at 1 kHz, and objects that it grips, carries and leaves.

    The joints follow what is sent by computed torque, ``tau = M (a + 80 (v - dq/dt) + 1600 (q_sent - q)) + bias``,
    within the effort of the arm. Nothing collides. When the gripper closes, it holds the nearest object within reach,
    which weighs on the arm from then on; when it opens, the object rests where it is.

    Parameters
    ----------
    robot : Robot
        One whose model has masses.
    objects : dict of str to array_like of shape (3,), optional
        Positions in the frame of the robot [m].
    gripper : str, default "gripper"
        Name of the channel of a movement that opens and closes.
    opening : tuple of two float, default (0.0, 1.0)
        Values of that channel, open and closed: the nearer one holds.
    reach : float, default 0.03
        Distance from the tip at which an object is still held [m].
    flags : dict of str to float, str or callable, optional
        What else `state` says: a number, a word, or a function of all that it says besides.
    noise : float, default 0.0
        Standard deviation of measured positions of tip and objects [m].
    seed : int, default 0
        Of that noise.
    start : array_like of shape (n,), optional
        Where the joints stand; by default the rest posture.

    Attributes
    ----------
    joints : ndarray of shape (n,)
        Where the arm was sent last, and stands: the start of the next movement.
    time : float
        Simulated time [s].
    flags : dict
        As given; what changes in it is said from then on.

    Raises
    ------
    SpecificationError
        An arm without masses, positions that are not three finite numbers, two columns of one name.
    DataError
        The extra ``simulation`` is not installed.
    """

    joints: Array

    def __init__(  # noqa: PLR0913 - one parameter per option
        self,
        robot: Robot,
        objects: Mapping[str, ArrayLike] | None = None,
        *,
        gripper: str = "gripper",
        opening: tuple[float, float] = (0.0, 1.0),
        reach: float = 0.03,
        flags: Mapping[str, Any] | None = None,
        noise: float = 0.0,
        seed: int = 0,
        start: ArrayLike | None = None,
    ) -> None:
        check_robot(robot)
        if not knows_masses(robot):
            raise SpecificationError(f"expected a robot whose model has masses to simulate, {robot.name} has none")
        self.robot, self.gripper, self.reach, self.noise = robot, gripper, reach, noise
        check_number("reach", reach, least=0.0)
        check_number("noise", noise, least=0.0)
        self._values = as_numbers(opening, "opening")
        if self._values.shape != (2,) or not np.isfinite(self._values).all() or self._values[0] == self._values[1]:
            raise SpecificationError(f"expected opening as two numbers, open and closed, got {opening!r:.80}")
        places = {name: as_point(name, place, "xyz") for name, place in (objects or {}).items()}
        self.flags, self._random = dict(flags or {}), np.random.default_rng(seed)
        self._row = {name: row for row, name in enumerate(places)}
        columns = [*_columns("tip"), gripper, *(c for name in places for c in _columns(name)), *self.flags]
        if len(set(columns)) < len(columns) or not all(isinstance(c, str) and c for c in columns):
            raise SpecificationError(
                f"expected objects, gripper and flags with columns of different names, got {columns}"
            )
        self._model, self._data, self._mujoco = _world(robot, len(places))
        self.joints = np.array(robot.rest if start is None else as_point("start", start, robot.joints))
        self._data.qpos[: robot.n_joints] = self.joints
        self._tip = self._model.body("tip").id
        self._objects = self._tip + 1 + np.arange(len(places))
        self._most = np.where(np.isnan(robot.effort), np.inf, robot.effort)
        self._gone = np.zeros(len(places), dtype=bool)
        self._held: int | None = None
        self._closed = False
        self._events: list[tuple[float, Callable[[], None]]] = []
        for name, place in places.items():
            self._put(self._row[name], place)
        self._mujoco.mj_kinematics(self._model, self._data)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._data.time)

    @property
    def held(self) -> str | None:
        """Name of the object in the gripper."""
        return None if self._held is None else list(self._row)[self._held]

    def state(self) -> State:
        """Return what a sensor would say: tip_x ..., the gripper, NAME_x ... of each object, the flags.

        An object that is gone is at nan.
        """
        places = self._measured(np.vstack((self._data.xpos[self._tip], self._places())))
        said: State = {}
        for name, place in zip(("tip", *self._row), places.tolist(), strict=True):
            said.update(zip(_columns(name), place, strict=True))
        said[self.gripper] = float(self._values[int(self._closed)])
        return said | {name: flag(dict(said)) if callable(flag) else flag for name, flag in self.flags.items()}

    def push(self, force: ArrayLike, at: float = 0.0, duration: float = 0.2) -> None:
        """Push the tip with a force (3,) [N], from `at` seconds from now on."""
        newtons = as_point("force", force, "xyz")
        check_number("duration", duration, above=0.0)

        def add(sign: float) -> None:
            self._data.xfrc_applied[self._tip, :3] += sign * newtons

        self._schedule(at, lambda: add(1.0))
        self._schedule(at + duration, lambda: add(-1.0))

    def place(self, name: str, position: ArrayLike, at: float = 0.0) -> None:
        """Move an object, `at` seconds from now; out of the gripper, if it is held, and back, if it was gone."""
        row, place = self._row_of(name), as_point("position", position, "xyz")
        self._schedule(at, lambda: self._put(row, place))

    def remove(self, name: str, at: float = 0.0) -> None:
        """Take an object away, `at` seconds from now."""
        row = self._row_of(name)

        def take() -> None:
            self._put(row, np.zeros(3))
            self._gone[row] = True

        self._schedule(at, take)

    def run(self, movement: RobotMovement, watch: Watch | None = None) -> Run:
        """Execute a movement that passed its checks.

        Parameters
        ----------
        movement : RobotMovement
            Of this arm, from where its joints stand: `robots.move(..., start=simulation.joints)`.
        watch : callable, optional
            Called 100 times a second with the time since the movement began [s], below 0 in the approach, and the
            measured tip (3,). Where it returns True the arm brakes on its path and stands.

        Raises
        ------
        InfeasibleError
            A movement that did not pass its checks.
        SpecificationError
            One of another arm, or that begins elsewhere.
        """
        self._check(movement)
        course, stopped, failure = _course(movement.trajectory, self.gripper), None, None
        samples: list[_Sample] = []
        k = 0
        while k < len(course.joints) or self._moves(k - len(course.joints)):
            self._advance(course, min(k, len(course.joints) - 1))
            if k % _LOOKS == 0:
                samples.append(self._sample(k * _STEP - movement.begins))
                if watch is not None and stopped is None and k < len(course.joints):
                    try:
                        stop = watch(samples[-1].time, self._measured(samples[-1].tip))
                    except Exception as error:  # the arm stands before anyone hears of it
                        failure, stop = error, True
                    if stop:
                        stopped = samples[-1].time
                        ending = _course(brake(self.robot, movement.trajectory, k * _STEP), self.gripper)
                        course = _Course(*(np.concatenate((a[:k], b)) for a, b in zip(course, ending, strict=True)))
            self._mujoco.mj_step2(self._model, self._data)
            k += 1
        self._mujoco.mj_kinematics(self._model, self._data)
        if failure is not None:
            raise failure
        return _run_of(self.robot, samples, stopped, tuple(self._row))

    def _moves(self, after: int) -> bool:
        """Tell whether the arm is under way, so many steps after its last sample, or not yet at rest there."""
        off = np.abs(self.joints - self._data.qpos[: self.robot.n_joints]).max()
        return after * _STEP < (_SETTLES if off <= _STANDS else _LONGEST)

    def _check(self, movement: RobotMovement) -> None:
        """Refuse a movement that failed a check, of another arm, or that begins elsewhere."""
        if not isinstance(movement, RobotMovement):
            raise SpecificationError(f"expected a movement of robots.move to run, got {movement!r:.80}")
        preflight, sent = movement.preflight, movement.trajectory
        if not preflight.passed:
            failed = preflight.failed[0]
            raise InfeasibleError(
                f"expected a movement that passed its checks, {failed.what} of {failed.where} failed; plan it without "
                "force",
                preflight,
            )
        if sent.joints != self.robot.joints:
            raise SpecificationError(
                f"expected a movement of {', '.join(self.robot.joints)}, got one of {', '.join(sent.joints)}"
            )
        away = np.abs(sent.positions[0] - self.joints)
        if not away.max() <= _STANDS:
            j = int(np.argmax(away))
            raise SpecificationError(
                f"expected a movement that begins where the arm stands, {sent.joints[j]} at {self.joints[j]:.4g}, got "
                f"{sent.positions[0, j]:.4g}; plan it from there: move(..., start=simulation.joints)"
            )

    def _advance(self, course: _Course, k: int) -> None:
        """Let what is due happen, and push the joints towards sample k of a course: the first half of a step."""
        data, n = self._data, self.robot.n_joints
        while self._events and self._events[0][0] <= data.time + _STEP / 2:
            self._events.pop(0)[1]()
        self._mujoco.mj_step1(self._model, data)
        if not math.isnan(course.gripper[k]):
            open_away, closed_away = np.abs(self._values - course.gripper[k])
            self.grip(bool(closed_away < open_away))
        self.joints = course.joints[k]
        off, lag = self.joints - data.qpos[:n], course.velocities[k] - data.qvel[:n]
        wanted, needed = np.zeros((2, self._model.nv))
        wanted[:n] = course.accelerations[k] + _DAMPING * lag + _STIFFNESS * off
        self._mujoco.mj_mulM(self._model, data, needed, wanted)
        # As `np.clip`, which takes longer, a thousand times a second.
        data.qfrc_applied[:n] = np.minimum(np.maximum(needed[:n] + data.qfrc_bias[:n], -self._most), self._most)

    def _sample(self, time: float) -> _Sample:
        data, n = self._data, self.robot.n_joints
        effort = np.abs(data.qfrc_applied[:n]) / self._most
        return _Sample(
            time, data.qpos[:n].copy(), self.joints, data.xpos[self._tip].copy(), self._places(), float(effort.max())
        )

    def _measured(self, places: Array) -> Array:
        return places + self.noise * self._random.normal(size=places.shape)

    def _places(self) -> Array:
        """Positions (m, 3) of the objects, nan of those that are gone."""
        return np.where(self._gone[:, None], np.nan, self._data.xpos[self._objects])

    def grip(self, close: bool) -> None:
        """Close the gripper on the nearest object within reach, or open it."""
        if close == self._closed:
            return
        self._closed = close
        if not close:
            self._release()
            return
        away = np.linalg.norm(self._places() - self._data.xpos[self._tip], axis=1)
        if not (away <= self.reach).any():
            return
        row = self._held = int(np.nanargmin(away))
        body, weld = self._objects[row], self._model.eq_data[row]
        turn = self._data.xmat[self._tip].reshape(3, 3).T
        weld[:3], weld[10] = 0.0, 1.0
        weld[3:6] = turn @ (self._data.xpos[body] - self._data.xpos[self._tip])
        back = self._data.xquat[self._tip] * (1.0, -1.0, -1.0, -1.0)
        self._mujoco.mju_mulQuat(weld[6:10], back, self._data.xquat[body])
        self._data.eq_active[row], self._model.body_gravcomp[body] = True, 0.0

    def _release(self) -> None:
        """Let go of what is held: it rests where it is."""
        if self._held is not None:
            row, self._held = self._held, None
            self._data.eq_active[row], self._model.body_gravcomp[self._objects[row]] = False, 1.0
            self._data.qvel[self.robot.n_joints + 6 * row :][:6] = 0.0

    def _put(self, row: int, place: Array) -> None:
        if self._held == row:
            self._release()
        self._gone[row] = False
        at = self.robot.n_joints + 7 * row
        self._data.qpos[at : at + 7] = (*place, 1.0, 0.0, 0.0, 0.0)
        self._mujoco.mj_kinematics(self._model, self._data)

    def _schedule(self, at: float, event: Callable[[], None]) -> None:
        check_number("at", at, least=0.0)
        if at == 0:
            event()
            return
        self._events.append((self.time + at, event))
        self._events.sort(key=lambda due: due[0])

    def _row_of(self, name: str) -> int:
        if name not in self._row:
            raise SpecificationError(
                f"expected one of the objects {', '.join(self._row) or '(none)'}, got {name!r:.80}"
            )
        return self._row[name]


class _Sample(NamedTuple):
    time: float  # [s], since the movement began
    joints: Array  # (n,)
    sent: Array  # (n,)
    tip: Array  # (3,) [m]
    places: Array  # (m, 3) [m], of the objects
    effort: float  # largest share of a limit


class _Course(NamedTuple):
    """What is sent at each step of the simulation, K steps."""

    joints: Array  # (K, n)
    velocities: Array  # (K, n)
    accelerations: Array  # (K, n)
    gripper: Array  # (K,), nan where nothing is sent


def _course(trajectory: JointTrajectory, gripper: str) -> _Course:
    """Sample a trajectory at every step."""
    times = np.minimum(_STEP * np.arange(n_samples(trajectory.duration, 1.0 / _STEP)), trajectory.duration)
    sent = between(trajectory, times)
    steps = sent.steps.get(gripper, np.full(len(times), np.nan))
    return _Course(sent.positions, sent.velocities, sent.accelerations, steps)


def brake(robot: Robot, trajectory: JointTrajectory, at: float) -> JointTrajectory:
    """Stop on the path of a trajectory that is under way, as soon as accelerations and torques allow.

    The path is passed slower and slower: with ``x = t / r``, ``ds/dt = 1 - 3 x^2 + 2 x^3``, so it is left nowhere, and
    what was checked of it holds. r is the least of a series of seconds, each 1.25 times the one before, with which the
    limits hold; where the trajectory ends sooner than that, it is its remainder. The trajectory has passed its checks,
    and `at` [s] is its time at which the brake begins: time 0 of what is returned.
    """
    check_number("at", at, least=0.0, most=trajectory.duration)
    ramp, torques = _FIRST_RAMP, Torques(robot)
    while at + ramp / 2 < trajectory.duration:
        times = np.linspace(0.0, ramp, n_samples(ramp, 1.0 / _STEP))
        x = times / ramp
        speed, slowing = (1 - 3 * x**2 + 2 * x**3)[:, None], (6 * (x**2 - x) / ramp)[:, None]
        path = between(trajectory, at + ramp * (x - x**3 + x**4 / 2))
        v, a = speed * path.velocities, speed**2 * path.accelerations + slowing * path.velocities
        needed = (
            torques.of(*sample) for sample in zip(path.positions[::_LOOKS], v[::_LOOKS], a[::_LOOKS], strict=True)
        )
        if (np.abs(a) <= _SLACK * robot.acceleration).all() and not any(map(torques.exceeded, needed)):
            return replace(path, times=times, velocities=v, accelerations=a)
        ramp *= _LONGER
    times = np.append(np.arange(at, trajectory.duration - _STEP / 2, _STEP), trajectory.duration)
    return replace(between(trajectory, times), times=times - at)


def _run_of(robot: Robot, samples: list[_Sample], stopped: float | None, names: tuple[str, ...]) -> Run:
    times, joints, sent, tips, places, efforts = (np.array(column) for column in zip(*samples, strict=True))
    tip_error = np.linalg.norm(tips - kinematics(robot, sent)[0], axis=1).max()
    effort = math.nan if np.isnan(robot.effort).all() else efforts.max()
    objects = {name: places[:, row] for row, name in enumerate(names)}
    return Run(
        times, joints, sent, tips, objects, stopped, float(tip_error), float(np.abs(joints - sent).max()), float(effort)
    )


def _world(robot: Robot, n_objects: int) -> tuple[Any, Any, Any]:
    """Build the arm from the model that its checks use, and the objects; names of users are no part of it."""
    with needs("mujoco", "simulate an arm", "simulation"):
        import mujoco  # type: ignore[import-untyped, import-not-found, unused-ignore]
    import pinocchio

    spec = mujoco.MjSpec()
    spec.compiler.degree, spec.compiler.balanceinertia = False, True
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-3, 1e-6
    spec.option.timestep, spec.option.disableflags = _STEP, int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model, link = robot.model, spec.worldbody
    neutral, data = pinocchio.neutral(model), model.createData()
    pinocchio.computeJointJacobians(model, data, neutral)
    for j in range(1, model.njoints):
        axis = pinocchio.getJointJacobian(model, data, j, pinocchio.ReferenceFrame.LOCAL)[:, j - 1]
        slides = bool(axis[:3].any())
        link = link.add_body(**_pose(model.jointPlacements[j]))
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        stops = [robot.lower[j - 1], robot.upper[j - 1]]
        link.add_joint(type=kind, axis=axis[:3] if slides else axis[3:], limited=True, range=stops, solref_limit=_STIFF)
        inertia = model.inertias[j]
        (xx, xy, xz), (_, yy, yz), (*_, zz) = inertia.inertia
        link.mass, link.ipos, link.fullinertia = inertia.mass, inertia.lever, [xx, yy, zz, xy, xz, yz]
        link.explicitinertial = True
    frame = model.frames[model.getFrameId(robot.tip)]
    link.add_body(name="tip", **_pose(frame.placement))
    for row in range(n_objects):
        body = spec.worldbody.add_body(name=f"object {row}", gravcomp=1.0)
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[_RADIUS, 0, 0], mass=_MASS)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="tip", name2=f"object {row}",
            active=False, solref=_STIFF,
        )  # fmt: skip
    compiled = spec.compile()
    return compiled, mujoco.MjData(compiled), mujoco


def _pose(placement: Any) -> dict[str, Array]:
    """Position and quaternion w, x, y, z of a placement of Pinocchio, as MuJoCo has them."""
    return {"pos": placement.translation, "quat": quaternion_of(placement.rotation)}


def _columns(name: str) -> list[str]:
    return [f"{name}_{axis}" for axis in "xyz"]
