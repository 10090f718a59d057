# Arms
from kineme.robots.models.robot import load as load
from kineme.robots.models.robot import Robot as Robot

# From a movement to an arm
from kineme.robots.planning.move import move as move
from kineme.robots.planning.robot_movement import RobotMovement as RobotMovement
from kineme.robots.planning.robot_movement import InfeasibleError as InfeasibleError
from kineme.robots.execution.joint_trajectory import JointTrajectory as JointTrajectory
from kineme.robots.execution.preflight import preflight as preflight
from kineme.robots.execution.preflight import Preflight as Preflight
from kineme.robots.execution.preflight import Check as Check
from kineme.robots.kinematics.descent import InverseKinematics as InverseKinematics

# Files for robots and for people
from kineme.robots.export_files import write_joints as write_joints
from kineme.robots.export_files import write_bag as write_bag
from kineme.robots.export_files import write_action_goal as write_action_goal
from kineme.robots.export_files import write_lerobot as write_lerobot
from kineme.robots.view.figure import draw_robot_movement as draw_robot_movement
from kineme.robots.view.write_view import write_view as write_view

# Live
from kineme.robots.arm_controller import ArmController as ArmController
from kineme.robots.arm_controller import ArmState as ArmState
from kineme.robots.arm_controller import ArmStatus as ArmStatus

# Without an arm
from kineme.robots.simulation import Simulation as Simulation
from kineme.robots.simulation import Run as Run
