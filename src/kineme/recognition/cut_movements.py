"""How much a search differs from its demonstrations even where they are the same: by what it cuts off at both ends."""

from __future__ import annotations

import numpy as np

from kineme.comparison.references import References
from kineme.comparison.scores import nearest, score
from kineme.movements.segmentation.motion import observe
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.candidate_windows import MIN_SAMPLES, RESOLUTION, resampled
from kineme.recognition.compared_windows import Templates
from kineme.recognition.conformal import Calibration
from kineme.recognition.left_out import distances
from kineme.sampling import evenly_spaced
from kineme.validation import Array

#: Shares of the duration that are cut off at the start and at the end: windows end at samples some hundredths apart.
_CUTS = ((0.03, 0.0), (0.0, 0.03), (0.03, 0.03))
_OF_EACH = 4  # demonstrations of a class that are cut, evenly spaced


def calibration_of_cut(known: Templates) -> Calibration:
    """The calibration for movements that are cut out of a recording; kept with that for whole movements.

    The scale of a class is at least the mean distance of its demonstrations from themselves when 3 % of their
    duration is cut off at one end or both. A robot that repeats a movement exactly varies less than the cuts do, and
    whatever a search finds of it would be unknown. Scales of what people show are larger, and stay.
    """
    made: Calibration | None = vars(known.calibration).get("_of_cut")
    if made is None:
        made = known.calibration.with_least_scales(_cut_distances(known))
        vars(known.calibration)["_of_cut"] = made
    return made


def _cut_distances(known: Templates) -> Array:
    """Mean distance (C,) of demonstrations of each class to themselves when cut; 0 where they are too short."""
    references = known.references
    movements, found = references.all_movements(), np.zeros(len(references.classes))
    for c, own in enumerate(references.slices()):
        chosen = own.start + evenly_spaced(own.stop - own.start, _OF_EACH)
        long = [one for one in (movements[int(i)] for i in chosen) if len(one.times) >= 2 * MIN_SAMPLES]
        if long:
            found[c] = _to_class(known, references, [_cut(one) for one in long], c)
    return found


def _to_class(known: Templates, references: References, cut: list[Demonstrations], c: int) -> float:
    logs = np.concatenate([score(known.comparison, references, one, nearest)[0][:, c] for one in cut])
    return float(distances(logs).mean())


def _cut(one: Trajectory) -> Demonstrations:
    """A movement with a little cut off, as a window of a recording."""
    begin, end = (share * one.duration for share in np.array(_CUTS).T)
    motion = observe(one, RESOLUTION)
    return Demonstrations.of_movements(resampled(motion, one.times[0] + begin, one.times[-1] - end))
