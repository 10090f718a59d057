"""What `fit` and `n_basis` of `DMP` cost and give: replay, new goals, recognition, with and without noise.

The candidates are compared on every other shape of LASA, and the one that is the default is reported on the rest.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

import numpy as np
from sklearn.model_selection import StratifiedShuffleSplit, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.svm import SVC

from bench.movements import Array
from bench.rows import Row
from kineme import DMP, Demonstrations, DMPFeatures, load_lasa
from kineme.kernels import RBF

RATE = 100.0  # Hz, of the sensor
FAR = 0.3  # of the extent, by which goals move
DRAWS, SEED = 4, 0
N_TIMED = 5


@dataclass(frozen=True)
class Sensor:
    """What a sensor does to a movement: noise [share of the extent], time stamps off by a share of the interval."""

    noise: float
    jitter: float


SENSORS = {
    "as recorded": Sensor(0.0, 0.0),
    "0.3 % noise": Sensor(0.003, 0.0),
    "1 % noise, uneven stamps": Sensor(0.01, 0.4),
}
CANDIDATES = {
    **{f"forcing, {n}": DMP(fit="forcing", n_basis=n) for n in (20, 40, 80)},
    **{f"forcing by ridge, {n}": DMP(fit="forcing", n_basis=n, regression="ridge") for n in (20, 40, 80)},
    **{f"trajectory, {n}": DMP(fit="trajectory", n_basis=n) for n in (20, 30, 40, 60, 80)},
}


def measure(quick: bool) -> list[Row]:
    lasa = load_lasa()
    halves = {
        "chosen on": lasa[np.arange(len(lasa)) // 7 % 2 == 0],
        "reported on": lasa[np.arange(len(lasa)) // 7 % 2 == 1],
    }
    rows = []
    for half, demos in halves.items():
        for name, dmp in CANDIDATES.items():
            for sensor, changes in SENSORS.items():
                for what, (value, unit) in figures(dmp, demos[::7] if quick else demos, changes).items():
                    rows.append(Row(f"{half}: {name}, {sensor}, {what}", unit, value))
    return rows + [Row(f"{name}, learned per second", "/s", speed(dmp)) for name, dmp in CANDIDATES.items()]


def figures(
    dmp: DMP, demos: Demonstrations, sensor: Sensor, groups: Array | None = None
) -> dict[str, tuple[float, str]]:
    """Error of the replay and hardest acceleration on the way to new goals; accuracy of two classifiers."""
    measured = sensed(demos, sensor, SEED)
    errors = replay_errors(dmp, demos, measured)
    found = {
        "error, mean": (float(errors.mean()), "%"),
        "error, worst": (float(errors.max()), "%"),
        "acceleration to new goals": (acceleration(dmp, demos, measured), "times"),
    }
    return found | {name: (value, "accuracy") for name, value in accuracies(dmp, measured, groups).items()}


def sensed(demos: Demonstrations, sensor: Sensor, seed: int) -> Demonstrations:
    """The movements as `sensor` records them, at no more than `RATE`; the first and the last stamp stay."""
    rng = np.random.default_rng(seed)
    positions, times = [], []
    for one in demos:
        n = min(len(one.times), max(10, round(one.duration * RATE)))
        even = np.linspace(one.times[0], one.times[-1], n)
        step = (even[-1] - even[0]) / (n - 1)
        stamps = even + np.append(0, np.append(rng.uniform(-1, 1, n - 2) * sensor.jitter * step, 0))
        x = np.column_stack([np.interp(stamps, one.times, column) for column in one.positions.T])
        positions.append(x + rng.normal(size=x.shape) * sensor.noise * np.ptp(one.positions, axis=0).max())
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
    extents = np.array([np.ptp(one.positions, axis=0).max() for one in demos])
    ratios = []
    for axis in range(demos.n_dims):
        for sign in (-1, 1):
            goals = primitives.goals + sign * FAR * extents[:, None] * np.eye(demos.n_dims)[axis]
            ratios.append(_hardest(primitives.rollout(goal=goals, n_samples=400).accelerations) / shown)
    return float(np.median(ratios))


def accuracies(dmp: DMP, measured: Demonstrations, groups: Array | None) -> dict[str, float]:
    """Two of each class shown, or all people but one; `DMPFeatures` and a classifier of scikit-learn."""
    from sklearn.model_selection import LeaveOneGroupOut

    rows = DMPFeatures(dmp=dmp).fit_transform(measured)
    n_classes = len(np.unique(measured.labels))
    folds = (
        StratifiedShuffleSplit(DRAWS, train_size=2 * n_classes, random_state=SEED)
        if groups is None
        else LeaveOneGroupOut()
    )
    models = {"1-NN": KNeighborsClassifier(1), "SVM": make_pipeline(SVC(kernel=RBF(), C=10.0))}
    return {
        name: float(cross_val_score(model, rows, measured.labels, groups=groups, cv=folds).mean())
        for name, model in models.items()
    }


def speed(dmp: DMP) -> float:
    """Movements learned per second: 10,000 of 100 samples in two dimensions."""
    X = np.random.default_rng(SEED).normal(size=(10_000, 100, 2)).cumsum(axis=1)
    dmp.learn(X[:10])
    taken = []
    for _ in range(N_TIMED):
        begin = time.perf_counter()
        dmp.learn(X)
        taken.append(time.perf_counter() - begin)
    return len(X) / median(taken)


def _hardest(accelerations: Array) -> Array:
    return np.sqrt((accelerations**2).sum(axis=2)).max(axis=1)
