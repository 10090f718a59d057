"""A movement under live control: one step at a time, with a moving goal, a measured state, obstacles and any tempo."""

from kineme.primitives.control.controller import Controller
from kineme.primitives.control.obstacles import ObstacleAvoidance
from kineme.primitives.control.options import Options
from kineme.primitives.control.state import State, Status

__all__ = ["Controller", "ObstacleAvoidance", "Options", "State", "Status"]
