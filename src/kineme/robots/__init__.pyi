# Arms
from kineme.robots.models.robot import load as load
from kineme.robots.models.robot import Robot as Robot

# From a movement to an arm
from kineme.robots.robot_movement import move as move
from kineme.robots.robot_movement import RobotMovement as RobotMovement
from kineme.robots.robot_movement import InfeasibleError as InfeasibleError
from kineme.robots.execution.joint_trajectory import JointTrajectory as JointTrajectory
from kineme.robots.checks.preflight import preflight as preflight
from kineme.robots.checks.check import Preflight as Preflight
from kineme.robots.checks.check import Check as Check
from kineme.robots.kinematics.inverse import InverseKinematics as InverseKinematics
from kineme.robots.view.write_view import write_view as write_view

# Live
from kineme.robots.arm_controller import ArmController as ArmController
from kineme.robots.arm_controller import ArmState as ArmState
