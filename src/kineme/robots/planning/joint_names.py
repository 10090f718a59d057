"""Which columns of a recording are the joints of an arm, by their names."""

from __future__ import annotations

from collections.abc import Sequence

from kineme.errors import TrajectoryError, warn
from kineme.movements.channels.detect import name_of
from kineme.movements.tables.time_stamps import words_of
from kineme.robots.models.robot import Robot
from kineme.units import split_head

DRIVERS = ".pos"  # names of LeRobot's drivers end in it: shoulder_pan.pos
#: Words of columns that say how joints move, and not where they are.
_RATES = frozenset(
    ("velocity", "velocities", "vel", "acceleration", "accelerations", "acc", "effort", "torque", "current")
)
_SIDES = ("left", "right")  # what names of two arms begin with
_Words = tuple[str, ...]


def joints_among(names: Sequence[str], robot: Robot) -> list[int] | None:
    """Which of the columns is each joint of an arm, by its name; None unless every joint has exactly one.

    Units, what stands before the name of the joint as that of a feature or a topic, the ``.pos`` of LeRobot's drivers,
    and the side of one arm of two, as ``left_elbow_flex``, are no part of it. Without such names, those columns are
    the joints in which all words of their names stand, as ``ur5_elbow_joint_position``; or, of as many columns as
    joints, those that differ from one another by the same words as the joints, as ``elbow`` or ``q1``.

    Columns of velocities, accelerations and efforts are no joints.

    Raises
    ------
    TrajectoryError
        Every joint is there for both sides, or several times and nothing else.
    """
    names = ["" if _is_rate(name) else name for name in names]
    plain = [split_head(name)[0].removesuffix(DRIVERS) for name in names]
    places = [_places(plain, joint) for joint in robot.joints]
    if (exact := _single(places)) is not None:
        return exact
    if all(places) and {*names} == {names[k] for each in places for k in each}:
        joint, several = max(zip(robot.joints, places, strict=True), key=lambda one: len(one[1]))
        raise TrajectoryError(
            f"expected one column for each joint, got {', '.join(names[k] for k in several)} for {joint}; choose with "
            f"columns=, in the shell --columns '{plain[several[0]].removesuffix(joint)}*'"
        )
    sides = {side: _single([_places(plain, f"{side}_{joint}") for joint in robot.joints]) for side in _SIDES}
    sides = {side: columns for side, columns in sides.items() if columns is not None}
    if len(sides) > 1:
        raise TrajectoryError(
            f"expected the joints of one arm, got those of two, {' and '.join(sides)}; choose one with columns=, in "
            f"the shell --columns '{next(iter(sides))}_*'"
        )
    for columns in sides.values():
        return columns
    words, joints = [words_of(name_of(name)) for name in names], list(map(words_of, robot.joints))
    return _single(_holding(words, joints)) or _differing(words, joints)


def check_order(names: Sequence[str], robot: Robot) -> None:
    """Say that columns, as many as joints and of other names, are taken as these one after the other.

    Raises
    ------
    TrajectoryError
        Velocities; a column at the place of another joint than its name says, or numbers that do not rise.
    """
    rates = list(filter(_is_rate, names))
    if rates:
        raise TrajectoryError(f"expected positions of the joints, got {', '.join(rates)}; choose other columns")
    words, joints = [words_of(name_of(name)) for name in names], _different(list(map(words_of, robot.joints)))
    listed = ", ".join(names)
    for k, holding in enumerate(_holding(words, joints)):
        if len(holding) == 1 and holding[0] != k and not all(map(str.isdecimal, joints[k])):
            raise TrajectoryError(
                f"expected columns with the names of the joints of {robot.name}, {', '.join(robot.joints)}, in any "
                f"order, or without names in this order, got {listed}; rename the columns"
            )
    numbers = [int(last[-1]) for last in _different(words) if len(last) == 1 and last[-1].isdecimal()]
    if len(numbers) == len(words) and numbers != sorted(numbers):
        raise TrajectoryError(f"expected the joints in the order of their numbers, got {listed}; order the columns")
    warn(f"{listed} are taken as {', '.join(robot.joints)}, one after the other", UserWarning, 4)


def _is_rate(name: str) -> bool:
    return not _RATES.isdisjoint(words_of(name))


def _places(names: Sequence[str], joint: str) -> list[int]:
    return [k for k, name in enumerate(names) if name == joint or name.endswith((f".{joint}", f"/{joint}"))]


def _single(places: Sequence[list[int]]) -> list[int] | None:
    """The column of each joint, if every joint has one and no two the same."""
    columns = [each[0] for each in places if len(each) == 1]
    return columns if len({*columns}) == len(places) else None


def _holding(columns: Sequence[_Words], joints: Sequence[_Words]) -> list[list[int]]:
    """For each joint the columns in which its words stand side by side, and those of no joint with more words."""
    held = [max((len(joint) for joint in joints if _stand_in(joint, column)), default=0) for column in columns]
    return [
        [k for k, column in enumerate(columns) if held[k] == len(joint) and _stand_in(joint, column)]
        for joint in joints
    ]


def _stand_in(words: _Words, column: _Words) -> bool:
    n = len(words)
    return n > 0 and any(column[k : k + n] == words for k in range(len(column) - n + 1))


def _differing(columns: Sequence[_Words], joints: Sequence[_Words]) -> list[int] | None:
    """The column of each joint, if columns differ from one another by the same words as the joints."""
    ours, theirs = _different(columns), _different(joints)
    return [ours.index(words) for words in theirs] if len(joints) > 1 and sorted(ours) == sorted(theirs) else None


def _different(names: Sequence[_Words]) -> list[_Words]:
    """What is left of each name without the words with which all begin, and those in which all end."""
    shortest = min(map(len, names))
    first = next((k for k in range(shortest) if len({words[k] for words in names}) > 1), shortest)
    last = next((k for k in range(shortest - first) if len({words[-1 - k] for words in names}) > 1), shortest - first)
    return [words[first : len(words) - last] for words in names]
