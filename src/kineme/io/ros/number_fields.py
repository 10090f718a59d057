"""Messages as numbers: a row of named numbers, or a movement of its own.

Those of known types are decoded by the definitions that come with rosbags, and refused if their checksum differs. Of
the definitions in a bag rosbags makes program code, which a recording must not make run: the numbers of other types are
found by these definitions without it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.ros.bags import Bag, Topic, refused

Heads = tuple[str, ...]
Row = Sequence[float]

POSE: Heads = (*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw"))
_TRANSFORM: Heads = (*(f"translation.{axis}" for axis in "xyz"), *(f"rotation.{axis}" for axis in "xyzw"))
_TWIST: Heads = (*(f"linear.{axis}" for axis in "xyz"), *(f"angular.{axis}" for axis in "xyz"))

_pose_row: Callable[[Any], Row] = attrgetter(*POSE)
transform_row: Callable[[Any], Row] = attrgetter(*_TRANSFORM)  # the numbers of `POSE`

#: The types of messages with transforms between frames.
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


class MessageType(NamedTuple):
    """The way in which messages of a type are read."""

    # Message -> heads and numbers of one sample; no heads: the message holds no sample.
    row: Callable[[Any], tuple[Heads, Row]] | None = None
    # Message -> heads, stamps [ns] and rows of a whole movement. `row` or `path` is given.
    path: Callable[[Any], tuple[Heads, list[int], list[Row]]] | None = None
    has_header: bool = False  # whether a message tells its own time


def nanoseconds_of(time: Any) -> int:
    """Return a time or a duration of ROS [ns]."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def _joint_state(message: Any) -> tuple[Heads, Row]:
    """Return positions of joints under their names; a message of velocities or efforts alone holds no sample."""
    row = message.position.tolist()
    if not row:
        return (), ()
    if len(message.name) != len(row):
        raise ValueError(f"expected a position for each joint, got {len(message.name)} names and {len(row)} positions")
    return tuple(message.name), row


def _pose_array(message: Any) -> tuple[Heads, Row]:
    heads = tuple(f"poses.{k}.{head}" for k in range(len(message.poses)) for head in POSE)
    return heads, [number for pose in message.poses for number in _pose_row(pose)]


def _numbers(message: Any) -> tuple[Heads, Row]:
    row = message.data.tolist()
    return tuple(f"data.{k}" for k in range(len(row))), row


def _joint_trajectory(message: Any) -> tuple[Heads, list[int], list[Row]]:
    heads = tuple(message.joint_names)
    rows = [point.positions.tolist() for point in message.points]
    if odd := next((len(row) for row in rows if len(row) != len(heads)), None):
        raise ValueError(f"expected a position for each of {len(heads)} joints, got {odd}")
    if any(not row for row in rows):
        raise ValueError("expected points with positions, got some without")
    return heads, [nanoseconds_of(point.time_from_start) for point in message.points], rows


def _path(message: Any) -> tuple[Heads, list[int], list[Row]]:
    stamps = [nanoseconds_of(pose.header.stamp) for pose in message.poses]
    return POSE, stamps, [_pose_row(pose.pose) for pose in message.poses]


def _below(path: str, heads: Heads, fields: Sequence[str] = ()) -> Callable[[Any], tuple[Heads, Row]]:
    """Return the reader of the fields below a path, which are called as the heads unless they are named."""
    row = attrgetter(*(f"{path}{field}" for field in fields or heads))
    return lambda message: (heads, row(message))


#: Name of a type -> how its messages are read; those of `TRANSFORMS` are composed, see `kineme.io.ros.choose`.
TYPES: dict[str, MessageType] = {
    "sensor_msgs/msg/JointState": MessageType(_joint_state, has_header=True),
    "geometry_msgs/msg/Pose": MessageType(_below("", POSE)),
    "geometry_msgs/msg/PoseStamped": MessageType(_below("pose.", POSE), has_header=True),
    "geometry_msgs/msg/PoseWithCovarianceStamped": MessageType(_below("pose.pose.", POSE), has_header=True),
    "geometry_msgs/msg/PoseArray": MessageType(_pose_array, has_header=True),
    "geometry_msgs/msg/TransformStamped": MessageType(_below("transform.", POSE, _TRANSFORM), has_header=True),
    "geometry_msgs/msg/Twist": MessageType(_below("", _TWIST)),
    "geometry_msgs/msg/TwistStamped": MessageType(_below("twist.", _TWIST), has_header=True),
    "geometry_msgs/msg/PointStamped": MessageType(_below("point.", POSE[:3], "xyz"), has_header=True),
    "geometry_msgs/msg/Vector3Stamped": MessageType(_below("", ("vector.x", "vector.y", "vector.z")), has_header=True),
    "nav_msgs/msg/Odometry": MessageType(_below("pose.pose.", POSE), has_header=True),
    "nav_msgs/msg/Path": MessageType(path=_path),
    "trajectory_msgs/msg/JointTrajectory": MessageType(path=_joint_trajectory),
    "std_msgs/msg/Float64MultiArray": MessageType(_numbers),
    "std_msgs/msg/Float32MultiArray": MessageType(_numbers),
}


_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"

_FORMATS = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_WIDEST, _DEEPEST, _LONGEST = 1000, 20, 200_000  # numbers in a row, types in types, characters of a definition
_ORIGIN = 4  # bytes in front of a message of ROS 2, from which on it is aligned


class Step(NamedTuple):
    """The next part of a message: numbers of some formats, or a text, or elements that are no columns."""

    formats: str = ""
    heads: tuple[str, ...] = ()
    element: tuple[Step, ...] | None = None  # of a sequence, or of an array that is too long for columns
    length: int | None = None  # number of elements; None: the message says it


class Numbers(NamedTuple):
    """The numbers of a message, and the stamp of its header [ns]."""

    row: list[float]
    stamp: int


class NumberFields(NamedTuple):
    """The places of the numbers of a type: columns by the path of their field, ``angular_velocity.x``, ``ranges.0``."""

    type: str
    version: int  # of ROS
    steps: tuple[Step, ...]
    heads: tuple[str, ...]  # of the columns
    samples: tuple[int, ...]  # places of the columns among all numbers
    stamp: tuple[int, ...]  # places of seconds and nanoseconds; none where messages do not tell their own time

    @classmethod
    def of(cls, name: str, version: int, steps: tuple[Step, ...]) -> NumberFields:
        """Find the columns and the stamp among the numbers of the steps."""
        names = [head for step in steps for head in step.heads]
        samples = tuple(k for k, head in enumerate(names) if not head.startswith("header."))
        stamp = tuple(map(names.index, _STAMP)) if _STAMP[1] in names else ()
        return cls(name, version, steps, tuple(names[k] for k in samples), samples, stamp)

    def decode(self, raw: bytes) -> Numbers:
        """Return the numbers in the bytes of a message; a `ValueError` if they are of another type, or cut off."""
        is_2 = self.version == 2
        if is_2 and (len(raw) < _ORIGIN or raw[0] != 0 or raw[1] > 1):
            raise ValueError(f"expected a {self.type}, got no bytes in CDR")
        row: list[float] = []
        try:
            end = _read(self.steps, raw, _ORIGIN if is_2 else 0, ">" if is_2 and not raw[1] else "<", is_2, row)
        except struct.error as error:
            raise ValueError(f"expected a {self.type}, got {len(raw)} bytes, which are too few") from error
        if not is_2 and end != len(raw):
            raise ValueError(f"expected a {self.type}, got {len(raw)} bytes for {end}")
        seconds, nanoseconds = (int(row[k]) for k in self.stamp) if self.stamp else (0, 0)
        return Numbers([row[k] for k in self.samples], seconds * 1_000_000_000 + nanoseconds)


def number_fields(bag: Bag, topic: Topic) -> NumberFields:
    """Find the numbers of a topic, by the definition in the bag or, without one, by that of the standard type."""
    definitions = {connection.msgdef.data: connection.msgdef for connection in topic.connections}
    where = f"topic {topic.name}: expected the definition of {topic.type}"
    if len(definitions) > 1:
        raise DataError(f"{where}, got several that differ; convert the topic to CSV")
    (text, definition), *_ = definitions.items()
    if len(text) > _LONGEST:
        raise DataError(f"{where} of at most {_LONGEST:,} characters, got {len(text):,}; convert the topic to CSV")
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    with refused(where, "convert the topic to CSV"):
        types = {**get_typestore(Stores.ROS1_NOETIC if bag.version == 1 else Stores.LATEST).fielddefs}
        if text.strip():
            is_idl = definition.format.name == "IDL"
            types |= get_types_from_idl(text) if is_idl else get_types_from_msg(text, topic.type)
        steps = tuple(_steps(types, topic.type, "", bag.version, _DEEPEST))
    fields = NumberFields.of(topic.type, bag.version, steps)
    if not fields.heads:
        raise DataError(f"topic {topic.name}: expected numbers in messages of {topic.type}, got none")
    return fields


def _steps(types: Mapping[str, Any], name: str, prefix: str, version: int, deep: int) -> list[Step]:
    """Return the steps of a type; numbers that follow each other are one step."""
    if not deep:
        raise DataError(f"expected types within types at most {_DEEPEST} deep, got more")
    steps: list[Step] = []
    for field, described in types[name][1]:
        for step in _steps_of_field(types, described, f"{prefix}{field}", version, deep):
            if step.formats and steps and steps[-1].formats:
                steps[-1] = Step(steps[-1].formats + step.formats, steps[-1].heads + step.heads)
            else:
                steps.append(step)
    return steps


def _steps_of_field(types: Mapping[str, Any], described: Any, path: str, version: int, deep: int) -> list[Step]:
    kind, about = described[0].name, described[1]
    if kind == "NAME":
        return _steps(types, about, f"{path}.", version, deep - 1)
    if kind == "BASE":
        base = about[0]
        if base == "string":
            return [Step()]
        if base not in _FORMATS:
            raise DataError(f"expected numbers and texts, got {base} in {path}")
        return [Step("b" if base == "byte" and version == 1 else _FORMATS[base], (path,))]
    inner, count = about
    element = _steps_of_field(types, inner, path, version, deep - 1)
    if kind == "SEQUENCE":
        return [Step(element=tuple(element))]
    width = sum(len(step.heads) for step in element)
    if not element or not 0 < width * count <= _WIDEST:
        return [Step(element=tuple(element), length=count)] if element else []
    return [step for k in range(count) for step in _steps_of_field(types, inner, f"{path}.{k}", version, deep - 1)]


def _read(steps: tuple[Step, ...], raw: bytes, at: int, order: str, aligned: bool, row: list[float]) -> int:
    """Read numbers into a row; where the message goes on."""
    for step in steps:
        if step.formats:
            layout = _layout(step.formats, (at - _ORIGIN) % 8 if aligned else -1, order)
            row += layout.unpack_from(raw, at)
            at += layout.size
            continue
        count = step.length
        if count is None:
            layout = _layout("I", (at - _ORIGIN) % 8 if aligned else -1, order)
            (count,) = layout.unpack_from(raw, at)
            at += layout.size
        if step.element is None:
            at += count
        elif len(step.element) == 1 and len(step.element[0].formats) == 1 and count:
            layout = _layout(step.element[0].formats, (at - _ORIGIN) % 8 if aligned else -1, order)
            at += layout.size + (count - 1) * struct.calcsize(f"={step.element[0].formats}")
        elif step.element:
            passed: list[float] = []
            for _ in range(count):
                at = _read(step.element, raw, at, order, aligned, passed)
                passed.clear()
        if at > len(raw):
            raise ValueError(f"expected {at} bytes, got {len(raw)}")
    return at


@lru_cache(maxsize=4096)
def _layout(formats: str, phase: int, order: str) -> struct.Struct:
    """Place numbers in a row from an offset modulo 8 on, each at a multiple of its size; phase -1: no padding."""
    offset, padded = max(phase, 0), order
    for code in formats:
        size = struct.calcsize(f"={code}")
        gap = 0 if phase < 0 else -offset % size
        padded += "x" * gap + code
        offset += gap + size
    return struct.Struct(padded)


def decoder_of(bag: Bag, topic: Topic) -> Callable[[bytes], Any]:
    """Return the function that decodes the bytes of a message; it raises `ValueError` if they are none."""
    store = standard_types(bag.version)
    expected = _digest(store, bag.version, topic.type)
    for connection in topic.connections:
        if connection.digest and connection.digest not in (expected, "*"):
            raise DataError(
                f"topic {topic.name}: expected messages of the standard type {topic.type}, got another version of it, "
                "by its checksum; convert the topic to CSV where that type is installed"
            )
    definition = store.get_msgdef(topic.type)
    is_1, cls = bag.version == 1, definition.cls
    parse = definition.deserialize_ros1 if is_1 else None
    little, big = definition.deserialize_cdr_le, definition.deserialize_cdr_be

    def decode(raw: bytes) -> Any:
        try:
            if parse is not None:
                message, end = parse(raw, 0, cls, store)
                if end != len(raw):
                    raise ValueError(f"{len(raw)} bytes for {end}")
                return message
            if raw is None or len(raw) < 4 or raw[0] != 0 or raw[1] > 1:
                raise ValueError("no bytes in CDR")
            # Bytes that follow are padding: writers in Python leave some.
            return (little if raw[1] else big)(raw[4:], 0, cls, store)[0]
        except MemoryError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ValueError(f"expected a {topic.type}, got {reason}") from error

    return decode


@cache
def standard_types(version: int) -> Any:
    """Return the store of the standard types of ROS, of rosbags."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.LATEST)
    for name in TRANSFORMS:  # in ROS 1 both names have one definition
        if name not in store.types:
            store.register(get_types_from_msg(_TF_DEFINITION, name))
    return store


@cache
def _digest(store: Any, version: int, name: str) -> str:
    return str(store.generate_msgdef(name)[1] if version == 1 else store.hash_rihs01(name))
