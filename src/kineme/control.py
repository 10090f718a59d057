"""Live control of primitives; public names of `kineme.primitives.control`."""

from kineme.primitives.control import Controller, ObstacleAvoidance, State, Status

__all__ = ["Controller", "ObstacleAvoidance", "State", "Status"]
