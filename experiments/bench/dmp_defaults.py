"""What `fit` and `n_basis` of `DMP` cost and give: replay, new goals, recognition, with and without noise.

The default is chosen on every other shape of LASA; docs/guide/moving-again.md shows the rest.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from sklearn.model_selection import StratifiedShuffleSplit, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC

from bench.movements import Array
from bench.rows import Row
from kineme import DMP, Demonstrations, DMPFeatures, load_lasa
from kineme.kernels import RBF

RATE = 100.0  # Hz, of the sensor
FAR = 0.3  # of the extent, by which goals move
SHOTS, DRAWS, SEED = 2, 4, 0
EXACT = 0.1  # % of the extent: less than sensors tell
N_TIMED = 15


@dataclass(frozen=True)
class Sensor:
    """What a sensor does to a movement: noise [share of the extent], time stamps off by a share of the interval."""

    noise: float
    jitter: float


QUIET, NOISY = "as recorded", "1 % noise, uneven stamps"
SENSORS = {QUIET: Sensor(0.0, 0.0), "0.3 % noise": Sensor(0.003, 0.0), NOISY: Sensor(0.01, 0.4)}
UNITS = {
    "error, mean": "%",
    "error, worst": "%",
    "acceleration to new goals": "times",
    "1-NN": "accuracy",
    "SVM": "accuracy",
}
CANDIDATES = {
    **{f"forcing, {n}": DMP(fit="forcing", n_basis=n) for n in (20, 40, 80)},
    **{f"forcing by ridge, {n}": DMP(fit="forcing", n_basis=n, regression="ridge") for n in (20, 40, 80)},
    **{f"trajectory, {n}": DMP(fit="trajectory", n_basis=n) for n in (20, 30, 40, 60, 80)},
}


def measure(quick: bool) -> list[Row]:
    rows = []
    for half, demos in halves(load_lasa()).items():
        for name, dmp in CANDIDATES.items():
            for sensor, changes in SENSORS.items():
                for what, value in figures(dmp, demos[::2] if quick else demos, changes).items():
                    rows.append(Row(f"{half}: {name}; {sensor}; {what}", UNITS[what], value))
    rows += [Row(f"{name}; learned per second", "/s", speed(dmp)) for name, dmp in CANDIDATES.items()]
    measured = {row.what: row.ours for row in rows}
    rows.append(Row(f"chosen: {chosen(measured)}", "", CANDIDATES[chosen(measured)] == DMP(), target=(">=", 1.0)))
    return rows


def halves(demos: Demonstrations) -> dict[str, Demonstrations]:
    """Every other shape, and the rest; LASA has seven demonstrations of each."""
    shape = np.arange(len(demos)) // 7
    return {"chosen on": demos[shape % 2 == 0], "reported on": demos[shape % 2 == 1]}


def chosen(measured: dict[str, float]) -> str:
    """Of the candidates that replay every movement to `EXACT`, the one with the least acceleration under noise."""
    exact = [name for name in CANDIDATES if measured[f"chosen on: {name}; {QUIET}; error, worst"] <= EXACT]
    return min(exact, key=lambda name: measured[f"chosen on: {name}; {NOISY}; acceleration to new goals"])


def figures(dmp: DMP, demos: Demonstrations, sensor: Sensor) -> dict[str, float]:
    """Error of the replay, hardest acceleration on the way to new goals, accuracy of two classifiers; see `UNITS`."""
    measured = sensed(demos, sensor, SEED)
    errors = replay_errors(dmp, demos, measured)
    return {
        "error, mean": float(errors.mean()),
        "error, worst": float(errors.max()),
        "acceleration to new goals": acceleration(dmp, demos, measured),
        **accuracies(dmp, measured),
    }


def sensed(demos: Demonstrations, sensor: Sensor, seed: int) -> Demonstrations:
    """The movements as `sensor` records them, at no more than `RATE`; the first and the last stamp stay."""
    rng = np.random.default_rng(seed)
    positions, times = [], []
    for demo in demos:
        n = min(len(demo.times), max(10, round(demo.duration * RATE)))
        even = np.linspace(demo.times[0], demo.times[-1], n)
        step = (even[-1] - even[0]) / (n - 1)
        stamps = even + np.append(0, np.append(rng.uniform(-1, 1, n - 2) * sensor.jitter * step, 0))
        x = np.column_stack([np.interp(stamps, demo.times, column) for column in demo.positions.T])
        positions.append(x + rng.normal(size=x.shape) * sensor.noise * np.ptp(demo.positions, axis=0).max())
        times.append(stamps)
    return Demonstrations.from_arrays(positions, demos.labels, times)


def replay_errors(dmp: DMP, demos: Demonstrations, measured: Demonstrations) -> Array:
    """Root mean square distance between each replay and what was shown before the sensor, % of its extent."""
    paths = dmp.learn(measured).rollout(n_samples=200).positions
    errors = []
    for one, path in zip(demos, paths, strict=True):
        at = np.linspace(one.times[0], one.times[-1], len(path))
        shown = np.column_stack([np.interp(at, one.times, column) for column in one.positions.T])
        distance = np.sqrt(((path - shown) ** 2).sum(axis=1).mean())
        errors.append(100 * distance / np.ptp(one.positions, axis=0).max())
    return np.array(errors)


def acceleration(dmp: DMP, demos: Demonstrations, measured: Demonstrations) -> float:
    """Median of the hardest acceleration to goals `FAR` off, over that of the demonstration without noise."""
    primitives = dmp.learn(measured)
    shown = _hardest(DMP(fit="trajectory", n_basis=40).learn(demos).rollout(n_samples=400).accelerations)
    extents = np.array([np.ptp(demo.positions, axis=0).max() for demo in demos])
    ratios = []
    for axis in range(demos.n_dims):
        for sign in (-1, 1):
            goals = primitives.goals + sign * FAR * extents[:, None] * np.eye(demos.n_dims)[axis]
            ratios.append(_hardest(primitives.rollout(goal=goals, n_samples=400).accelerations) / shown)
    return float(np.median(ratios))


def accuracies(dmp: DMP, measured: Demonstrations) -> dict[str, float]:
    """Two of each class shown, the others asked: `DMPFeatures` and a classifier of scikit-learn."""
    rows = DMPFeatures(dmp=dmp).fit_transform(measured)
    n_shown = SHOTS * len(np.unique(measured.labels))
    folds = StratifiedShuffleSplit(DRAWS, train_size=n_shown, random_state=SEED)
    models = {"1-NN": KNeighborsClassifier(1), "SVM": SVC(kernel=RBF(), C=10.0)}
    return {
        name: float(cross_val_score(model, rows, measured.labels, cv=folds).mean()) for name, model in models.items()
    }


def speed(dmp: DMP) -> float:
    """Movements learned per second at best: 10,000 of 100 samples in two dimensions."""
    X = np.random.default_rng(SEED).normal(size=(10_000, 100, 2)).cumsum(axis=1)
    dmp.learn(X[:10])
    taken = []
    for _ in range(N_TIMED):
        begin = time.perf_counter()
        dmp.learn(X)
        taken.append(time.perf_counter() - begin)
    return len(X) / min(taken)


def _hardest(accelerations: Array) -> Array:
    return np.sqrt((accelerations**2).sum(axis=2)).max(axis=1)
