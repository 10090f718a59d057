"""Episodes of robot data: what several sensors and commands said while a task was done once, as it is stored."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from kineme.validation import Array

STATE = "observation.state"  # as LeRobot calls what the arm is
#: Features of positions that an arm observes, where there is no ``observation.state``.
_POSITIONS = re.compile(r"observation\..*(joint_pos|eef_pos|eef_rot_axis_angle|gripper_qpos|gripper_width)")
STAMP_TOLERANCE = 1e-4  # [s] between stored stamps and those of the declared rate, as LeRobot allows
LARGEST, LATEST = 1e30, 1e10  # a value, and a stamp [s]: what is beyond is a fault, and no number
_PLACE = "episode "


@dataclass(frozen=True, eq=False)
class Episode:
    """One execution of a task: signals at common time stamps, as a data set stores them, checked by nobody.

    - `number`: index of the episode in its data set.
    - `times` (T,): stamps [s] since the beginning of the episode, as they are stored: they may repeat or go back.
    - `signals`: name of a feature, such as ``observation.state`` or ``action``, -> its values (T, d); NaN where the set
      has none.
    - `names`: name of a feature -> the names of its d entries.
    - `task`: what was done, in words; None if the data set does not say it.
    - `fps`: declared rate [1/s]; NaN if the data set does not declare one.
    - `problems`: what could not be read of the episode, or contradicts its declaration, each a sentence.
    - `place`: where it is stored, relative to the data set.
    - `notes`: what its reader took for granted, such as a rate, or knows besides, such as a subset that it belongs to.
    """

    number: int
    times: Array
    signals: Mapping[str, Array]
    names: Mapping[str, tuple[str, ...]]
    task: str | None = None
    fps: float = float("nan")
    problems: tuple[str, ...] = ()
    place: str = ""
    videos: Mapping[str, str] = field(default_factory=dict)  # camera -> file, relative to the data set
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.times)

    @property
    def label(self) -> str:
        """The place, or the number where that is empty."""
        return self.place or place_of(self.number)


def default_features(widths: Mapping[str, int]) -> tuple[str, ...]:
    """Return the features that say how an arm moved, where nobody chooses, of all with their widths; none if unclear.

    That is ``observation.state``; else all observed positions of joints, tips and grippers, as robomimic and UMI name
    them; else the only one of several numbers, such as ``action``; else the only one.
    """
    positions = tuple(name for name in widths if _POSITIONS.fullmatch(name))
    vectors = tuple(name for name, width in widths.items() if width > 1) or tuple(widths)
    return (STATE,) if STATE in widths else positions or (vectors if len(vectors) == 1 else ())


def place_of(number: int) -> str:
    """Return the place of an episode that is stored with others in one file."""
    return f"{_PLACE}{number}"


def number_at(place: str) -> int | None:
    """Return the number of the episode at a place that `place_of` gives; None for other places."""
    number = place.removeprefix(_PLACE)
    return int(number) if number.isdecimal() else None


def head_of(feature: str, entry: str) -> str:
    """Return the name of a column: ``feature.entry``, or the feature where its only entry has no name."""
    return f"{feature}.{entry}" if entry else feature


def even_stamps(times: Array, fps: float) -> Array:
    """Return the stamps k / fps [s] of an episode where all stored ones (T,) lie within 0.1 ms of them, else these."""
    even = np.arange(len(times)) / fps
    return even if np.all(np.abs(times - even) <= STAMP_TOLERANCE) else times
