"""Find the channels of recordings: by what the caller says, by the heads of their columns, and by their values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, SpecificationError
from kineme.movements.channels.channel import KINDS, ORDERS, Channel, Channels
from kineme.movements.channels.coordinates import (
    in_order,
    period_by_unit,
    period_of,
    with_periods,
    without_wraps,
    wrap_period,
)
from kineme.movements.rotations import NORM_TOLERANCE, angle_between, exp
from kineme.movements.tables.columns import DISCRETE_WORDS, column_numbers
from kineme.movements.tables.layout import listed
from kineme.movements.tables.time_stamps import words_of
from kineme.units import UNITS, split_head, unit_named
from kineme.validation import Array

_MOST = 0.9  # of the samples: columns w, x, y, z without another name are a quaternion if so many are of norm 1
_NORM = 0.01  # deviation of a norm from 1, at most
_NAMES = frozenset({"q", "quat", "quaternion", "quaternions", "orientation", "orientations", "ori", "rotation", "rot"})
_UNIT_BESIDE_PART = re.compile(
    r"[\[(](?![wxyz\d][\])])[^\[\]()]*[\])]\s*$", re.IGNORECASE
)  # that of quat[x] is a component
_COMPONENT = re.compile(r"(.*?)[\W_]*([wxyz])[\])]?([\W_]?\d+)?", re.IGNORECASE)
_IMAGINARY = re.compile(r"(.*?)[\W_]*([ijkrw])[\])]?([\W_]?\d+)?", re.IGNORECASE)  # as of w + x i + y j + z k
_AS_AXES = str.maketrans("ijkr", "xyzw")
_NUMBERED = re.compile(r"(.*?)[\W_]*([0-4])[\])]?")
_NUMBERINGS = ("0123", "1234")

_LETTERS = ("j", "q")  # robots count their joints so; textbooks write q for a joint's angle
_DIGITS = 3  # of a number, at most
_UNIT = re.compile(r"[\[(][^\[\]()\d]*[\])]\s*$")  # that of q[1] is a number

#: What the caller says of columns: heads separated by commas -> their kind; four of a quaternion -> its order.
Given = Mapping[str, str]

ANGLE_WORDS = frozenset(
    {
        "joint", "joints", "angle", "angles", "theta", "yaw", "pitch", "roll", "heading", "azimuth", "elevation",
        "euler", "rotation", "flexion", "abduction", "rad", "radian", "radians", "deg", "degree", "degrees",
    }
)  # fmt: skip
_OF_JOINTS = frozenset({"joint", "joints"})  # before an axis of a place: that of a body's joint, joints.hand.x
#: A column that has one of them is no angle, whatever else its head says: ``joint1_torque``, ``yaw rate``.
OTHER_QUANTITIES = frozenset(
    {
        "velocity", "velocities", "vel", "speed", "rate", "acceleration", "accelerations", "acc", "accel", "jerk",
        "torque", "torques", "tau", "effort", "efforts", "force", "forces", "voltage", "power", "temperature", "gyro",
        "omega", "currents", "load", "loads", "moment", "moments", "reaction", "stiffness", "damping", "pwm", "duty",
        "temp", "temperatures", "celsius", "fahrenheit", "status", "mode", "confidence", "likelihood",
    }
)  # fmt: skip
#: Ends of the names of a place and, after it, of a rotation vector; the last are those of ``actual_TCP_pose_0``.
_POSES = (("x", "y", "z", "rx", "ry", "rz"), ("tx", "ty", "tz", "rx", "ry", "rz"), tuple("012345"))
#: What the names of rotation vectors say, and their ends.
_TURNS, _ENDS = ("axisangle", "rotvec", "rotationvector"), ("xyz", "012", "123")
_OF_HEAT = re.compile(r"(?<![A-Za-z])(?i:deg(?:rees?|s)?)[\W_]*[CF](?![A-Za-z])")  # oil_deg_C
#: What joints are said to have where a position is meant.
_OF_POSITIONS = frozenset({"pos", "position", "positions", "state", "states", "value", "values", *_OF_JOINTS})
_PER_TIME = frozenset({"s", "sec", "second", "seconds", "per"})
#: Drivers of motors call a position so, ``wrist_roll.pos``, in degrees, radians or percent of the range alike.
_OF_MOTOR, _PERCENT, _TURN = "pos", 100.0, 2.0 * np.pi
_LEVELS = 8  # different values of a discrete channel, at most
#: Words of heads that are units: ``x_mm``, ``yaw_deg``. Others, as in and turn, are too often something else there.
_UNIT_WORDS = {
    name: unit.symbol
    for name, unit in UNITS.items()
    if (unit.quantity == "angle" and unit.symbol in {"deg", "rad", "mrad"})
    or (unit.quantity == "length" and (name in {"mm", "cm"} or (len(name) > 5 and name.endswith("s"))))
}

#: A coordinate in meters, ``hand_x_m``; an m elsewhere is too often something else.
_IN_METERS = re.compile(r"(?:.*[\W_])?[xyz][_ ]m", re.IGNORECASE)
_UNIT_WORD = re.compile(rf"[\W_]*(?<![a-z])({'|'.join(_UNIT_WORDS)})(?![a-z])", re.IGNORECASE)


def find_channels(
    heads: Sequence[str],
    columns: Array,
    offsets: NDArray[np.intp],
    given: Given,
    units: Sequence[str] = (),
    has_others: bool = False,
) -> Channels:
    """The channels of movements that have the same columns.

    The columns of a quaternion need not be side by side in the file; those of a channel are, see `in_order`. What
    several heads in `given` begin with before a dot stands for all of them. `units` of the columns, empty where the
    file does not say, are by default those in the heads. Columns that are all discrete are what moves, unless the
    movements have others beside them.
    """
    kinds, orientations = _given(heads, given)
    taken = {*kinds, *(k for orientation in orientations for k in orientation.columns)}
    free = [k for k in range(len(heads)) if k not in taken]
    orientations += find_quaternions(heads, free, columns, offsets)
    first = {min(orientation.columns): orientation for orientation in orientations}
    inside = {k for orientation in orientations for k in orientation.columns}
    numbered = find_numbered_joints(heads, [k for k in range(len(heads)) if k not in inside], columns)
    vectors = [three for three in rotation_vectors(heads) if not inside & {*three}]
    straight = {k for three in vectors if _turns_as_one(heads, three, columns, offsets, units) for k in three}
    channels: list[Channel] = []
    for k, head in enumerate(heads):
        if k in first:
            four, order = first[k]
            name = shared_name([heads[i] for i in four])
            channels.append(Channel(name, "orientation", tuple(heads[i] for i in four), None, order))
        elif k not in inside:
            unit = (units[k] if units else "") or unit_of(head)
            kind = "position" if k in straight else _kind(head, unit, columns[:, k], offsets, k in numbered)
            kind = kinds.get(k, kind)
            channels.append(Channel(head, kind, (head,), unit))
    if not has_others and all(channel.kind == "discrete" for channel in channels):
        return tuple(channel if k in kinds else channel._replace(kind="position") for k, channel in enumerate(channels))
    return with_periods(tuple(channels), in_order(columns, heads, tuple(channels)))


def units_filled(
    unit: str, heads: Sequence[str], columns: Array, offsets: NDArray[np.intp], given: Given, units: Sequence[str]
) -> tuple[str, ...]:
    """The units of columns as `find_channels` takes them; where the file says none, `unit` if it fits their kind.

    A unit of an angle fits angles, or whatever moves where there are none; a share of a range fits all; any other unit,
    as of a length, fits positions. A gripper has no other unit than its file says, and in no file another one.
    """
    found = find_channels(heads, columns, offsets, given, units)
    kinds = {head: channel.kind for channel in found for head in channel.columns}
    quantity = getattr(unit_named(unit), "quantity", "")
    fitting = {"angle"} if quantity == "angle" and "angle" in kinds.values() else {"position"}
    fits = [
        quantity == "range" or (kinds[head] in fitting and not DISCRETE_WORDS & {*words_of(head)}) for head in heads
    ]
    named = zip(units or [""] * len(heads), heads, fits, strict=True)
    return tuple(said or unit_of(head) or (unit if fit else "") for said, head, fit in named)


@lru_cache(maxsize=4096)  # the recordings of a folder have the same heads
def unit_of(head: str) -> str | None:
    """The unit in the head of a column: the text in brackets that it ends in, or a word for an angle or a length."""
    _, bracketed = split_head(head)
    if bracketed is not None:
        return bracketed
    words = words_of(head)
    if _IN_METERS.fullmatch(head):
        return "m"
    return (
        None
        if _PER_TIME & {*words} or _OF_HEAT.search(head)
        else next((_UNIT_WORDS[word] for word in words if word in _UNIT_WORDS), None)
    )


def name_of(head: str) -> str:
    """The head of a column without its unit: ``x [mm]`` and ``x_mm`` are x."""
    stem, bracketed = split_head(head)
    if bracketed is not None or unit_of(head) is None:
        return stem.strip()
    if _IN_METERS.fullmatch(head):
        return head[:-2]
    return _UNIT_WORD.sub("", head).strip("_. -") or head


def _given(heads: Sequence[str], given: Given) -> tuple[dict[int, str], list[Quaternion]]:
    """Column -> kind, and the quaternions, as the caller says."""
    if not isinstance(given, Mapping):
        raise SpecificationError(f"expected kinds by heads of columns, such as {{'x': 'position'}}, got {given!r}")
    kinds: dict[int, str] = {}
    orientations: list[Quaternion] = []
    for key, kind in given.items():
        columns = _columns_named(heads, key)
        taken = {*kinds, *(k for orientation in orientations for k in orientation.columns)}
        if twice := [heads[k] for k in columns if k in taken or columns.count(k) > 1]:
            raise SpecificationError(f"expected one kind of each column, got several of {twice[0]!r}; say one")
        if kind in ORDERS and len(columns) == len(kind):
            orientations.append(quaternion_of(columns, kind))
        elif kind in KINDS and kind != "orientation":
            kinds.update(dict.fromkeys(columns, kind))
        else:
            raise SpecificationError(
                f"expected the kind of {key!r} to be one of position, angle, discrete, or for four columns of a "
                f"quaternion {' or '.join(ORDERS)}, got {kind!r}"
            )
    return kinds, orientations


def kinds_of(given: Given, columns: Sequence[str]) -> dict[str, str]:
    """Return the given kinds that are of these columns."""
    named = {key: {key} if key in columns else {name.strip() for name in key.split(",")} for key in given}
    return {key: given[key] for key, names in named.items() if names <= {*columns}}


def _columns_named(heads: Sequence[str], key: str) -> list[int]:
    """The columns that a key names: a head, several separated by commas, or what several begin with before a dot."""
    if key in heads:
        return [list(heads).index(key)]
    names = [name.strip() for name in key.split(",")]
    bare = [*map(name_of, heads)], [*map(name_of, names)]  # a converted column ends in another unit
    for ours, theirs in ((heads, names), bare):
        with suppress(DataError):
            return [*column_numbers(ours, theirs)]
    raise SpecificationError(f"expected the kind of a column that is read, got {key!r}; read are {listed(heads)}")


def _kind(head: str, unit: str | None, values: Array, offsets: NDArray[np.intp], is_joint: bool) -> str:
    in_order = words_of(head)
    words = set(in_order)
    if words & DISCRETE_WORDS and len(np.unique(values)) <= _LEVELS:
        return "discrete"
    measure = unit_named(unit or "")
    rate = "/" in (unit or "") or (words & _PER_TIME and words & set(_UNIT_WORDS))
    if rate or _says_other(head) or (measure is not None and measure.quantity != "angle"):
        return "position"
    of_angles = words & ANGLE_WORDS - (_OF_JOINTS if {*in_order[-1:]} & {*"xyz"} else frozenset())
    named = of_angles and not (_OF_MOTOR in words and unit is None and _may_be_percent(values))
    if is_joint or measure is not None or wrap_period(values, offsets) is not None:
        return "angle"
    # What follows "joint", as in joint1_pressure, may be any quantity: such jumps are then taken for no wraps.
    other = of_angles <= _OF_JOINTS and not {*[word for word in in_order if not word.isdecimal()][-1:]} & _OF_POSITIONS
    jumps = other and without_wraps(values, offsets, period_of(values, None)) is not values
    return "angle" if named and not jumps else "position"


def _says_other(head: str) -> bool:
    """Tell whether a head names a quantity that is no angle; ``joint1_current`` does, ``current_yaw`` does not."""
    words = words_of(head)
    last = [word for word in words_of(name_of(head)) if not word.isdecimal()][-1:]
    return bool({*words} & OTHER_QUANTITIES) or last == ["current"] or _OF_HEAT.search(head) is not None


def rotation_vectors(heads: Sequence[str]) -> list[tuple[int, ...]]:
    """Return the columns that are rotation vectors by their names: ``rotvec_x``, or ``rx`` beside a place ``x``."""
    stems: dict[tuple[str, ...], dict[str, int]] = {}
    for k, head in enumerate(heads):
        *stem, end = words_of(name_of(head)) or ("",)
        stems.setdefault(tuple(stem), {})[end] = k
    found = []
    for words, ends in stems.items():
        poses = [pose for pose in _POSES if {*pose} <= {*ends} and (pose[0] != "0" or "pose" in words)]
        if _says_vector(words) and "".join(sorted(ends)) in _ENDS:
            poses.append(tuple(sorted(ends)))
        if not {*words} & {"joint", *OTHER_QUANTITIES}:
            found += [tuple(ends[end] for end in pose[-3:]) for pose in poses]
    return found


def _says_vector(words: Sequence[str]) -> bool:
    return "".join(words).endswith(_TURNS)


def _turns_as_one(
    heads: Sequence[str], three: tuple[int, ...], columns: Array, offsets: NDArray[np.intp], units: Sequence[str]
) -> bool:
    """Tell whether columns that are named as a rotation vector are none of three angles by their values.

    Longer than half a turn ``rx``, ``ry``, ``rz`` are angles of Euler. Each angle loses its wraps by itself: where that
    changes a rotation vector, but not the rotation, as about one axis alone, it may well be taken for angles.
    """
    unit = (units[three[0]] if units else "") or unit_of(heads[three[0]])
    period = period_by_unit(unit or "rad")
    vectors = columns[:, three] * (_TURN / (period or np.nan))
    longest = np.linalg.norm(vectors, axis=1).max(initial=0.0)
    if not longest <= (np.inf if _says_vector(words_of(heads[three[0]])[:-1]) else (1.0 + NORM_TOLERANCE) * np.pi):
        return False
    apart = np.column_stack([without_wraps(x, offsets, _TURN) for x in vectors.T])
    return bool((apart == vectors).all()) or bool(angle_between(exp(apart), exp(vectors)).max() > NORM_TOLERANCE)


def _may_be_percent(values: Array) -> bool:
    """Tell whether values may be shares of a range, -100 to 100: too large for radians, and of no turn in degrees."""
    largest = float(np.abs(values).max(initial=0.0))
    return _TURN < largest <= _PERCENT


def find_numbered_joints(heads: Sequence[str], free: Sequence[int], columns: Array) -> set[int]:
    """Those of the columns `free` that are joints: several, as q1, q2, that count from 0 or 1, each within a turn."""
    groups: dict[tuple[str, ...], dict[int, int]] = {}
    for k in free:
        *stem, number = words_of(_UNIT.sub("", heads[k])) or ("",)
        if number.isdecimal() and len(number) <= _DIGITS and stem and stem[-1] in _LETTERS:
            groups.setdefault(tuple(stem), {})[int(number)] = k
    return {k for group in groups.values() if _count_joints(group, columns) for k in group.values()}


def _count_joints(group: dict[int, int], columns: Array) -> bool:
    """Tell whether the numbers of a group, and the values in its columns, are those of joints."""
    numbers = sorted(group)
    counts = len(numbers) > 1 and numbers[0] in (0, 1) and numbers[-1] - numbers[0] == len(numbers) - 1
    return counts and all(np.isfinite(period_of(columns[:, k], None)) for k in group.values())


class Quaternion(NamedTuple):
    """The columns of a quaternion, and the order of its components in them, one of `ORDERS`."""

    columns: tuple[int, ...]
    order: str


def quaternion_of(columns: Sequence[int], order: str) -> Quaternion:
    """A quaternion of columns in any order: in that of the file where it is one of `ORDERS`, else as w, x, y, z."""
    by_part = dict(zip(order, columns, strict=True))
    in_file = "".join(sorted(by_part, key=by_part.__getitem__))
    order = in_file if in_file in ORDERS else ORDERS[0]
    return Quaternion(tuple(by_part[part] for part in order), order)


def find_quaternions(
    heads: Sequence[str], free: Sequence[int], columns: Array, offsets: NDArray[np.intp]
) -> list[Quaternion]:
    """The quaternions in the columns `free`: four w, x, y, z or i, j, k, r of one name, or four that are numbered."""
    quaternions = []
    groups = [*_groups(_COMPONENT, heads, free).items()]
    groups += [item for item in _groups(_IMAGINARY, heads, free).items() if {*"ijk"} < {*item[1]}]
    for (stem, _), parts in groups:
        order = "".join(parts).translate(_AS_AXES)
        if sorted(order) == [*"wxyz"] and (_NAMES & {*words_of(stem)} or _unit_norms(columns[:, [*parts.values()]])):
            quaternions.append(quaternion_of([*parts.values()], order))
    for (stem, _), parts in _groups(_NUMBERED, heads, free).items():
        four = [parts[part] for part in sorted(parts)]
        if "".join(sorted(parts)) in _NUMBERINGS and _NAMES & {*words_of(stem)} and _unit_norms(columns[:, four]):
            quaternions.append(quaternion_of(four, _order_of([heads[k] for k in four], columns[:, four], offsets)))
    return quaternions


def shared_name(heads: Sequence[str]) -> str:
    """Return what the heads of a quaternion's columns share: "pose.orientation" of pose.orientation.x and so on."""
    head = _plain(heads[0])
    match = _COMPONENT.fullmatch(head) or _NUMBERED.fullmatch(head)
    imaginary = [*filter(None, (_IMAGINARY.fullmatch(_plain(each)) for each in heads))]
    if len({found[2].lower() for found in imaginary}) == len(heads):
        match = imaginary[0]
    return ((match[1] if match else "") or "orientation") + ((match[3] or "") if match and match.re.groups > 2 else "")


def _groups(
    pattern: re.Pattern[str], heads: Sequence[str], free: Sequence[int]
) -> Mapping[tuple[str, str], dict[str, int]]:
    """Group columns: beginning and end of their heads -> their components -> the columns."""
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for k in free:
        if match := pattern.fullmatch(_plain(heads[k])):
            end = (match[3] or "") if pattern.groups > 2 else ""
            groups.setdefault((match[1].lower(), end), {})[match[2].lower()] = k
    return groups


def _plain(head: str) -> str:
    return _UNIT_BESIDE_PART.sub("", head).strip()


def _unit_norms(q: Array) -> bool:
    return bool((np.abs(np.linalg.norm(q, axis=1) - 1.0) < _NORM).mean() >= _MOST)


def _order_of(heads: Sequence[str], q: Array, offsets: NDArray[np.intp]) -> str:
    """The order of a numbered quaternion, whose signs change where its scalar would become negative.

    Many programs write no negative scalar. Its column then stays so on both sides of every change of sign, which the
    other end of the quaternion does not.
    """
    changes = (q[1:] * q[:-1]).sum(axis=1) < 0
    changes[offsets[1:-1] - 1] = False
    beside = np.concatenate((q[:-1][changes], q[1:][changes]))
    scalar_first, scalar_last = ((beside[:, k] >= 0).all() and (beside[:, k] > 0).any() for k in (0, 3))
    if scalar_first != scalar_last:
        return ORDERS[0] if scalar_first else ORDERS[1]
    names = ",".join(heads)
    raise SpecificationError(
        f"expected heads that say which part of the quaternion {names} is its scalar w, got numbers; say "
        f"kinds={{'{names}': 'wxyz'}} if it is the first, 'xyzw' if it is the last, in the shell --kind {names}=wxyz"
    )


#: Sensors of motion, as heads of columns and names of files say them.
SENSORS = frozenset({"accelerometer", "gyroscope", "gyro", "magnetometer", "gravity", "barometer"})
#: Columns with one of them are no places, though they have three axes.
NO_PLACES = OTHER_QUANTITIES - {"load", "loads"} | SENSORS | {"imu", "mag", "magnetic", "emg", "euler"}
_SIDES = ({"l", "r"}, {"left", "right"})  # lx beside rx; without it rx is a rotation


def point_names(channels: Channels | None) -> tuple[str, ...]:
    """Return names of the points whose x, y, z or x, y the columns are, one after the other; none of anything else."""
    return _points_in_turn(_names_and_axes(channels or ()))


def points_apart(channels: Channels | None) -> tuple[str, ...]:
    """Return names of columns in which the points that they name come one after the other, where they do not."""
    of_columns = _names_and_axes(channels or ())
    stems = [stem for stem, _ in of_columns]
    order = sorted(range(len(stems)), key=lambda k: (stems.index(stems[k]), of_columns[k][1]))
    if order == sorted(order) or not _points_in_turn([of_columns[k] for k in order]):
        return ()
    return tuple(name_of((channels or ())[k].name) for k in order)


def _points_in_turn(of_columns: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    for axes in ("xyz", "xy"):
        n, d = len(of_columns), len(axes)
        if n < 2 * d or n % d:
            continue
        points = [of_columns[k : k + d] for k in range(0, n, d)]
        stems = [point[0][0] for point in points]
        if "" in stems and not all(stem.isdecimal() for stem in stems if stem):  # x, y, z only beside x2, y2, z2
            continue
        if len({*stems}) == len(stems) and all(
            [axis for _, axis in point] == [*axes] and len({stem for stem, _ in point}) == 1 for point in points
        ):
            return tuple(stem or axes for stem in stems)
    return ()


def _names_and_axes(channels: Channels) -> list[tuple[str, str]]:
    """Return what each column belongs to, and which coordinate it is; empty where that is not told."""
    of_columns = [words_of(name_of(channel.name)) for channel in channels]
    if {"_".join(words)[:-1] for words in of_columns} in _SIDES:
        of_columns = [(words[0][:-1], words[0][-1]) for words in of_columns]
    return [
        _name_and_axis(words) if channel.kind == "position" and not {*words} & NO_PLACES else ("", "")
        for channel, words in zip(channels, of_columns, strict=True)
    ]


def _name_and_axis(words: tuple[str, ...]) -> tuple[str, str]:
    if {*words[-1:]} & {"x", "y", "z"}:
        return "_".join(words[:-1]), words[-1]
    if {*words[:1]} & {"x", "y", "z"}:
        return "_".join(words[1:]), words[0]
    return ("_".join(words[:-1]), words[-1][1]) if {*words[-1:]} & {"px", "py", "pz"} else ("", "")  # p: position
