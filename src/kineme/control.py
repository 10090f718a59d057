"""Public names of `kineme.primitives.control`, and the controllers of rhythms."""

from kineme.primitives.control import Controller, ObstacleAvoidance, Options, State, Status
from kineme.primitives.rhythmic.controller import RhythmicController, RhythmicState

__all__ = [
    "Controller",
    "ObstacleAvoidance",
    "Options",
    "RhythmicController",
    "RhythmicState",
    "State",
    "Status",
]
