"""Executions that are watched: how many alarms are false, and which disturbances are noticed before the half.

Of each symbol a monitor is made of the movements of all people but one, whose movements are then executed: as they are,
and disturbed from a time in the first third on. Chosen on strokes and digits, reported on the others. `same person` has
the other repetitions by the same person instead, at an error rate of 10 %, since there are fewer than 19; `robot` the
primitives of these, carried to another start and goal, which a robot executes with noise of a thousandth of the size.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.people import Recorded, recorded
from bench.rows import Row
from bench.space import lifted
from kineme.recognition.monitor import Monitor, corridor

CHOSEN = ("strokes2d", "digits")
ERROR_RATE, OF_FEW = 0.05, 0.1
BEGINS = (0.1, 0.33)  # of the time
PUSH, PUSHED = (0.1, 0.2), (0.15, 0.3)  # of the size, the diagonal of the box around the movement; and of the time
OTHER_GOAL = (0.3, 0.6)  # of the size
FREQUENCY = 12.5  # per duration: how fast a critically damped movement turns to another goal
NOISE = 1e-3  # of the size, of what a robot measures
MOST = 30  # pairs of a symbol and a person, at most
DISTURBED = ("pushed", "another goal", "another symbol")

Path = NDArray[np.float64]


class Executed(NamedTuple):
    """Times and positions, and the share of the time from which they are disturbed."""

    times: Path
    positions: Path
    begins: float = 0.0


def measure(quick: bool) -> list[Row]:
    sets = {
        name: data
        for name in ("strokes2d", "multistrokes2d", "signs2d", "letters2d")
        if (data := recorded(f"{name}.npz"))
    }
    if (gestures := recorded("gestures3d.npz")) is not None:
        digits = np.char.isdigit(gestures.labels)
        sets |= {"digits": gestures.take(digits), "solids": gestures.take(~digits)}
    rows = []
    for name, data in sets.items():
        most = 4 if quick else MOST
        if name != "letters2d":
            rows += _rows(name, data, "others", ERROR_RATE, _by_others(data, most))
        if name in ("letters2d", "strokes2d", "digits"):
            rows += _rows(name, data, "same person", OF_FEW, _by_the_same(data, most))
            rows += _rows(name, data, "robot", OF_FEW, _by_a_robot(data, most))
    alarms = [row for row in rows if row.details["templates"] == "others" and row.details["what"] == "false alarms"]
    if alarms:
        numbers = [(row.ours, row.details["executions"]) for row in alarms]
        raised = [k < round(share * n) for share, n in numbers for k in range(n)]
        rows.append(_row("all sets, others", "false alarms", raised, {"templates": "others", "error rate": ERROR_RATE}))
    return rows + _cost(quick)


def _by_others(data: Recorded, most: int) -> Iterator[tuple[Monitor, Any, Any]]:
    """(monitor, indices of the movements to execute, their demonstrations); one fifth where people are not told."""
    people = data.people
    if len(np.unique(people)) == 1:
        people = np.arange(len(people)) % 5
    pairs = [(label, person) for label in np.unique(data.labels) for person in np.unique(people)]
    for label, person in [pairs[k] for k in np.random.default_rng(0).permutation(len(pairs))[:most]]:
        own, shown = (np.flatnonzero((data.labels == label) & mine) for mine in (people == person, people != person))
        groups = None if people is not data.people else people[shown].tolist()
        if len(own) and len(shown):
            yield Monitor.of(data.demos[shown], groups, error_rate=ERROR_RATE), own, data.demos


def _by_the_same(data: Recorded, most: int) -> Iterator[tuple[Monitor, Any, Any]]:
    for rows in _repetitions(data, most):
        for k, left_out in enumerate(rows[:4]):
            yield Monitor.of(data.demos[np.delete(rows, k)], error_rate=OF_FEW), [left_out], data.demos


def _by_a_robot(data: Recorded, most: int) -> Iterator[tuple[Monitor, Any, Any]]:
    random = np.random.default_rng(0)
    for rows in _repetitions(data, most):
        primitives = kineme.DMP().learn(data.demos[rows])
        for k in range(4):
            start, goal = primitives.starts[k], primitives.goals[k]
            goal = goal + 0.2 * np.linalg.norm(primitives.extents[k]) * random.standard_normal(len(goal))
            paths = primitives.rollout(start, goal).positions
            noisy = paths[k] + NOISE * np.linalg.norm(primitives.extents[k]) * random.standard_normal(paths[k].shape)
            shown = corridor(np.delete(paths, k, axis=0), None, OF_FEW, relative=False)
            yield Monitor(shown), [0], kineme.Demonstrations.from_arrays([noisy])


def _repetitions(data: Recorded, most: int) -> list[Any]:
    """Indices of each person's movements of a symbol, where they are ten or more."""
    pairs = [
        rows
        for label in np.unique(data.labels)
        for person in np.unique(data.people)
        if len(rows := np.flatnonzero((data.labels == label) & (data.people == person))) >= 10
    ]
    return [pairs[k] for k in np.random.default_rng(0).permutation(len(pairs))[:most]]


def _rows(name: str, data: Recorded, templates: str, error_rate: float, monitors: Any) -> list[Row]:
    random = np.random.default_rng(1)
    shares: dict[str, list[bool]] = defaultdict(list)
    for monitor, rows, demos in monitors:
        for movement in (demos[int(k)] for k in rows):
            left, ended, _ = _watched(monitor, Executed(movement.times, movement.positions))
            shares["false alarms"].append(left)
            shares["wrong ends"].append(not ended)
            other = data.demos[int(random.choice(len(data.labels)))]
            for what, executed in _disturbed(movement, other, random).items():
                left, ended, early = _watched(monitor, executed)
                shares[what].append(not ended if what == "stopped" else left and early)
            shares["any"] += [shares[what][-1] for what in DISTURBED]
    role = "chosen on" if name in CHOSEN else "reported"
    details = {"name": name, "templates": templates, "error rate": error_rate, "role": role}
    return [_row(f"{name}, {templates}", what, values, details) for what, values in shares.items()]


def _row(name: str, what: str, values: list[bool], details: dict[str, Any]) -> Row:
    """The share of executions; of false alarms beside the error rate, which they are to keep within a third."""
    share, details = float(np.mean(values)), details | {"what": what, "executions": len(values)}
    named = f"{name}, {'disturbances noticed before half' if what == 'any' else what}"
    if what == "false alarms":
        off = abs(share / details["error rate"] - 1.0)
        return Row(named, "of 1", share, ratio=off, target=("<=", 1 / 3), details=details)
    return Row(named, "of 1", share, target=(">=", 0.9) if what in {"any", "stopped"} else None, details=details)


def _watched(monitor: Monitor, executed: Executed) -> tuple[bool, bool, bool]:
    """Whether it left what was shown, whether it ended as such movements do, and whether it left before the half."""
    monitor.reset()
    since = monitor.update(executed.times, executed.positions).since
    half = executed.times[0] + 0.5 * (executed.times[-1] - executed.times[0])
    return not np.isnan(since), monitor.finish().ended, bool(since <= half)


def _disturbed(movement: Any, other: Any, random: np.random.Generator) -> dict[str, Executed]:
    """The movement pushed aside for a while, on its way to another goal, going on as another one, and stopped."""
    t, x = movement.times, movement.positions
    u = (t - t[0]) / (t[-1] - t[0])
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    begins = random.uniform(*BEGINS)
    since = np.clip(u - begins, 0.0, None)
    lasts = random.uniform(*PUSHED)
    k = int(np.searchsorted(u, begins + lasts / 2))
    aside = _across(x[min(k + 2, len(x) - 1)] - x[max(k - 2, 0)], random)
    bump = random.uniform(*PUSH) * size * np.sin(np.pi * np.clip(since / lasts, 0.0, 1.0)) ** 2
    turned = 1.0 - (1.0 + FREQUENCY * since) * np.exp(-FREQUENCY * since)
    goal = random.uniform(*OTHER_GOAL) * size * _across(np.zeros(x.shape[1]), random)
    v = (other.times - other.times[0]) / (other.times[-1] - other.times[0])
    like = np.column_stack([np.interp(u, v, column) for column in other.positions.T])
    like *= size / np.linalg.norm(np.ptp(like, axis=0))
    first = int(np.searchsorted(u, begins))
    going_on = np.where((u >= begins)[:, None], x[first] + like - like[first], x)
    return {
        "pushed": Executed(t, x + bump[:, None] * aside, begins),
        "another goal": Executed(t, x + turned[:, None] * goal, begins),
        "another symbol": Executed(t, going_on, begins),
        "stopped": Executed(t[: max(first, 2)], x[: max(first, 2)], begins),
    }


def _across(direction: Path, random: np.random.Generator) -> Path:
    """A random unit vector, perpendicular to a direction."""
    length = np.linalg.norm(direction)
    vector = random.standard_normal(len(direction))
    if length > 0:
        vector -= (vector @ direction) / length**2 * direction
    return vector / np.linalg.norm(vector)


def _cost(quick: bool) -> list[Row]:
    """Processor time of an update in space, in movements of 100 samples and of 1000."""
    shown = lifted(kineme.load_lasa(["GShape"]))
    began = time.process_time()
    monitor = Monitor.of(shown)
    rows = [Row("making a monitor of 7 demonstrations in space", "s", time.process_time() - began)]
    for n in (100,) if quick else (100, 1000):
        took = []
        for movement in shown:
            times = np.linspace(movement.times[0], movement.times[-1], n)
            samples = np.column_stack([np.interp(times, movement.times, x) for x in movement.positions.T])
            monitor.reset()
            for t, x in zip(times.tolist(), samples, strict=True):
                began = time.process_time()
                monitor.update(t, x)
                took.append(time.process_time() - began)
        took = took[n:]
        named = f"an update in space, {n} samples a movement"
        rows += [
            Row(f"{named}, mean", "us", 1e6 * float(np.mean(took)), target=("<=", 100.0)),
            Row(f"{named}, 99 of 100 within", "us", 1e6 * float(np.percentile(took, 99))),
        ]
    return rows
