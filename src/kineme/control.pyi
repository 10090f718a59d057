# Live control
from kineme.dmp.control.controller import Controller as Controller
from kineme.dmp.control.plan import Options as Options
from kineme.dmp.control.plan import State as State
from kineme.dmp.control.plan import Status as Status
from kineme.dmp.control.plan import ObstacleAvoidance as ObstacleAvoidance
from kineme.dmp.rhythmic.controller import RhythmicController as RhythmicController
from kineme.dmp.rhythmic.controller import RhythmicState as RhythmicState
