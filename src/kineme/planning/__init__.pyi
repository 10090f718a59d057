# What was shown of a symbol, and its movement to a new goal
from kineme.planning.skill import skill_of as skill_of
from kineme.planning.skill import Skill as Skill
from kineme.planning.skill import outside as outside
from kineme.planning.skill import Excess as Excess
from kineme.planning.skill import move_to as move_to

# What symbols need and do, learned from states
from kineme.planning.states import states_of as states_of
from kineme.planning.states import States as States
from kineme.planning.states import read_state as read_state
from kineme.planning.operators import learn_operators as learn_operators
from kineme.planning.domain import Domain as Domain
from kineme.planning.domain import Operator as Operator
from kineme.planning.domain import Literal as Literal
from kineme.planning.domain import Edit as Edit
from kineme.planning.domain import edited as edited
from kineme.planning.domain import read_domain as read_domain
from kineme.planning.domain import domain_to_dict as domain_to_dict
from kineme.planning.domain import domain_from_dict as domain_from_dict
from kineme.planning.domain import operator_schema as operator_schema
from kineme.planning.pddl import domain_to_pddl as domain_to_pddl
from kineme.planning.pddl import edits_in as edits_in

# Plans
from kineme.planning.problem import problem_of as problem_of
from kineme.planning.problem import problem_from_pddl as problem_from_pddl
from kineme.planning.problem import Problem as Problem
from kineme.planning.problem import Goal as Goal
from kineme.planning.plan import find_plan as find_plan
from kineme.planning.plan import Plan as Plan
from kineme.planning.plan import Step as Step
from kineme.planning.plan import plan_to_dict as plan_to_dict
from kineme.planning.plan import plan_from_dict as plan_from_dict
from kineme.planning.plan import read_plan as read_plan
from kineme.planning.behavior_tree import plan_to_behavior_tree as plan_to_behavior_tree
from kineme.planning.behavior_tree import domain_to_behavior_tree as domain_to_behavior_tree
from kineme.planning.figure import draw_plan as draw_plan

# A plan on an arm
from kineme.planning.execution import execute as execute
from kineme.planning.execution import check_steps as check_steps
from kineme.planning.execution import Execution as Execution
from kineme.planning.execution import Attempt as Attempt
from kineme.planning.execution import Replan as Replan
from kineme.planning.simulated import simulation_of as simulation_of
from kineme.planning.simulated import disturb as disturb
from kineme.planning.simulated import assume_flags as assume_flags
from kineme.planning.figure import draw_execution as draw_execution

# Skills for a language model
from kineme.planning.preview import OutsideError as OutsideError
from kineme.planning.skills import SkillTools as SkillTools
from kineme.planning.skills import skills_server as skills_server
