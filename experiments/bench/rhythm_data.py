"""Real rhythmic recordings, read from packages that the user installed; nothing is redistributed.

`pybullet` carries the motion clips of X. B. Peng, P. Abbeel, S. Levine, M. van de Panne, "DeepMimic", ACM
Transactions on Graphics 37(4), 2018; `aeon` carries BasicMotions of the UEA multivariate archive (A. Bagnall et al.,
arXiv:1811.00075).
"""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kineme import Demonstrations, Trajectory
from kineme.errors import DataError

# A frame: its duration, the root's position and quaternion, then the joints; (w, x, y, z), or one angle of a hinge.
_JOINTS = {"chest": 8, "neck": 12, "right hip": 16, "right knee": 20, "right ankle": 21, "right shoulder": 25}
_JOINTS |= {"right elbow": 29, "left hip": 30, "left knee": 34, "left ankle": 35, "left shoulder": 39, "left elbow": 43}
_FRAME_SIZE = 44


def load_clip(name: str) -> Trajectory:
    """A humanoid's joint angles [rad], ball joints as rotation vectors: one cycle, its first pose not repeated."""
    path = _packaged("pybullet", f"motions/humanoid3d_{name}.txt")
    try:
        frames = np.array(json.loads(path.read_text(encoding="utf-8"))["Frames"], dtype=float)
    except (ValueError, KeyError) as error:
        raise DataError(f"expected {path.name} to be JSON with equal 'Frames', got {error!r}") from error
    if frames.ndim != 2 or frames.shape[1] != _FRAME_SIZE:
        raise DataError(f"expected frames of {_FRAME_SIZE} numbers in {path.name}, got shape {frames.shape}")
    times = np.concatenate(([0.0], np.cumsum(frames[:-1, 0])))
    return Trajectory(times, np.hstack([_angles(frames, joint) for joint in _JOINTS]), name=name)


def period_of(cycle: Trajectory) -> float:
    """The period of a clip [s]; the last frame lasts as long as the others, then the first comes again."""
    return cycle.duration * len(cycle) / (len(cycle) - 1)


def repeated(cycle: Trajectory, cycles: float, noise: float, seed: int) -> Trajectory:
    """A clip wrapped around for `cycles` periods, plus white noise in units of its widest extent."""
    step = cycle.duration / (len(cycle) - 1)
    n = int(np.ceil(cycles * len(cycle))) + 1
    x = cycle.positions[np.arange(n) % len(cycle)]
    x = x + noise * np.ptp(x, axis=0).max() * np.random.default_rng(seed).normal(size=x.shape)
    return Trajectory(step * np.arange(n), x, name=cycle.name)


def load_basic_motions(split: str) -> Demonstrations:
    """Accelerometer and gyroscope of a smart watch, 10 s at 10 Hz, labeled with the activity; "TRAIN" or "TEST"."""
    path = _packaged("aeon", f"BasicMotions/BasicMotions_{split}.ts")
    rows = path.read_text(encoding="utf-8").partition("@data")[2].split()
    arrays, labels = [], []
    for row in rows:
        *channels, label = row.split(":")
        arrays.append(np.array([channel.split(",") for channel in channels], dtype=float).T)
        labels.append(label)
    if not arrays:
        raise DataError(f"expected lines of channels and a label after @data in {path.name}, got none")
    times = np.arange(len(arrays[0])) / 10.0
    return Demonstrations.from_arrays(arrays, labels, times, [f"{split} {i + 1}" for i in range(len(arrays))])


def _angles(frames: NDArray[np.float64], joint: str) -> NDArray[np.float64]:
    first = _JOINTS[joint]
    if joint.endswith(("knee", "elbow")):
        return frames[:, first : first + 1]
    return np.asarray(Rotation.from_quat(frames[:, first : first + 4], scalar_first=True).as_rotvec())


def _packaged(distribution: str, ending: str) -> Path:
    """A file of an installed distribution; the package itself is not imported."""
    try:
        listed = files(distribution) or []
    except PackageNotFoundError:
        listed = []
    for file in listed:
        if str(file).endswith(ending):
            return Path(str(file.locate()))
    raise DataError(f"expected {ending} inside the package {distribution}, found none; pip install {distribution}")
