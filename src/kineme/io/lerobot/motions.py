"""Texts about the movements of an episode of LeRobot, and how they stand in a data set of either version."""

from __future__ import annotations

from typing import NamedTuple

#: Of a movement, in coordinates of the robot: not of a camera, which stays null.
ROLE, STYLE = "assistant", "motion"
#: With which a content of this package begins: rows that do are replaced, those of others stay.
OWN = '{"annotator": "kineme"'


class Motion(NamedTuple):
    """A text about a movement of an episode.

    Attributes
    ----------
    start : float
        Seconds since the beginning of the episode; the stored stamp of the nearest frame is written.
    content : str
        JSON that begins with `OWN`, so that a later copy can replace it.
    """

    start: float
    content: str
