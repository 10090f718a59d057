"""ROS 2: messages of a topic, or the pose of a frame, as samples; symbols as JSON; movements on an arm when asked for.

A node of rclpy, which comes with ROS 2, or as wheels that others build. Which fields of a message are numbers says the
table that bags are read by, `kineme.io.ros.number_fields`.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.io.ros.choose import Edge, Step, chain, edge_of, pair_of
from kineme.io.ros.number_fields import POSE, TRANSFORMS, TYPES, MessageType, nanoseconds_of, transform_row
from kineme.io.ros.streams import from_ros, to_ros
from kineme.movements.channels.column_match import Columns
from kineme.movements.rotations import conjugate, product, rotated
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export_files import TRAJECTORY, samples_of, stamp_of
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.sensors.listen import NOTHING, Block, Symbol
from kineme.validation import Array

_WAITING = 1000  # messages that wait to be read
_MOST_FRAMES = 10_000
_FRESH = 1.0  # seconds for which the positions of joints count
_CANCELED = 2.0  # seconds that the end of the node waits until an arm has been told to stop
_STRING = "std_msgs/msg/String"
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"  # that of ros2_control


class RosNode:
    """A node named "kineme": a source of samples of a topic or of two frames, and a sink that publishes symbols.

    ``kineme/symbol`` has each symbol as JSON in a std_msgs/String; ``kineme/state`` the last one, also for nodes that
    come later. The type of a topic is found when somebody publishes it. A `DataError` says what is not installed.
    """

    def __init__(self, topic: str | None = None, frame: str | None = None) -> None:
        rclpy, self._text = ros_module("rclpy"), _message_type(_STRING)
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # nobody else on the network
        self._qos = qos = ros_module("rclpy.qos")
        signals = ros_module("rclpy.signals").SignalHandlerOptions.NO  # Ctrl-C ends the loop, which ends the node
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=signals)
        self.node = rclpy.create_node("kineme", context=self._context)
        self.executor = ros_module("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self.executor.add_node(self.node)
        latched = qos.QoSProfile(depth=1, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self._symbols = self.node.create_publisher(self._text, "kineme/symbol", 10)
        self._state = self.node.create_publisher(self._text, "kineme/state", latched)
        self._sensor = qos.QoSProfile(depth=_WAITING, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
        self.columns: Columns | None = None
        self._topic = topic
        self._samples: deque[tuple[float, list[float]]] = deque(maxlen=_WAITING)
        self.notes: list[tuple[str, str]] = []  # what is said with the next samples
        if frame is not None:
            self._subscribe_frames(pair_of(frame))

    def receive(self, timeout: float) -> Block:
        """Let the node work until a sample comes, and return those that are there."""
        if self._topic is not None and self.columns is None:
            self._subscribe(self._topic)
        self.executor.spin_once(timeout_sec=timeout)
        for _ in range(len(self._samples) and _WAITING):
            count = len(self._samples)
            self.executor.spin_once(timeout_sec=0.0)
            if len(self._samples) == count:
                break
        notes, self.notes = self.notes, []
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
            self.node.create_subscription(_message_type(kind), name, self._reader(how), self._sensor)
            self.notes.append(("", f"listening to {name}, {kind}"))
            return
        self.notes.append(("no topic", f"waiting for somebody who publishes {name}"))

    def _reader(self, how: MessageType) -> Callable[[Any], None]:
        """Return what reads a message of a type."""

        def read(message: Any) -> None:
            try:
                heads, values = how.row(message) if how.row else ((), ())
            except ValueError as error:
                self.notes.append(("no sample", f"{error}"))
                return
            if self.columns is None and heads:
                self.columns = Columns(tuple(heads), (None,) * len(heads))
            wanted, place = self.columns.heads if self.columns else (), dict(zip(heads, values, strict=True))
            if heads and set(wanted) <= place.keys():
                stamp = nanoseconds_of(message.header.stamp) if how.has_header else 0
                self._samples.append((1e-9 * stamp if stamp else time.monotonic(), [place[head] for head in wanted]))
            elif heads:
                self.notes.append(("other values", f"expected {', '.join(wanted[:12])} in each message"))

        return read

    def _subscribe_frames(self, pair: Edge) -> None:
        """Follow the pose of one frame in another: at each transform of /tf on the way between them."""
        message, frames, way = _message_type(TRANSFORMS[0]), dict[Edge, Array](), list[Step]()
        self.columns = Columns(POSE, (None,) * len(POSE))

        def read(message: Any, is_static: bool = False) -> None:
            stamps = {edge_of(transform): nanoseconds_of(transform.header.stamp) for transform in message.transforms}
            count = len(frames)
            for edge, transform in zip(map(edge_of, message.transforms), message.transforms, strict=True):
                if edge in frames or len(frames) < _MOST_FRAMES:
                    frames[edge] = np.array([transform_row(transform.transform)])
            if len(frames) > count:
                try:
                    way[:] = chain(list(frames), *pair)
                except DataError as error:
                    self.notes.append(("no frame", f"{error}"))
            moved = [stamps[step.edge] for step in way if step.edge in stamps]
            if moved and not is_static:
                self._samples.append((1e-9 * max(moved), _pose_along(way, frames)))

        self.node.create_subscription(message, "/tf", read, self._sensor)
        static = self._qos.QoSProfile(depth=_WAITING, durability=self._qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(message, "/tf_static", lambda message: read(message, True), static)

    def send(self, symbol: Symbol) -> None:
        """Publish a symbol."""
        message = self._text(data=json.dumps(symbol.to_dict()))
        self._symbols.publish(message)
        self._state.publish(message)

    def close(self) -> None:
        """End the node."""
        self.executor.shutdown()
        self.node.destroy_node()
        with suppress(RuntimeError):
            self._context.shutdown()


def _pose_along(way: list[Step], frames: dict[Edge, Array]) -> list[float]:
    """Return the pose of the frame at the end of a way, in the one at its beginning."""
    p, q = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    for step in way:
        x = frames[step.edge][:, :3]
        with np.errstate(invalid="ignore"):  # of zeros, which are no rotation: the listener says so
            r = from_ros(frames[step.edge][:, 3:])
        if not step.forward:
            r = conjugate(r)
            x = -rotated(r, x)
        p, q = p + rotated(q, x), product(q, r)
    return [*p[0].tolist(), *to_ros(q)[0].tolist()]


def _message_type(kind: str) -> Any:
    package, _, name = kind.rpartition("/")
    return getattr(ros_module(package.replace("/", ".")), name)


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
        self._action, self._text = ros_module("control_msgs.action").FollowJointTrajectory, _message_type(_STRING)
        self._client = ros_module("rclpy.action").ActionClient(ros.node, self._action, action)
        self._executed = ros.node.create_publisher(self._text, "kineme/executed", 10)
        ros.node.create_subscription(self._text, "kineme/execute", self._execute, 10)
        ros.node.create_subscription(_message_type("sensor_msgs/msg/JointState"), "/joint_states", self._stand, 10)
        self._positions, self._stood = np.full(len(joints), np.nan), -math.inf  # and when they were told
        self._sent: Any = None  # of the movement under way: the future of the answer of the controller

    def _stand(self, message: Any) -> None:
        place = dict(zip(message.name, message.position, strict=False))
        if set(self._joints) <= place.keys():
            self._positions, self._stood = np.array([place[joint] for joint in self._joints]), time.monotonic()

    def _execute(self, message: Any) -> None:
        """Plan, check and send the movement of a name."""
        name = message.data
        try:
            if self._sent is not None:
                raise SpecificationError("expected an arm at rest, a movement is under way")
            if time.monotonic() - self._stood > _FRESH or not np.isfinite(self._positions).all():
                raise SpecificationError(f"expected positions of {', '.join(self._joints)} on /joint_states, got none")
            if not self._client.server_is_ready():
                raise SpecificationError("expected a controller that offers the action, found none")
            movement = self._plan(name, self._positions)
            if not movement.preflight.passed:
                raise SpecificationError("expected a movement that passes its checks")
        except KinemeError as error:
            self._tell(name, "refused", str(error))
            return
        self._sent = self._client.send_goal_async(self._action.Goal(trajectory=_message_of(movement.trajectory)))
        self._sent.add_done_callback(lambda future: self._accepted(name, future.result()))

    def _accepted(self, name: str, goal: Any) -> None:
        if goal.accepted:
            self._tell(name, "moving")
            goal.get_result_async().add_done_callback(lambda future: self._done(name, future.result()))
        else:
            self._sent = None
            self._tell(name, "refused", "by the controller")

    def _done(self, name: str, ended: Any) -> None:
        self._sent = None
        code = ended.result.error_code
        is_done = ended.status == _message_type("action_msgs/msg/GoalStatus").STATUS_SUCCEEDED and not code
        self._tell(
            name, "done" if is_done else "failed", ended.result.error_string or (f"error {code}" if code else "")
        )

    def _tell(self, name: str, state: str, reason: str = "") -> None:
        self._executed.publish(self._text(data=json.dumps({"name": name, "state": state, "reason": reason})))
        self._ros.notes.append(("", f"execute {name!r}: {state}{reason and ', '}{reason}"))

    def send(self, symbol: Symbol) -> None:
        """Move nothing: what a person shows is no order."""

    def close(self) -> None:
        """Cancel a movement that is under way, or about to be accepted."""
        if (sent := self._sent) is not None:
            self._ros.executor.spin_until_future_complete(sent, _CANCELED)
            if sent.done() and sent.result().accepted:
                self._ros.executor.spin_until_future_complete(sent.result().cancel_goal_async(), _CANCELED)


def _message_of(trajectory: JointTrajectory) -> Any:
    """Return a trajectory_msgs/JointTrajectory whose time stamp 0 controllers take as now."""
    duration, point = _message_type("builtin_interfaces/msg/Duration"), _message_type(f"{TRAJECTORY}Point")
    names = ("positions", "velocities", "accelerations")
    points = [
        point(**dict(zip(names, map(np.ndarray.tolist, values), strict=True)), time_from_start=duration(**stamp_of(t)))
        for t, *values in samples_of(trajectory)
    ]
    return _message_type(TRAJECTORY)(joint_names=list(trajectory.joints), points=points)
