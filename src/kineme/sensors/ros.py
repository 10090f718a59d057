"""ROS 2: messages of a topic, or the pose of a frame, as samples; symbols as JSON; movements on an arm when asked for.

A node of rclpy, which comes with ROS 2, or as wheels that others build. Which fields of a message are numbers says the
table that bags are read by, `kineme.io.ros.number_fields`.
"""

from __future__ import annotations

import json
import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.io.ros.choose import Edge, chain, edge_of, pair_of
from kineme.io.ros.number_fields import POSE, TRANSFORMS, TYPES, MessageType, nanoseconds_of, transform_row
from kineme.io.ros.streams import from_ros, to_ros
from kineme.movements.channels.column_match import Columns
from kineme.movements.rotations import conjugate, product, rotated
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export_files import samples_of, stamp_of
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.sensors.listen import NOTHING, Block, Symbol
from kineme.validation import Array

_WAITING = 1000  # messages that wait to be read
_MOST_FRAMES = 10_000
_FRESH = 1.0  # seconds for which the positions of joints count
_CANCELED = 2.0  # seconds that the end of the node waits until an arm has been told to stop
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"  # that of ros2_control


class RosNode:
    """A node named "kineme": a source of samples of a topic or of two frames, and a sink that publishes symbols.

    ``kineme/symbol`` has each symbol as JSON in a std_msgs/String; ``kineme/state`` the last one, also for nodes that
    come later. The type of a topic is found when somebody publishes it. A `DataError` says what is not installed.
    """

    def __init__(self, topic: str | None = None, frame: str | None = None) -> None:
        rclpy, self._strings = ros_module("rclpy"), ros_module("std_msgs.msg")
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # nobody else on the network
        qos = ros_module("rclpy.qos")
        signals = ros_module("rclpy.signals").SignalHandlerOptions.NO  # Ctrl-C ends the loop, which ends the node
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=signals)
        self.node = rclpy.create_node("kineme", context=self._context)
        self._executor = ros_module("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        latched = qos.QoSProfile(depth=1, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self._symbols = self.node.create_publisher(self._strings.String, "kineme/symbol", 10)
        self._state = self.node.create_publisher(self._strings.String, "kineme/state", latched)
        self._sensor = qos.QoSProfile(depth=_WAITING, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
        self._static = qos.QoSProfile(depth=_WAITING, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self.columns: Columns | None = None
        self._topic = topic
        self._frames: dict[Edge, Array] = {}  # the latest transforms
        self._samples: deque[tuple[float, list[float]]] = deque(maxlen=_WAITING)
        self._notes: list[tuple[str, str]] = []
        if frame is not None:
            self._subscribe_frames(pair_of(frame))

    def receive(self, timeout: float) -> Block:
        """Let the node work until a sample comes, and return those that are there."""
        if self._topic is not None and self.columns is None:
            self._subscribe(self._topic)
        self._executor.spin_once(timeout_sec=timeout)
        for _ in range(len(self._samples) and _WAITING):
            count = len(self._samples)
            self._executor.spin_once(timeout_sec=0.0)
            if len(self._samples) == count:
                break
        notes, self._notes = self._notes, []
        if not self._samples:
            return NOTHING._replace(notes=notes)
        times, rows = zip(*self._samples, strict=True)
        self._samples.clear()
        return Block(np.array(times), np.array(rows), notes)

    def _subscribe(self, topic: str) -> None:
        """Subscribe to the topic once its type is known."""
        name = self.node.resolve_topic_name(topic)
        for kind in dict(self.node.get_topic_names_and_types()).get(name, []):
            how = TYPES.get(kind)
            if how is None or how.row is None:
                readable = ", ".join(other for other, how in TYPES.items() if how.row is not None)
                raise DataError(f"expected a topic with samples, {name} has {kind}; these are read: {readable}")
            self._topic = None
            message = getattr(ros_module(kind.rpartition("/")[0].replace("/", ".")), kind.rpartition("/")[2])
            self.node.create_subscription(message, name, self._reader(how), self._sensor)
            self._notes.append(("", f"listening to {name}, {kind}"))
            return
        self._notes.append(("no topic", f"waiting for somebody who publishes {name}"))

    def _reader(self, how: MessageType) -> Callable[[Any], None]:
        row = how.row
        if row is None:
            raise SpecificationError("expected a type whose messages are samples")

        def read(message: Any) -> None:
            try:
                heads, values = row(message)
            except ValueError as error:
                self._notes.append(("no sample", f"{error}"))
                return
            if not heads:
                return
            stamp = nanoseconds_of(message.header.stamp) if how.has_header else 0
            if self.columns is None:
                self.columns = Columns(tuple(heads), (None,) * len(heads))
            elif tuple(heads) != self.columns.heads:
                place = dict(zip(heads, values, strict=True))
                if not set(self.columns.heads) <= place.keys():
                    self._notes.append(
                        ("other values", f"expected {', '.join(self.columns.heads[:12])} in each message")
                    )
                    return
                values = [place[head] for head in self.columns.heads]
            self._samples.append((1e-9 * stamp if stamp else time.monotonic(), list(values)))

        return read

    def _subscribe_frames(self, pair: Edge) -> None:
        """Follow the pose of one frame in another: at each transform of /tf on the way between them."""
        kind = TRANSFORMS[0].rpartition("/")
        message = getattr(ros_module(kind[0].replace("/", ".")), kind[2])
        self.columns = Columns(POSE, (None,) * len(POSE))

        def read(message: Any, is_static: bool = False) -> None:
            for transform in message.transforms:
                if len(self._frames) < _MOST_FRAMES or edge_of(transform) in self._frames:
                    self._frames[edge_of(transform)] = np.array([transform_row(transform.transform)])
            edges = {edge_of(transform): transform for transform in message.transforms}
            try:
                way = chain(list(self._frames), *pair)
            except DataError as error:
                if not is_static:
                    self._notes.append(("no frame", f"{error}"))
                return
            stamps = [nanoseconds_of(edges[step.edge].header.stamp) for step in way if step.edge in edges]
            if stamps and not is_static:
                p, q = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
                for step in way:
                    x = self._frames[step.edge][:, :3]
                    with np.errstate(invalid="ignore"):  # of zeros, which are no rotation: the listener says so
                        r = from_ros(self._frames[step.edge][:, 3:])
                    if not step.forward:
                        r = conjugate(r)
                        x = -rotated(r, x)
                    p, q = p + rotated(q, x), product(q, r)
                self._samples.append((1e-9 * max(stamps), [*p[0].tolist(), *to_ros(q)[0].tolist()]))

        self.node.create_subscription(message, "/tf", read, self._sensor)
        self.node.create_subscription(message, "/tf_static", lambda given: read(given, True), self._static)

    def send(self, symbol: Symbol) -> None:
        """Publish a symbol."""
        message = self._strings.String(data=json.dumps(symbol.to_dict()))
        self._symbols.publish(message)
        self._state.publish(message)

    def spin_until(self, future: Any, seconds: float) -> None:
        """Let the node work until something is done, or time is over."""
        self._executor.spin_until_future_complete(future, seconds)

    def tell(self, kind: str, sentence: str) -> None:
        """Say something with the next samples; an empty kind is news."""
        self._notes.append((kind, sentence))

    def close(self) -> None:
        """End the node."""
        self._executor.shutdown()
        self.node.destroy_node()
        with suppress(RuntimeError):
            self._context.shutdown()


def ros_module(name: str) -> Any:
    """Load a module of ROS 2; where there is none, a `DataError` says how to get it."""
    try:
        return import_module(name)
    except ImportError as error:
        package = name.partition(".")[0].replace("_", "-")
        raise DataError(
            f"expected the package {package} of ROS 2 to talk to it ({error}); source its setup.bash, with "
            f"ros-$ROS_DISTRO-{package} installed, and run kineme by the Python of ROS"
        ) from error


class ArmClient:
    """A client of an action FollowJointTrajectory: executes a symbol when its name comes on ``kineme/execute``.

    ``plan(name, positions)`` makes it a movement from where ``/joint_states`` says that the joints stand; a
    `KinemeError` refuses, and so do checks that fail. One movement at a time; what became of it is said on
    ``kineme/executed``. When the node ends, a movement under way is canceled.
    """

    def __init__(
        self, ros: RosNode, joints: tuple[str, ...], plan: Callable[[str, Array], RobotMovement], action: str = ACTION
    ) -> None:
        self._ros, self._joints, self._plan = ros, joints, plan
        self._messages, self._points = ros_module("control_msgs.action"), ros_module("trajectory_msgs.msg")
        self._durations, self._strings = ros_module("builtin_interfaces.msg"), ros_module("std_msgs.msg")
        follow = self._messages.FollowJointTrajectory
        self._client = ros_module("rclpy.action").ActionClient(ros.node, follow, action)
        self._executed = ros.node.create_publisher(self._strings.String, "kineme/executed", 10)
        ros.node.create_subscription(self._strings.String, "kineme/execute", self._execute, 10)
        states = ros_module("sensor_msgs.msg").JointState
        ros.node.create_subscription(states, "/joint_states", self._stand, 10)
        self._positions: Array | None = None
        self._stood = 0.0  # when they were told
        self._goal: Any = None  # of the movement under way
        self._busy = False

    def _stand(self, message: Any) -> None:
        place = dict(zip(message.name, message.position, strict=False))
        if set(self._joints) <= place.keys():
            self._positions = np.array([place[joint] for joint in self._joints], dtype=float)
            self._stood = time.monotonic()

    def _execute(self, message: Any) -> None:
        """Plan, check and send the movement of a name."""
        name = message.data
        try:
            if self._busy:
                raise SpecificationError("expected an arm at rest, a movement is under way")
            is_old = time.monotonic() - self._stood > _FRESH
            if is_old or self._positions is None or not np.isfinite(self._positions).all():
                raise SpecificationError(f"expected positions of {', '.join(self._joints)} on /joint_states, got none")
            if not self._client.server_is_ready():
                raise SpecificationError("expected a controller that offers the action, found none")
            movement = self._plan(name, self._positions)
            if not movement.preflight.passed:
                raise SpecificationError("expected a movement that passes its checks")
        except KinemeError as error:
            self._tell(name, "refused", str(error))
            return
        self._busy = True
        goal = self._messages.FollowJointTrajectory.Goal(trajectory=self._message(movement.trajectory))
        self._client.send_goal_async(goal).add_done_callback(lambda future: self._accepted(name, future.result()))

    def _message(self, trajectory: JointTrajectory) -> Any:
        points = [
            self._points.JointTrajectoryPoint(
                positions=positions.tolist(),
                velocities=velocities.tolist(),
                accelerations=accelerations.tolist(),
                time_from_start=self._durations.Duration(**stamp_of(seconds)),
            )
            for seconds, positions, velocities, accelerations in samples_of(trajectory)
        ]
        return self._points.JointTrajectory(joint_names=list(trajectory.joints), points=points)

    def _accepted(self, name: str, goal: Any) -> None:
        if not goal.accepted:
            self._busy = False
            self._tell(name, "refused", "by the controller")
            return
        self._goal = goal
        self._tell(name, "moving", "")
        goal.get_result_async().add_done_callback(lambda future: self._done(name, future.result()))

    def _done(self, name: str, ended: Any) -> None:
        self._goal, self._busy = None, False
        code, words = ended.result.error_code, ended.result.error_string
        is_done = ended.status == ros_module("action_msgs.msg").GoalStatus.STATUS_SUCCEEDED and not code
        self._tell(name, "done" if is_done else "failed", words or ("" if is_done else f"error {code}"))

    def _tell(self, name: str, state: str, reason: str) -> None:
        data = {"name": name, "state": state, "reason": reason}
        self._executed.publish(self._strings.String(data=json.dumps(data)))
        self._ros.tell("", f"execute {name!r}: {state}{f', {reason}' if reason else ''}")

    def send(self, symbol: Symbol) -> None:
        """Move nothing: what a person shows is no order."""

    def close(self) -> None:
        """Cancel a movement that is under way."""
        if self._goal is not None:
            self._ros.spin_until(self._goal.cancel_goal_async(), _CANCELED)
