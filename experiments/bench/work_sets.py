"""Simulated arms at work with known truth: reach, grasp, carry, pour, wipe and press, as teleoperation records them.

The path of the tip is composed of movements of least jerk. kineme's Panda follows it in MuJoCo kinematically: resolved
rates (one step of damped least squares in each sample) from MuJoCo's forward kinematics and Jacobians, no dynamics, so
that an hour of one arm takes some 20 s. The third joint is held: six joints and a gripper are seven channels. What a
real arm adds is put on top: the follower's lag (two first orders), offset and quantization, tremor and drift of the
operator's hand, hesitations, pauses and overshoot. Of two arms the right one works; the left one steadies: it drifts,
and moves a little along.

Truth is what the script says, in the time of the follower: (start, end, name). Between movements the arm rests or opens
its fingers, which has no name. A reach goes to a thing, or back home, with empty fingers.
"""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.episodes import Episode

Array = NDArray[np.float64]

KINDS = ("reach", "grasp", "carry", "pour", "wipe", "press")
FPS = 50.0
STATE, ACTION, TIP = "observation.state", "action", "observation.tip"
OBJECTS, CONTACT = "observation.environment_state", "observation.contact"
#: Task -> movements before, movements that repeat, how often at least and at most, movements after.
TASKS = {
    "put the cubes into the box": ("", "reach grasp carry release", (4, 6), "home"),
    "pour water into the bowls": ("reach grasp", "carry pour", (3, 5), "carry release home"),
    "wipe the table": ("reach grasp", "carry wipe", (3, 5), "carry release home"),
    "press the buttons": ("", "reach press", (7, 11), "home"),
    "make tea": ("reach grasp carry pour carry release", "reach press", (3, 5), "home"),
}
_HELD_JOINT = 2
_MOVED = np.array([0, 1, 3, 4, 5, 6])
_READY = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.785])  # [rad]
_HOME = np.array([0.40, 0.0, 0.32, 0.0, 0.0, 0.9])  # x, y, z [m], yaw, tilt [rad], opening of the gripper [1]
_ABOVE, _TABLE, _POURED = 0.11, 0.03, 0.24  # heights of the tip [m]
_FLIPPED = 0.6  # [rad], between the joints at the end and those at the beginning
_STEP = 2.0 * np.pi / 4096  # quantization of joint sensors [rad]
_OPEN = 0.65  # more than half of the way from the opening at a held thing to that of empty fingers
_N_OBJECTS = 3
_PER_SHARD = 50_000  # frames


@dataclass(frozen=True)
class Operator:
    """Style of a person at the leader arm."""

    tempo: float  # times faster than usual
    pause: float  # mean rest between movements [s]
    hesitations: float  # expected in a movement
    tremor: float  # of the hand, at the joints [rad]
    arc: float  # height of the way over the straight line, in its length
    overshoot: float  # beyond the goal, in the length of the way
    yaw: float  # of the fingers [rad]
    tilt: float  # of a vessel that is poured [rad]
    stroke: float  # length of a stroke when wiping [m]
    round: float  # width of a stroke, in its length: 0 is there and back on a line
    deep: float  # way down of a press [m]


@dataclass(frozen=True, eq=False)
class Rig:
    """Leader and follower of one data set."""

    lag: float  # of the follower [s]
    offset: Array  # of the follower's joints (6,) [rad]


class Work(NamedTuple):
    """One episode and its truth."""

    episode: Episode
    truth: tuple[tuple[float, float, str], ...]  # start, end [s], name
    operator: int


def operator(number: int) -> Operator:
    """Draw a style; the same number is the same person everywhere."""
    rng = np.random.default_rng([77, number])
    return Operator(
        tempo=rng.uniform(0.75, 1.3), pause=rng.uniform(0.1, 0.5), hesitations=rng.uniform(0.0, 0.25),
        tremor=rng.uniform(0.0006, 0.002), arc=rng.uniform(0.05, 0.25), overshoot=rng.uniform(0.0, 0.05),
        yaw=rng.uniform(-0.4, 0.4), tilt=rng.uniform(1.3, 1.8), stroke=rng.uniform(0.12, 0.22),
        round=rng.uniform(0.0, 0.5), deep=rng.uniform(0.05, 0.08),
    )  # fmt: skip


def rig(seed: int) -> Rig:
    """Draw the lag and the offsets of a data set."""
    rng = np.random.default_rng([78, seed])
    return Rig(rng.uniform(0.05, 0.12), rng.normal(scale=0.01, size=len(_MOVED)))


def work_episodes(
    count: int,
    seed: int = 0,
    operators: Sequence[int] = (0, 1, 2, 3),
    arms: int = 1,
    tasks: Sequence[str] = tuple(TASKS),
    steps: bool = False,
) -> Iterator[Work]:
    """Yield clean episodes, tasks and operators in turn; each depends on the seed and its number alone.

    With `steps` the gripper is 0 or 1, as grippers are that only open and close.
    """
    setup = rig(seed)
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        task = tasks[number % len(tasks)]
        person = operators[(number // len(tasks)) % len(operators)]
        work = _episode(number, task, person, setup, arms, rng)
        yield work._replace(episode=_stepped(work.episode)) if steps else work


def _stepped(episode: Episode) -> Episode:
    """Return the episode with grippers that are 1 where they are open by more than half of the way to what is held."""
    signals = dict(episode.signals)
    for key in (STATE, ACTION):
        is_gripper = np.array(["gripper" in name for name in episode.names[key]])
        signals[key] = np.where(is_gripper, signals[key] > _OPEN, signals[key])
    return replace(episode, signals=signals)


def examples(works: Iterable[Work], each: int = 3, seed: int = 0) -> list[tuple[int, float, float, str]]:
    """List (episode, start, end, name) of some movements of each kind, drawn at random, operators in turn."""
    rows = [(work.operator, (work.episode.number, *row)) for work in works for row in work.truth]
    np.random.default_rng([81, seed]).shuffle(rows)
    chosen: list[tuple[int, float, float, str]] = []
    for kind in KINDS:
        seen: Counter[int] = Counter()
        turns = []
        for person, row in rows:
            if row[3] == kind:
                turns.append((seen[person], row))
                seen[person] += 1
        chosen += [row for _, row in sorted(turns, key=itemgetter(0))[:each]]
    return sorted(chosen)


def write_labels(path: Path, rows: Iterable[tuple[int, float, float, str]]) -> None:
    """Write (episode, start, end, name) as the table that ``kineme learn --labels`` takes."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("recording", "place", "start", "end", "label"))
        writer.writerows(("", f"episode {k}", f"{a:.3f}", f"{b:.3f}", name) for k, a, b, name in rows)


def write_set(folder: Path, episodes: Iterable[Episode], features: Sequence[str] = (STATE, ACTION)) -> Path:
    """Write episodes as a data set of LeRobot 3.0, a shard for each 50,000 frames; memory holds one shard."""
    import pyarrow as pa
    from pyarrow import parquet

    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    tasks: dict[str, int] = {}
    names: dict[str, tuple[str, ...]] = {}
    lengths, shards, named, shard, total = [], [], [], [], 0

    def flush(number: int) -> None:
        parquet.write_table(pa.concat_tables(shard), folder / "data" / "chunk-000" / f"file-{number:03d}.parquet")
        shard.clear()

    for at, episode in enumerate(episodes):
        n, task = len(episode), tasks.setdefault(episode.task or "", len(tasks))
        names |= {key: episode.names[key] for key in features}
        columns: dict[str, Any] = {}
        for key in features:
            values = np.ascontiguousarray(episode.signals[key], np.float32)
            columns[key] = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
        columns |= {
            "timestamp": episode.times.astype(np.float32), "frame_index": np.arange(n), "episode_index": np.full(n, at),
            "index": total + np.arange(n), "task_index": np.full(n, task),
        }  # fmt: skip
        shards.append(shards[-1] if shards else 0)
        if sum(map(len, shard)) >= _PER_SHARD:
            flush(shards[-1])
            shards[-1] += 1
        shard.append(pa.table(columns))
        lengths.append(n)
        named.append(episode.task or "")
        total += n
    flush(shards[-1])
    ends = np.cumsum(lengths)
    table = {
        "episode_index": np.arange(len(lengths)), "tasks": [[task] for task in named], "length": np.array(lengths),
        "data/chunk_index": np.zeros(len(lengths), np.int64), "data/file_index": np.array(shards),
        "dataset_from_index": ends - lengths, "dataset_to_index": ends,
    }  # fmt: skip
    parquet.write_table(pa.table(table), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    rows = {"task_index": np.arange(len(tasks)), "task": list(tasks)}
    parquet.write_table(pa.table(rows), folder / "meta" / "tasks.parquet")
    vectors = {key: {"dtype": "float32", "shape": [len(names[key])], "names": list(names[key])} for key in features}
    counters = {
        key: {"dtype": "int64", "shape": [1], "names": None}
        for key in ("frame_index", "episode_index", "index", "task_index")
    }
    info = {
        "codebase_version": "v3.0", "robot_type": "panda", "fps": round(FPS), "total_episodes": len(lengths),
        "total_frames": total, "total_tasks": len(tasks), "chunks_size": 1000, "splits": {"train": f"0:{len(lengths)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "video_path": None,
        "features": vectors | {"timestamp": {"dtype": "float32", "shape": [1], "names": None}} | counters,
    }  # fmt: skip
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    return folder


class _Script:
    """Path of the leader's tip as it is composed, movement by movement; rows are x, y, z, yaw, tilt, opening."""

    def __init__(self, style: Operator, rng: np.random.Generator):
        self.style, self.rng = style, rng
        self.things = np.empty((0, 3))
        for _ in range(_N_OBJECTS):
            self.things = np.vstack((self.things, np.append(self.free_place(), _TABLE)))
        self.parts: list[Array] = []
        self.contact: list[Array] = []
        self.objects: list[Array] = []
        self.truth: list[tuple[float, float, str]] = []
        self.pose: Array = _HOME + np.append(rng.normal(scale=0.015, size=3), [style.yaw, 0.0, 0.0])
        self.held: int | None = None
        self.hold(rng.uniform(0.3, 1.0))

    @property
    def now(self) -> float:
        return sum(map(len, self.parts)) / FPS

    def add(self, part: Array, contact: float = 0.0) -> None:
        self.parts.append(part)
        self.contact.append(np.full(len(part), contact))
        things = np.repeat(self.things[None], len(part), axis=0)
        if self.held is not None:
            things[:, self.held] = part[:, :3]
            self.things[self.held] = part[-1, :3]
        self.objects.append(things.reshape(len(part), -1))
        self.pose = part[-1].copy()

    def hold(self, seconds: float) -> None:
        if round(seconds * FPS):
            self.add(np.repeat(self.pose[None], round(seconds * FPS), axis=0), float(self.held is not None))

    def go(self, seconds: float, arc: float = 0.0, overshoot: float = 0.0, contact: float = 0.0, **goal: float) -> None:
        """Move with least jerk to a goal, in some entries of the pose, with hesitations."""
        rng, end = self.rng, self.pose.copy()
        for name, value in goal.items():
            end[("x", "y", "z", "yaw", "tilt", "opening").index(name)] = value
        seconds *= rng.uniform(0.85, 1.2) / self.style.tempo
        u = np.linspace(0.0, 1.0, max(3, round(seconds * FPS)))
        if seconds > 0.6 and rng.random() < self.style.hesitations:  # the hand all but stops on the way
            at, width = rng.uniform(0.3, 0.7), rng.uniform(0.1, 0.25)
            u = np.linspace(0.0, 1.0, round(len(u) * (1.0 + 1.5 * width)))
            speed = 1.0 - 0.9 * np.exp(-0.5 * ((u - at) / (0.5 * width)) ** 2)
            u = np.cumsum(speed) - speed[0]
            u /= u[-1]
        s = (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))[:, None]
        path = self.pose + (end - self.pose) * s
        way = end[:3] - self.pose[:3]
        path[:, 2] += arc * np.linalg.norm(way) * np.sin(np.pi * s[:, 0]) ** 2
        path[:, :3] += overshoot * way * (u**4 * (1.0 - u))[:, None] * 12.0
        self.add(path[1:], contact)

    def do(self, word: str) -> None:
        begin = self.now
        getattr(self, f"_{word}")()
        if word != "release":
            self.truth.append((begin, self.now - 1.0 / FPS, {"home": "reach"}.get(word, word)))
        if self.rng.random() < 0.75:
            self.hold(self.rng.exponential(self.style.pause))

    def _above(self, place: Array, height: float) -> dict[str, float]:
        return {
            "x": float(place[0]),
            "y": float(place[1]),
            "z": height,
            "yaw": self.style.yaw + self.rng.normal(scale=0.1),
        }

    def free_place(self, pose: Array | None = None) -> Array:
        """Draw a place on the table (2,), away from things and the tip."""
        others = self.things[:, :2] if pose is None else np.vstack((self.things[:, :2], pose[:2]))
        while True:
            place = np.array([self.rng.uniform(0.36, 0.60), self.rng.uniform(-0.30, 0.30)])
            if len(others) == 0 or np.linalg.norm(others - place, axis=1).min() > 0.11:
                return place

    def _seconds(self, place: Array, height: float) -> float:
        return 0.7 + 1.8 * float(np.linalg.norm(np.append(place, height) - self.pose[:3]))

    def _reach(self) -> None:
        away = np.linalg.norm(self.things[:, :2] - self.pose[:2], axis=1)
        self.target = int(self.rng.choice(np.flatnonzero(away > min(0.1, away.max() - 1e-9))))
        place, height = self.things[self.target, :2], _TABLE + _ABOVE
        seconds = self._seconds(place, height)
        self.go(seconds, self.style.arc, self.style.overshoot, opening=0.9, **self._above(place, height))

    def _home(self) -> None:
        away = self.rng.normal(scale=0.02, size=3)
        home = dict(zip("xyz", _HOME[:3] + away, strict=True))
        self.go(self._seconds(_HOME[:2], _HOME[2]), 0.3 * self.style.arc, yaw=self.style.yaw, opening=0.9, **home)

    def _grasp(self) -> None:
        self.go(0.8, z=_TABLE)
        self.go(0.4, opening=self.rng.uniform(0.3, 0.45), contact=1.0)
        self.held = self.target

    def _carry(self) -> None:
        place = self.free_place(self.pose)
        height = {"pour": _POURED, "wipe": _TABLE, "release": _TABLE + 0.02}[self.next]
        arc = 0.35 + self.style.arc
        self.go(0.4 + self._seconds(place, height), arc, self.style.overshoot, 1.0, **self._above(place, height))

    def _release(self) -> None:
        self.go(0.35, opening=0.9)
        self.held = None

    def _pour(self) -> None:
        tilt = self.style.tilt * self.rng.uniform(0.9, 1.1)
        self.go(1.0, contact=1.0, tilt=tilt, z=self.pose[2] + 0.03)
        self.hold(self.rng.uniform(0.3, 1.2))
        self.go(0.8, contact=1.0, tilt=0.0, z=self.pose[2] - 0.03)

    def _wipe(self) -> None:
        style, rng = self.style, self.rng
        strokes, seconds = int(rng.integers(3, 6)), rng.uniform(0.7, 1.0) / style.tempo
        t = np.arange(1, round(strokes * seconds * FPS) + 1) / (seconds * FPS)
        ends = np.clip(np.minimum(t, t[-1] - t) / 0.3, 0.0, 1.0)  # grows and fades within a third of a stroke
        ends = ends**2 * (3.0 - 2.0 * ends)
        angle, size = rng.normal(scale=0.3), style.stroke * rng.uniform(0.85, 1.15)
        along = 0.5 * size * np.sin(2.0 * np.pi * t) * ends
        across = style.round * size * 0.5 * (np.cos(2.0 * np.pi * t) - 1.0) * ends + 0.01 * t
        path = np.repeat(self.pose[None], len(t), axis=0)
        path[:, 0] += along * np.sin(angle) + across * np.cos(angle)
        path[:, 1] += along * np.cos(angle) - across * np.sin(angle)
        self.add(path, 1.0)

    def _press(self) -> None:
        deep, top = self.style.deep * self.rng.uniform(0.9, 1.1), self.pose[2]
        self.go(0.5, z=top - deep)
        self.hold(self.rng.uniform(0.1, 0.4))
        self.go(0.5, z=top)

    next = "release"


def _script(task: str, style: Operator, rng: np.random.Generator) -> _Script:
    """Compose an episode, from home to home."""
    before, again, (least, most), after = TASKS[task]
    words = [*before.split(), *again.split() * int(rng.integers(least, most + 1)), *after.split()]
    script = _Script(style, rng)
    for word, following in zip(words, [*words[1:], "release"], strict=True):
        script.next = following
        script.do(word)
    script.hold(rng.uniform(0.3, 1.0))
    return script


def _episode(number: int, task: str, person: int, setup: Rig, arms: int, rng: np.random.Generator) -> Work:
    style = operator(person)
    script = _script(task, style, rng)
    path = np.concatenate(script.parts)
    joints = _followed(path)
    while np.abs(joints[-1] - joints[0]).max() > _FLIPPED:  # beyond a singularity of the wrist: nobody works so
        script = _script(task, style, rng)
        path = np.concatenate(script.parts)
        joints = _followed(path)
    ways = [np.column_stack((joints, path[:, 5]))]
    if arms == 2:
        along = _READY[_MOVED] + 0.06 * _delayed(joints - joints[0], 0.6)
        ways.append(np.column_stack((along, np.full(len(path), 0.5))))
    leader = [way + _shaken(way.shape, style.tremor, rng) for way in ways]
    offset = np.append(setup.offset, 0.01)
    state = np.column_stack([_delayed(side, setup.lag) + offset for side in leader])
    state, action = np.round(state / _STEP) * _STEP, np.round(np.column_stack(leader) / _STEP) * _STEP
    sides = ("right_", "left_") if arms == 2 else ("",)
    names = tuple(f"{side}{name}.pos" for side in sides for name in (*(f"joint{k + 1}" for k in _MOVED), "gripper"))
    signals = {
        STATE: state, ACTION: action, TIP: _tips(state[:, : len(_MOVED)]),
        OBJECTS: np.concatenate(script.objects), CONTACT: np.concatenate(script.contact)[:, None],
    }  # fmt: skip
    entries = {
        STATE: names, ACTION: names, TIP: ("x", "y", "z"), CONTACT: ("contact",),
        OBJECTS: tuple(f"object{k}.{axis}" for k in range(_N_OBJECTS) for axis in "xyz"),
    }  # fmt: skip
    times = np.arange(len(path)) / FPS
    truth = tuple((begin + setup.lag, min(end + setup.lag, times[-1]), name) for begin, end, name in script.truth)
    return Work(Episode(number, times, signals, entries, task, FPS), truth, person)


def _shaken(shape: tuple[int, ...], tremor: float, rng: np.random.Generator) -> Array:
    """Tremor of 5 to 10 Hz and slow drift of the hand, at the joints (T, d)."""
    from scipy.signal import butter, sosfilt

    noise = rng.normal(size=(shape[0] + 200, shape[1]))
    fast = sosfilt(butter(2, (5.0, 10.0), "bandpass", fs=FPS, output="sos"), noise, axis=0)[200:]
    slow = sosfilt(butter(2, 0.5, fs=FPS, output="sos"), noise, axis=0)[200:]
    return tremor * (fast / 0.4 + 2.0 * slow / 0.15)


def _delayed(values: Array, lag: float) -> Array:
    """Two first orders in a row, of half the lag each: what follows slow motion `lag` seconds later (T, d)."""
    from scipy.signal import lfilter, lfiltic

    keep = np.exp(-1.0 / (FPS * 0.5 * lag))
    for _ in range(2):
        start = np.stack([lfiltic([1.0 - keep], [1.0, -keep], [first]) for first in values[0]], axis=1)
        values = lfilter([1.0 - keep], [1.0, -keep], values, axis=0, zi=start)[0]
    return np.asarray(values)


@cache
def _panda() -> tuple[Any, Any, int]:
    import mujoco

    from kineme.robots import load

    robot = load("panda")
    extra = '<mujoco><compiler fusestatic="false" balanceinertia="true" boundmass="1e-3" boundinertia="1e-6"/></mujoco>'
    model = mujoco.MjModel.from_xml_string(robot.source.read_text().replace("</robot>", f"{extra}</robot>"))
    return model, mujoco.MjData(model), mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot.tip)


def _turned(yaw: Array, tilt: Array) -> Array:
    """Rotations (T, 3, 3) of fingers that point down, turned about the vertical, then tilted about their own x axis."""
    from scipy.spatial.transform import Rotation

    return (Rotation.from_euler("z", yaw[:, None]) * Rotation.from_euler("x", np.pi + tilt[:, None])).as_matrix()


def _followed(path: Array) -> Array:
    """Joints (T, 6) whose tip follows a path (T, 6), by resolved rates with a pull towards the middle of the joints."""
    import mujoco

    model, data, tip = _panda()
    turns, joints = _turned(path[:, 3], path[:, 4]), np.empty((len(path), len(_MOVED)))
    shift, turn, error = np.zeros((3, model.nv)), np.zeros((3, model.nv)), np.empty(6)
    low, high = model.jnt_range[_MOVED].T
    data.qpos[:] = _READY
    for k in range(-100, len(path)):  # the first pose is sought in a hundred steps
        at = max(k, 0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacBody(model, data, shift, turn, tip)
        error[:3] = path[at, :3] - data.xpos[tip]
        now, aim = data.xmat[tip].reshape(3, 3), turns[at]
        skew = aim @ now.T
        error[3:] = 0.5 * np.array([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])
        jacobian = np.vstack((shift[:, _MOVED], turn[:, _MOVED]))
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), error)
        data.qpos[_MOVED] = np.clip(data.qpos[_MOVED] + np.clip(step, -0.1, 0.1), low, high)
        joints[at] = data.qpos[_MOVED]
    return joints


def _tips(joints: Array) -> Array:
    """Positions (T, 3) of the tip at joints (T, 6)."""
    import mujoco

    model, data, tip = _panda()
    tips = np.empty((len(joints), 3))
    for k, values in enumerate(joints):
        data.qpos[_MOVED] = values
        mujoco.mj_kinematics(model, data)
        tips[k] = data.xpos[tip]
    return tips
