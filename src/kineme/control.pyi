# Live control
from kineme.primitives.control.controller import Controller as Controller
from kineme.primitives.control.options import Options as Options
from kineme.primitives.control.state import State as State
from kineme.primitives.control.state import Status as Status
from kineme.primitives.control.obstacles import ObstacleAvoidance as ObstacleAvoidance
from kineme.primitives.rhythmic.controller import RhythmicController as RhythmicController
from kineme.primitives.rhythmic.controller import RhythmicState as RhythmicState
