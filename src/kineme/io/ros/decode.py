"""Decode messages by the definitions of their types that come with rosbags.

Those in a bag are not used: rosbags makes program code of them, and a recording must not make programs run. A type that
differs from its standard is refused where the bag says so, by the checksum of its definition.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from kineme.errors import DataError
from kineme.io.ros.bags import Bag, Topic

#: In ROS 1 both names of the type of /tf have one definition.
_TF_1 = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"


def decoder_of(bag: Bag, topic: Topic) -> Callable[[bytes], Any]:
    """What makes a message of the bytes of one; it raises `ValueError` if they are none.

    Raises
    ------
    DataError
        The bag holds the type in another version than the standard one.
    """
    store = standard_types(bag.version)
    _check_version(store, bag.version, topic)
    known = store.get_msgdef(topic.type)
    is_1, cls = bag.version == 1, known.cls
    parse = known.deserialize_ros1 if is_1 else None
    little, big = known.deserialize_cdr_le, known.deserialize_cdr_be

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
    """The store of the standard types of ROS, of rosbags."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.LATEST)
    for name in _TF_1:
        if name not in store.types:
            store.register(get_types_from_msg(_TF_DEFINITION, name))
    return store


def _check_version(store: Any, version: int, topic: Topic) -> None:
    expected = _digest(store, version, topic.type)
    for one in topic.connections:
        if one.digest and one.digest not in (expected, "*"):
            raise DataError(
                f"topic {topic.name}: expected messages of the standard type {topic.type}, got another version of it, "
                "by its checksum; convert the topic to CSV where that type is installed"
            )


@cache
def _digest(store: Any, version: int, name: str) -> str:
    return str(store.generate_msgdef(name)[1] if version == 1 else store.hash_rihs01(name))
