"""What is sent to an arm: joint positions and their rates over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kineme.validation import Array


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
