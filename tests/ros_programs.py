"""ROS itself, where it is installed; a test that asks for what is not there is skipped, with what would install it."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

_ROS_1 = "import rosbag, sensor_msgs.msg, trajectory_msgs.msg, tf2_msgs.msg"
_ROS_2 = "import rclpy.serialization, sensor_msgs.msg, trajectory_msgs.msg, nav_msgs.msg"
_SOURCES = Path(__file__).resolve().parents[1] / "src"
_WHEELS = Path(__file__).resolve().parents[1] / ".venv-ros2/bin/python"


def ros_1(program, *arguments):
    """What a program prints in the Python of the system, for which Debian packages ROS 1."""
    python = _first_with(_ROS_1, [shutil.which("python3", path="/usr/bin")])
    if python is None:
        pytest.skip("no ROS 1; on Debian: apt-get install python3-rosbag python3-{sensor,trajectory,tf2}-msgs")
    return _output(python, program, *arguments)


def ros_2(program, *arguments, given=None):
    """What a program prints in the Python that ROS2_PYTHON names, of `make ros2`, or this one."""
    python = _first_with(_ROS_2, [os.environ.get("ROS2_PYTHON"), str(_WHEELS), sys.executable])
    if python is None:
        pytest.skip("no ROS 2; make ros2")
    return _output(python, program, *arguments, given=given)


def ros_2_with_kineme(program, *arguments, needs="rclpy"):
    """What a program prints in the Python of ROS 2 that loads kineme, and what it needs, from this environment."""
    site = [path for path in sys.path if "site-packages" in path]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(_SOURCES), str(Path(__file__).parent / "sensors"), *site]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(os.getpid() % 100),  # workers do not hear each other
    }
    same = f"import sys; assert sys.version_info[:2] == {sys.version_info[:2]}; import {needs}"
    python = _first_with(same, [os.environ.get("ROS2_PYTHON"), str(_WHEELS), sys.executable])
    if python is None:
        pytest.skip(f"no ROS 2 with {needs} for this Python; make ros2")
    return _output(python, program, *arguments, environment=environment)


def _first_with(imports, pythons):
    return next((one for one in pythons if one and _succeeds(one, imports)), None)


@cache
def _succeeds(python, program):
    try:
        return not subprocess.run([python, "-c", program], capture_output=True, check=False).returncode
    except OSError:
        return False


def _output(python, program, *arguments, given=None, environment=None):
    command = [python, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=False, env=environment)
    assert not done.returncode, done.stderr
    return done.stdout
