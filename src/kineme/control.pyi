# Live control
from kineme.primitives.control.controller import Controller as Controller
from kineme.primitives.control.state import State as State
from kineme.primitives.control.state import Status as Status
from kineme.primitives.control.obstacles import ObstacleAvoidance as ObstacleAvoidance
