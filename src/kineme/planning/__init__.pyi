# What was shown of a symbol, and its movement to a new goal
from kineme.planning.skill import skill_of as skill_of
from kineme.planning.skill import Skill as Skill
from kineme.planning.skill import outside as outside
from kineme.planning.skill import Excess as Excess
from kineme.planning.skill import move_to as move_to
