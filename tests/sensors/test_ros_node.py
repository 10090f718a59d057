"""ROS 2 itself on loopback: samples of topics and frames in, symbols out, checked movements to a controller."""

from __future__ import annotations

import json

import pytest

from ros_programs import ros_2_with_kineme

_BEGINNING = """
import json, sys, time
import numpy as np
import rclpy
from std_msgs.msg import String
from geometry_msgs.msg import PoseStamped, TransformStamped
from sensor_msgs.msg import JointState
from kineme.sensors.ros import ArmClient, RosNode
from kineme.sensors.listen import Listener

rclpy.init()
peer = rclpy.create_node("peer")

def spin(node, until, seconds=15.0):
    end = time.monotonic() + seconds
    while not until() and time.monotonic() < end:
        rclpy.spin_once(peer, timeout_sec=0.01)
        node.blocks.append(node.receive(0.01))

class Node(RosNode):
    def __init__(self, *arguments, **options):
        self.blocks = []
        super().__init__(*arguments, **options)

    @property
    def rows(self):
        return [row for block in self.blocks for row in block.rows.tolist()]

    @property
    def heard(self):
        return [note for block in self.blocks for note in block.notes]

def stamp(message, seconds):
    message.header.stamp.sec = int(seconds)
    message.header.stamp.nanosec = round(1e9 * (seconds % 1))
    return message
"""


def _answer(program, *arguments, needs="rclpy"):
    return json.loads(ros_2_with_kineme(_BEGINNING + program, *arguments, needs=needs).splitlines()[-1])


_SAMPLES = """
node = Node(topic="/tip")
spin(node, lambda: node.heard)
waiting = node.heard[0]
kind = JointState if sys.argv[1] == "joints" else PoseStamped
publisher = peer.create_publisher(kind, "/tip", 10)
spin(node, lambda: publisher.get_subscription_count())
for k in range(3):
    if kind is JointState:
        message = JointState(name=["a", "b"], position=[1.0 * k, 2.0])
        if k == 1:
            message = JointState(name=["b", "c", "a"], position=[2.0, 3.0, 1.0])
    else:
        message = PoseStamped()
        message.pose.position.x, message.pose.orientation.w = 1.0 * k, 1.0
    publisher.publish(stamp(message, 100.0 + k))
if kind is JointState:
    publisher.publish(JointState(name=["a"], position=[0.0]))
    publisher.publish(JointState(name=["a", "b"], position=[0.0]))
wanted = set() if kind is PoseStamped else {"other values", "no sample"}
spin(node, lambda: len(node.rows) >= 3 and wanted <= {name for name, _ in node.heard})
node.close()
times = [t for block in node.blocks for t in block.times.tolist()]
print(json.dumps([waiting, times, node.rows, node.columns.heads, [name for name, _ in node.heard if name]]))
"""


def test_poses_of_a_topic_are_samples_with_the_names_that_bags_have():
    waiting, times, rows, heads, _ = _answer(_SAMPLES, "poses")
    assert waiting == ["no topic", "waiting for somebody who publishes /tip"]
    assert times == [100.0, 101.0, 102.0]
    assert [row[0] for row in rows] == [0.0, 1.0, 2.0]
    assert heads == [*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw")]


def test_joints_are_taken_by_their_names_and_messages_without_them_are_said():
    _, _, rows, heads, kinds = _answer(_SAMPLES, "joints")
    assert rows == [[0.0, 2.0], [1.0, 2.0], [2.0, 2.0]]
    assert heads == ["a", "b"]
    assert set(kinds) == {"no topic", "other values", "no sample"}


_NAMED = """
from sensor_samples import make_library, take
library = make_library(sys.argv[1])
node = Node(topic="/tip")
listener = Listener(library, print, choose=("position.x", "position.y"))
publisher = peer.create_publisher(PoseStamped, "/tip", 10)
said, states = [], []
peer.create_subscription(String, "/kineme/symbol", lambda message: said.append(json.loads(message.data)), 10)
spin(node, lambda: publisher.get_subscription_count() and peer.count_publishers("/kineme/symbol"))
for k, row in enumerate(take("GShape")):
    message = PoseStamped()
    message.pose.position.x, message.pose.position.y = row.tolist()
    publisher.publish(stamp(message, 1e9 + k / 100))
    rclpy.spin_once(peer, timeout_sec=0.0)
    for symbol in listener.take(node.receive(0.2), node.columns, k / 100):
        node.send(symbol)
spin(node, lambda: said and said[-1]["is_over"])
latched = rclpy.qos.QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
peer.create_subscription(String, "/kineme/state", lambda message: states.append(json.loads(message.data)), latched)
spin(node, lambda: states)
node.close()
library.close()
print(json.dumps([said, states]))
"""


def test_movements_are_named_and_a_node_that_comes_later_hears_the_last_one(tmp_path):
    said, states = _answer(_NAMED, tmp_path / "actions")
    assert said[-1]["name"] == "GShape"
    assert said[-1]["is_over"]
    assert states == [said[-1]]
    assert said[-1]["start"] == pytest.approx(1e9, abs=1.5)


_FRAMES = """
from tf2_msgs.msg import TFMessage
from kineme.sensors import ros
ros._MOST_FRAMES = 3
node = Node(frame="base:camera")
latched = rclpy.qos.QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
moving, fixed = peer.create_publisher(TFMessage, "/tf", 10), peer.create_publisher(TFMessage, "/tf_static", latched)
spin(node, lambda: moving.get_subscription_count() and fixed.get_subscription_count())

def transform(parent, child, x, turned, seconds):
    message = stamp(TransformStamped(), seconds)
    message.header.frame_id, message.child_frame_id = parent, child
    message.transform.translation.x = x
    message.transform.rotation.z, message.transform.rotation.w = (0.5**0.5,) * 2 if turned else (0.0, 1.0)
    return message

for _ in range(15):  # nobody keeps a message for who has not joined yet
    if not node.heard:
        moving.publish(TFMessage(transforms=[transform("base", "tip", 1.0, True, 1.0)]))
        spin(node, lambda: node.heard, 1.0)
fixed.publish(TFMessage(transforms=[transform("tip", "camera", 0.5, False, 0.0)]))
moving.publish(TFMessage(transforms=[transform("other", "thing", 9.0, False, 2.0)]))
spin(node, lambda: False, 1.0)
others = [transform("base", f"one more {k}", 7.0, False, 2.0) for k in range(2)]
moving.publish(TFMessage(transforms=[*others, transform("base", "tip", 2.0, True, 3.0)]))
spin(node, lambda: node.rows)
node.close()
print(json.dumps([block.times.tolist() for block in node.blocks if len(block.times)] + node.rows))
"""


@pytest.mark.soak
def test_a_pose_of_frames_is_composed_at_each_transform_on_the_way():
    times, row = _answer(_FRAMES, needs="tf2_msgs.msg")
    assert times == [3.0]
    assert row == pytest.approx([2.0, 0.5, 0.0, 0.0, 0.0, 0.5**0.5, 0.5**0.5])


_ARM = """
import threading
from functools import partial
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import MultiThreadedExecutor
import kineme
from kineme.planning.preview import plan_symbol
from kineme.robots import load

robot = load("panda")
u = np.linspace(0, 1, 100)[:, None]
s = 10 * u**3 - 15 * u**4 + 6 * u**5
paths = [np.array([0.31, 0.0, 0.48 + 0.01 * k]) + s * [0.1, 0.2, -0.1] for k in range(3)]
paths += [path + [5.0, 0.0, 0.0] for path in paths]
library = kineme.ActionLibrary(sys.argv[1], create=True)
library.learn(kineme.Demonstrations.from_arrays(paths, ["carry"] * 3 + ["far"] * 3, times=2 * u[:, 0]))
node = Node(topic="/tip")
plan = partial(plan_symbol, library, robot)
goals, canceled, said, behavior = [], [], [], ["succeed"]

def execute(goal):
    goals.append(goal.request.trajectory)
    while behavior[0] == "hang" and not goal.is_cancel_requested:
        time.sleep(0.01)
    if goal.is_cancel_requested:
        canceled.append(True)
        goal.canceled()
    elif behavior[0] == "abort":
        goal.abort()
        return FollowJointTrajectory.Result(error_code=-4, error_string="path tolerance violated")
    else:
        goal.succeed()
    return FollowJointTrajectory.Result()

other = rclpy.create_node("controller")
executor = MultiThreadedExecutor(4)
executor.add_node(other)
server = ActionServer(other, FollowJointTrajectory, "/follow", execute, cancel_callback=lambda _: CancelResponse.ACCEPT)
spinning = threading.Thread(target=executor.spin, daemon=True)
spinning.start()
arm = ArmClient(node, robot.joints, plan, "/follow")
asking = peer.create_publisher(String, "/kineme/execute", 10)
peer.create_subscription(String, "/kineme/executed", lambda message: said.append(json.loads(message.data)), 10)
states = peer.create_publisher(JointState, "/joint_states", 10)
spin(node, lambda: asking.get_subscription_count() and states.get_subscription_count()
     and peer.count_publishers("/kineme/executed") and arm._client.server_is_ready())

def ask(name, until):
    asking.publish(String(data=name))
    spin(node, lambda: said and said[-1]["state"] in until)

ask("carry", ("refused",))

def stand():
    for _ in range(3):
        states.publish(JointState(name=list(robot.joints), position=robot.rest.tolist()))
        spin(node, lambda: False, 0.1)

for name, does, until in (
    ("carry", "succeed", ("done",)), ("nobody", "succeed", ("refused",)), ("far", "succeed", ("refused",)),
    ("carry", "abort", ("failed",)),
):
    stand()
    behavior[0] = does
    said.append({"state": None})
    ask(name, until)
stand()
behavior[0] = "hang"
ask("carry", ("moving",))
ask("carry", ("refused",))
arm.close()
spin(node, lambda: canceled)
first = goals[0].points
node.close()
library.close()
print(json.dumps([[answer for answer in said if answer["state"]], canceled, list(goals[0].joint_names), len(first),
                  first[0].positions.tolist(), robot.rest.tolist(), len(goals)]))
executor.shutdown()
spinning.join(15.0)  # a thread of ROS that outlives the program ends it as a crash
rclpy.try_shutdown()
"""


def test_a_name_moves_the_arm_through_its_checks_and_the_end_of_the_node_cancels(tmp_path):
    pytest.importorskip("pinocchio")
    said, canceled, joints, n_points, first, rest, n_goals = _answer(
        _ARM, tmp_path / "actions", needs="control_msgs.action"
    )
    states = [(answer["name"], answer["state"]) for answer in said]
    assert states == [
        ("carry", "refused"), ("carry", "moving"), ("carry", "done"), ("nobody", "refused"), ("far", "refused"),
        ("carry", "moving"), ("carry", "failed"), ("carry", "moving"), ("carry", "refused"),
    ]  # fmt: skip
    assert "/joint_states" in said[0]["reason"]
    assert said[6]["reason"] == "path tolerance violated"
    assert "a movement is under way" in said[8]["reason"]
    assert canceled == [True]
    assert (len(joints), n_goals) == (7, 3)  # nothing was sent of what was refused
    assert n_points > 100
    assert first == pytest.approx(rest)
