"""Samples far from the path, as trackers write them that lose what they follow, and jumps of their origin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.sampling import runs
from kineme.validation import Array

#: Samples of a glitch, at most: what leaves the path for longer is a movement.
LENGTH = 3
#: A glitch is so many times as far from the path as that moves in a step beside it, and as a typical step is long.
STEPS = 10.0
#: Where a value was held apart, the path goes on within this share of its distance.
RETURN = 0.2
#: A movement whose longest step is no more than so many mean ones is not searched: a glitch in it would be a few
#: hundredths of its path, which smoothing bears.
MEAN_STEPS = 6.0


@dataclass(frozen=True)
class RemoveGlitches:
    """Leave out samples that a tracker lost: a primitive follows them, and so does a robot.

    At most three samples that leave the path at once and return, and a value that is held far from it, such as zeros
    while nothing is seen, give way to the path beside them; all others stay as they are, to the last bit. `Recognizer`
    does so by itself, `kineme.ActionLibrary` for its primitives, and the shell.
    """

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """Return the movements without their glitches."""
        movements = demonstrations.movements
        positions = without_glitches(movements.positions, demonstrations.offsets)
        return movements if positions is movements.positions else replace(movements, positions=positions)


def without_glitches(positions: Array, offsets: NDArray[np.intp]) -> Array:
    """Return positions (total, d) of n movements without their glitches; the same array if there are none.

    A glitch leaves the path at once and returns within three samples; the median of seven samples takes its place. It
    lies `STEPS` times as far from the medians as these move in a step beside it, and as a typical step of the movement
    is long. A value that is held apart for longer, as zeros while nothing is seen, gives way to a line from the sample
    before to the one after, if these are near each other for how far it is. Other samples stay as they are, to the last
    bit. So do the first and the last one of a movement and what lies apart with them: that does not return, and may be
    a stroke of a pen.
    """
    changed = positions
    steps = np.linalg.norm(np.diff(positions, axis=0, append=positions[-1:]), axis=1)
    steps[offsets[1:] - 1] = 0.0
    longest, paths = np.maximum.reduceat(steps, offsets[:-1]), np.add.reduceat(steps, offsets[:-1])
    for i in np.flatnonzero(longest * np.diff(offsets) > MEAN_STEPS * paths).tolist():
        rows = slice(int(offsets[i]), int(offsets[i + 1]))
        glitches, path = _glitches(positions[rows], steps[rows])
        if glitches.any():
            changed = positions.copy() if changed is positions else changed
            changed[rows][glitches] = path[glitches]
    return changed


def _glitches(x: Array, steps: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return which samples (T,) of a movement (T, d) are glitches, and the medians (T, d)."""
    typical = float(np.median(steps[steps > 0]))
    width = 2 * LENGTH + 1
    path = median_filter(x, (width, 1), mode="mirror")
    moved = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    beside = maximum_filter1d(moved, 2 * width + 1)
    glitches = np.linalg.norm(x - path, axis=1) > STEPS * np.maximum(beside, typical)
    on_path = np.flatnonzero(~glitches)
    if len(on_path):
        glitches[: on_path[0]] = glitches[on_path[-1] :] = False
    for begin, end in runs(steps[:-1] == 0).tolist():  # samples begin to end, inclusive, are equal
        if begin > 0 and end < len(x) - 1:
            away, across = min(steps[begin - 1], steps[end]), x[end + 1] - x[begin - 1]
            if away > STEPS * typical and np.linalg.norm(across) < RETURN * away:
                shares = np.arange(1, end - begin + 2)[:, None] / (end - begin + 2)
                path[begin : end + 1], glitches[begin : end + 1] = x[begin - 1] + shares * across, True
    return glitches & bool(len(on_path)), path


def without_jumps(positions: Array, steps: Array, longest: float) -> Array:
    """Return positions (T, d) of a recording in which what follows a jump goes on where it was before the jump.

    A jump is a step `STEPS` times as long as those beside it, and as a typical one, of at most two among five: where
    it leads is no movement, as a tracker that finds its origin anew or writes zeros while it sees nothing. A single
    column that jumps is one that switches, as of a gripper. Repeated samples do not count, as of a sensor that is
    slower than the recording. Nor does a step in time `steps` (T - 1,) above `longest`: who moves meanwhile was not
    seen.
    """
    squares = np.diff(positions, axis=0) ** 2
    sizes = np.sqrt(squares.sum(axis=1))
    others = np.sqrt(np.maximum(squares.sum(axis=1) - squares.max(axis=1), 0.0))  # but for the column of most
    moved = np.flatnonzero(sizes > 0)
    if len(moved) < 2 * LENGTH or sizes.max() <= STEPS * np.median(sizes[moved]):
        return positions
    medians = median_filter(sizes[moved], 5, mode="constant")  # at the ends two of three may be jumps
    usual = np.maximum(maximum_filter1d(medians, 15), np.median(sizes[moved]))
    jumps = moved[(sizes[moved] > STEPS * usual) & (others[moved] > STEPS * usual) & (steps[moved] <= longest)]
    if not len(jumps):
        return positions
    shifts = np.zeros_like(positions)
    shifts[jumps + 1] = positions[jumps + 1] - positions[jumps]
    return positions - np.cumsum(shifts, axis=0)
