"""The roles of the columns of a table: time, coordinates, movement, label."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.movements.tables.layout import Column, Layout, listed
from kineme.movements.tables.time_stamps import TIME_UNITS, words_of
from kineme.units import UNITS, is_unit_of, split_head

#: Words of heads. A head has a role if all its words are in the role's lists and at least one is in the first list.
TIME_WORDS = frozenset({"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "elapsed", "epoch"})
MOVEMENT_WORDS = frozenset(
    {
        "movement", "demonstration", "demo", "trial", "trajectory", "traj", "sequence", "episode", "recording",
        "segment", "repetition", "rep", "subject", "participant", "session", "user", "take", "attempt",
        "run", "ep", "clip", "shot", "round", "iteration", "uuid", "guid",
    }
)  # fmt: skip
LABEL_WORDS = frozenset({"label", "labels", "class", "action", "gesture", "activity", "symbol", "category"})
_STAMPS = TIME_WORDS - {"t", "elapsed"}  # that end the name of a clock
_BEGINS = frozenset({"since", "start", "boot", "reboot", "begin", "in"})  # beside the name of a clock
_BESIDE_TIME = TIME_UNITS | _BEGINS | {"unix", "utc", "relative", "system"}
_BESIDE_NAMES = frozenset({"id", "nr", "no", "number", "index", "idx", "name"})
_COUNTERS = frozenset({"frame", "index", "idx", "row", "seq", "sample", "unnamed", "packet", "counter"})  # of samples
_BESIDE_COUNTERS = frozenset({"sub", "task", "nr", "no", "number", "n", "id", "count", "level", "logging", "point"})
# Of a finger and a line of a picture -> what is beside them.
_NO_COUNTERS = {"index": {"thumb", "middle", "ring", "pinky", "little"}, "row": {"col", "cols", "column"}}
_OF_PANDAS_OR_THINGS = re.compile(r"unnamed|__index_level_|num(?![a-z])", re.IGNORECASE)  # whatever they hold
_ROS_HEADER = re.compile(r"(.*[./_])?header[./_](seq|stamp|frame_id)(?![^\W_]).*", re.IGNORECASE)  # of a message
_ROS_STAMP = re.compile(r"(.*[./_])?header[./_]stamp([./_]secs?)?", re.IGNORECASE)
_WHOLE_SECONDS = re.compile(r"(.*?)(s|sec|secs|seconds)", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(].*?[\])]")  # around units
_UNNAMED = re.compile(r"([^:]*:)?(\*|unlabell?ed|unidentified)[ _-]?\d*(\.position)?\.[xyz]", re.IGNORECASE)  # markers
# Of a rotation about an axis, see `kineme.movements.channels.channel`.
_TURNING = re.compile(r"(?:v|vel|velocity|a|acc|acceleration)[_ .](.+)\.r[xyz]", re.IGNORECASE)
_SHORT = re.compile(r"(?:v|a|d|dd)([xyz])|d{1,2}(q)|([xyzq])d{1,2}ot|(q)dd?")  # words for derivatives of x, y, z, q
_POSITION_WORDS = frozenset({"pos", "position", "positions"})
#: Words of columns that are no coordinates where others of the same name without them are.
_DERIVATIVE_WORDS = frozenset(
    {
        "vel", "velocity", "velocities", "speed", "acc", "accel", "acceleration", "accelerations", "jerk", "dot",
        "ddot", "effort", "efforts",
    }
)  # fmt: skip
#: Words of columns that say how sure the position of the same name is.
_CONFIDENCE_WORDS = frozenset({"confidence", "conf", "likelihood", "score", "visibility", "presence", "residual"})
_STATES = frozenset({"state", "status"})  # the same where names end in them: HandRight_TrackingState
_ALONE = ({"confidence"}, {"likelihood"}, {"status"})  # that are of all points where no name stands beside them
_MOSTLY = 0.75  # of its steps, by which a column of times increases, though some are faulty
_AXES = frozenset("xyz")
_BESIDE_AZ = ("el", "elevation", "x", "y", "ax", "ay")  # what tells an azimuth from an acceleration along z


class Roles(NamedTuple):
    """Column numbers by role, and the columns that are ignored."""

    time: int | None
    positions: tuple[int, ...]
    movement: tuple[int, ...]
    label: int | None
    ignored: tuple[int, ...]
    nanoseconds: int | None = None  # added to whole seconds in `time`, as ``stamp.nanosec`` to ``stamp.sec``
    person: int | None = None  # one of those in `movement`
    clocks: tuple[int, ...] = ()  # other columns of times, which have to show the same clock
    apart: tuple[int, ...] = ()  # times of other clocks that part the coordinates, which have to run at the same rate


DISCRETE_WORDS = frozenset(
    {
        "gripper", "button", "buttons", "switch", "trigger", "flag", "contact", "mode", "grasp", "grasped",
        "open", "closed", "digital", "event", "done", "success",
        "suction", "vacuum",
    }
)  # fmt: skip


def choose_roles(
    heads: Sequence[str],
    kinds: Sequence[str],
    layout: Layout,
    named: bool = True,
    values: Callable[[int], Any] | None = None,
) -> Roles:
    """Find roles by heads and by what columns hold, "number", "flag", "date" or "text"; choices take precedence.

    Flags, true and false, are coordinates where they are chosen, or where their heads say a gripper, a button or such.
    In a file without heads, not `named`, the first column of numbers is time and the others are coordinates. Columns
    named as counters are left aside if they count, as their `values` say; without these by their heads alone.
    """
    if layout.excluded and (excluded := excluded_numbers(heads, layout.excluded)):
        heads = ["" if k in excluded else head for k, head in enumerate(heads)]
        kinds = ["text" if k in excluded else kind for k, kind in enumerate(kinds)]
    label = _label(heads, kinds, layout, named)
    movement = _movement(heads, layout, named, label)
    person = None if layout.person is None else _number(heads, layout.person)
    taken = {*movement, label, person}
    movement = movement if person is None or person in movement else (*movement, person)
    time, *others = _times(heads, kinds, layout, named, taken)
    beside = _nanoseconds(heads, kinds) if named else {}
    nanoseconds = None if time is None else beside.get(time)
    taken |= {time, *others, *beside, *beside.values()}
    steps = {
        k
        for k, head in enumerate(heads)
        if kinds[k] == "flag" and (layout.coordinates is not None or DISCRETE_WORDS & {*words_of(head)})
    }
    free = [k for k in range(len(heads)) if k not in taken and (kinds[k] == "number" or k in steps)]
    clocks = {k for k in free if time is not None and _is_another_clock(heads[k], heads[time])}
    if layout.coordinates is not None:
        positions = column_numbers(heads, layout.coordinates, free)
    else:
        plain = set(map(_plain, heads))
        derived = beside_positions([heads[k] for k in free]) if named else set()
        counters = _counters(heads, free, values, (time, *movement, label))
        positions = tuple(
            k
            for k in free
            if not (named and (k in clocks | counters or heads[k] in derived or _says_nothing_new(heads[k], plain)))
            and not _is_left_over(heads[k], layout)
        )
    if not positions:
        texts = [head for k, head in enumerate(heads) if k not in taken and kinds[k] in ("text", "flag")]
        of_text = f"; there are no numbers in {listed(texts)}" if texts else ""
        raise DataError(f"expected a column of times and at least one of positions, got {_listed(heads)}{of_text}")
    # Where coordinates stand both between the times and another clock and elsewhere, each sensor may have its own.
    between = {k: sum(min(k, time) < p < max(k, time) for p in positions) for k in clocks if time is not None}
    apart = tuple(k for k, n in between.items() if 0 < n < len(positions) and k not in positions)
    used = {time, nanoseconds, label, *others, *movement, *positions, *apart}
    ignored = tuple(k for k in range(len(heads)) if k not in used)
    beside_time = tuple(k for k in others if k is not None and k not in positions)
    return Roles(time, positions, movement, label, ignored, nanoseconds, person, beside_time, apart)


def with_times_that_increase(roles: Roles, stamps: Any, layout: Layout) -> Roles:
    """Take a column for times that nobody named so only if it increases, where `units` may be the step without one."""
    k, stamps = roles.time, stamps[np.isfinite(stamps)]
    assert k is not None
    steps = np.diff(stamps)
    increases = len(steps) == 0 or np.mean(steps > 0) > _MOSTLY
    is_step = isinstance(layout.units, float | int)
    if increases and is_step and (stamps != np.rint(stamps)).any():
        raise DataError(
            f"expected to know whether units={layout.units:g} is the unit of times or the step between samples, "
            f"got numbers with fractions that increase in column {k}; say time={k} if they are times, else columns= "
            f"with {k} among them or exclude={k}, in the shell --time, --columns, --exclude"
        )
    if increases:
        return roles
    if not is_step:
        raise DataError(
            f"expected times in column {k}, since the table has no heads, got numbers that do not increase; say which "
            "has them with time=, or the step between samples with units= where there are none, in the shell --time, "
            "--units"
        )
    if layout.coordinates is not None:
        return roles._replace(time=None, ignored=(*roles.ignored, k))
    return roles._replace(time=None, positions=tuple(sorted((k, *roles.positions))))


def _number(heads: Sequence[str], column: Column) -> int:
    return _place(heads, column, places_of(heads), places_of(map(_plain, heads)))


def column_numbers(
    heads: Sequence[str], columns: Sequence[Column], among: Collection[int] | None = None
) -> tuple[int, ...]:
    """Column numbers from heads or numbers; a string of digits is a number if no head equals it.

    What several heads begin with, before a dot, stands for all of them: ``wrist`` for ``wrist.x``, ``wrist.y``. Where
    no head has the name, ``*`` in it stands for any text and ``?`` for any character: ``LASI*``, ``*_x``. Of patterns
    only columns `among` these are taken, by default all but times, and none twice.
    """
    exact, plain = places_of(heads), places_of(map(_plain, heads))
    numbers: list[int] = []
    for column in columns:
        is_pattern = isinstance(column, str) and bool({"*", "?"} & {*column})
        if isinstance(column, int) or column in exact or (_plain(column) in plain and not is_pattern):
            numbers.append(_place(heads, column, exact, plain))
        elif group := [k for k, head in enumerate(heads) if head.startswith(f"{column}.")]:
            numbers += group
        elif is_pattern:
            # The columns whose heads match, with or without their units; brackets stand for themselves.
            literal = column.replace("[", "[[]")
            bare = (_BRACKETS.sub("", head).strip() for head in heads)
            matching = [
                k
                for k, (head, name) in enumerate(zip(heads, bare, strict=True))
                if head and (fnmatchcase(head, literal) or fnmatchcase(name, literal))
            ]
            free = matching if among is None else [k for k in matching if k in among]
            if not free:
                raise DataError(f"expected columns like {column!r}, got {_listed(heads)}")
            numbers += [k for k in free if k not in numbers and (among is not None or not is_time(heads[k]))]
        else:
            numbers.append(_place(heads, column, exact, plain))
    return tuple(numbers)


def excluded_numbers(heads: Sequence[str], columns: Sequence[Column]) -> set[int]:
    """The columns that are meant, as by `column_numbers`; what is not there is passed over, and twins go together."""
    numbers: set[int] = set()
    for column in columns:
        if isinstance(column, str) and (same := [k for k, head in enumerate(heads) if head == column]):
            numbers |= {*same}
            continue
        with suppress(DataError):
            numbers |= {*column_numbers(heads, [column])}
    return numbers


def places_of(heads: Iterable[str]) -> dict[str, list[int]]:
    """Head -> the numbers of its columns."""
    places: dict[str, list[int]] = {}
    for k, head in enumerate(heads):
        places.setdefault(head, []).append(k)
    return places


def _place(heads: Sequence[str], column: Column, exact: dict[str, list[int]], plain: dict[str, list[int]]) -> int:
    if isinstance(column, str):
        if len(same := exact.get(column, [])) > 1:
            raise DataError(
                f"expected one column {column!r}, got the columns {same} of that name; say which by its number"
            )
        if same:
            return same[0]
        if len(alike := plain.get(_plain(column), [])) == 1:
            return alike[0]
    if isinstance(column, int) or column.isdecimal():
        k = int(column)
        if -len(heads) <= k < len(heads):
            return k % len(heads)
    raise DataError(f"expected a column {column!r}, got {_listed(heads)}")


def _plain(head: str) -> str:
    return _BRACKETS.sub("", head).strip().lower()


def _listed(heads: Sequence[str]) -> str:
    named = [head for head in heads if head]
    return "one column" if len(named) == 1 else f"the columns {listed(named)}"


def _times(
    heads: Sequence[str], kinds: Sequence[str], layout: Layout, named: bool, taken: set[int | None]
) -> list[int | None]:
    """The column of times, None where there is none, and others that may show the same clock."""
    if layout.time is not None:
        return [_number(heads, layout.time)]
    free = [k for k in range(len(heads)) if k not in taken]
    if not named and layout.coordinates is not None:  # nothing but the choice says that the first column is no time
        free = [k for k in free if k not in column_numbers(heads, layout.coordinates)]
    of_time = _of_time(heads, kinds, free) if named else [k for k in free if kinds[k] != "text"][:1]
    dates = [k for k in of_time if kinds[k] == "date"]
    if of_time and len(dates) <= 1 and (len(of_time) == 1 or all(kinds[k] != "text" for k in of_time)):
        return [*dates, *(k for k in of_time if k not in dates)]
    if isinstance(layout.units, float | int) and not of_time:
        return [None]
    if not named:
        raise DataError(f"expected a column of times and at least one of positions, got {_listed(heads)}")
    raise no_time(heads, of_time)


def no_time(heads: Sequence[str], of_time: Sequence[int]) -> DataError:
    """The error of a table without times, or with columns of several clocks."""
    of_several = f" of {listed([heads[k] for k in of_time])}" if of_time else ""
    return DataError(
        f"expected one column of times, named as one of {', '.join(sorted(TIME_WORDS))}, got {_listed(heads)}; "
        f"say which{of_several} with time=, or the step between samples with units= where there is none, "
        "in the shell with --time, --units"
    )


def _of_time(heads: Sequence[str], kinds: Sequence[str], free: Sequence[int]) -> list[int]:
    """The columns of times; the stamp in the header of a message counts if no other column is one."""
    later = set(_nanoseconds(heads, kinds).values())
    rest = [k for k in free if k not in later and heads[k]]
    of_time = [k for k in rest if is_time(heads[k])]
    if len(of_time) > 1:  # a stamp without values, as of a nested message whose parts follow
        of_time = [k for k in of_time if kinds[k] != "text"] or of_time
    return of_time or [k for k in rest if is_header_stamp(heads[k]) and kinds[k] != "text"]


def _nanoseconds(heads: Sequence[str], kinds: Sequence[str]) -> dict[int, int]:
    """Columns of whole seconds -> those of the nanoseconds beside them: ``stamp.sec`` and ``stamp.nanosec``."""
    plain = {head.lower(): k for k, head in enumerate(heads)}
    beside_seconds = {}
    for k, head in enumerate(heads):
        match = _WHOLE_SECONDS.fullmatch(head) if kinds[k] == "number" else None
        if match is None or match[1][-1:].isalpha():
            continue
        names = [f"{match[1]}{name}".lower() for name in TIME_UNITS if UNITS[name].symbol == "ns"]
        beside = [plain[name] for name in names if name in plain and kinds[plain[name]] == "number"]
        if len(beside) == 1:
            beside_seconds[k] = beside[0]
    return beside_seconds


def is_time(head: str) -> bool:
    """Tell whether a head names time: ``t``, ``Time [ms]``, ``timestamp_ns``, ``sec``."""
    stem, unit = split_head(head)
    words = words_of(stem if stem and is_unit_of(unit, "time") else head)
    if len(words) <= 1 and words != ("s",) and set(words) & TIME_UNITS:
        return True
    return set(words) <= TIME_WORDS | _BESIDE_TIME and bool(set(words) & TIME_WORDS)


def _is_stamp(head: str) -> bool:
    """Tell whether a head names nothing but times: ``time`` beside ``seconds_elapsed``, but neither ``t`` nor ``s``."""
    return is_time(head) and bool(set(words_of(head)) & (TIME_WORDS - {"t"}))


def _is_clock(head: str) -> bool:
    """Tell whether a head names the time of another clock: ``ros_time``, ``sensor_timestamp_ns``."""
    words = [word for word in words_of(split_head(head)[0]) if word not in TIME_UNITS | _BEGINS]
    return len(words) > 1 and words[-1] in _STAMPS


def _is_another_clock(head: str, time: str) -> bool:
    """Tell whether a head names the time of another clock than that of `time`: ``time_acc`` beside ``time_emg``."""
    first, alike, unit = words_of(head)[:1], words_of(time)[:1], split_head(head)[1] or ""
    return (
        _is_clock(head)
        or (_is_stamp(head) if is_time(time) else first == alike and not TIME_WORDS.isdisjoint(first))
        or (unit.lower() in TIME_UNITS and unit[1:] != "S")  # skin [uS]: siemens
    )


def is_header_stamp(head: str) -> bool:
    """Tell whether a head names the stamp in the header of a message: ``.header.stamp``, ``header.stamp.sec``."""
    return _ROS_STAMP.fullmatch(head) is not None


def _named_as(head: str, kind: frozenset[str]) -> bool:
    words = set(words_of(head))
    return words <= kind | _BESIDE_NAMES and bool(words & kind)


def _label(heads: Sequence[str], kinds: Sequence[str], layout: Layout, named: bool) -> int | None:
    if layout.label is not None:
        return _number(heads, layout.label)
    of_labels = [k for k, head in enumerate(heads) if named and _named_as(head, LABEL_WORDS)]
    if any(head.lower().startswith("observation") for head in heads):  # of a robot, whose actions are numbers
        of_labels = [k for k in of_labels if kinds[k] == "text" or heads[k].lower() != "action"]
    if len(of_labels) > 1:
        raise DataError(
            f"expected one column of labels, got {[heads[k] for k in of_labels]}; say which with label=, "
            "in the shell --label-column"
        )
    return of_labels[0] if of_labels else None


def _is_left_over(head: str, layout: Layout) -> bool:
    """Tell whether a head names movements or labels, for which the caller has chosen another column."""
    return (layout.keys is not None and _named_as(head, MOVEMENT_WORDS)) or (
        layout.label is not None and _named_as(head, LABEL_WORDS - {"action"})  # the actions of a robot are numbers
    )


def _movement(heads: Sequence[str], layout: Layout, named: bool, label: int | None) -> tuple[int, ...]:
    if layout.keys is not None:
        return column_numbers(heads, layout.keys)
    if not named:
        return ()
    named_so = [k for k, head in enumerate(heads) if _named_as(head, MOVEMENT_WORDS) or words_of(head) == ("id",)]
    return tuple(k for k in named_so if k != label)


def beside_positions(heads: Sequence[str]) -> set[str]:
    """The heads of derivatives, efforts and confidences of positions that are there too.

    So ``x_vel``, ``vx``, ``dx`` and ``x_dot`` beside ``x`` or ``pos_x``, and ``nose_score`` beside ``nose_x``. A state
    is of a point that has its name, a ``confidence`` or ``status`` without a name of all that is there.
    """
    written = {mark + _plain(head) for head in heads for mark in ("v_", "a_")}  # as kineme writes them, of any name
    words = {head: _without(_spelled_out(head), _POSITION_WORDS) for head in heads}
    beside = _DERIVATIVE_WORDS | _CONFIDENCE_WORDS
    noted = {
        head: {*parts} & (beside | _STATES | {"tracking"} if _STATES & {*parts[-1:]} else beside)
        for head, parts in words.items()
    }
    places = {parts for head, parts in words.items() if not noted[head]}
    points = {_without(parts, _AXES) for parts in places if _AXES & {*parts}}
    return {head for head in heads if _plain(head) in written} | {
        head
        for head, parts in words.items()
        if not _is_azimuth(head, heads)
        and noted[head]
        and not DISCRETE_WORDS & {*parts}
        and (
            _without(parts, noted[head])
            in (places if noted[head] <= _DERIVATIVE_WORDS else points - ({()} if "state" in parts else set()))
            or ({*parts} in _ALONE and places)
        )
    }


def _is_azimuth(head: str, heads: Sequence[str]) -> bool:
    """Tell whether ``az`` is no acceleration: beside ``el``, or beside x and y without their accelerations."""
    words = words_of(_BRACKETS.sub("", head))
    if "az" not in words:
        return False
    named = {words_of(_BRACKETS.sub("", other)) for other in heads}
    there = {name for name in _BESIDE_AZ if tuple(name if word == "az" else word for word in words) in named}
    return bool(there & {"el", "elevation"}) or {"x", "y"} <= there <= {"x", "y"}


def _spelled_out(head: str) -> tuple[str, ...]:
    """The words of a head without its unit; of ``vx``, ``dx`` and ``xdot`` the axis and that it is a derivative."""
    words = words_of(_BRACKETS.sub("", head))
    if len(words) > 1 and words[0] in {"v", "a"}:
        words = ("dot", *words[1:])
    short = [_SHORT.fullmatch(word) for word in words]
    return tuple(
        part
        for word, match in zip(words, short, strict=True)
        for part in ((match[match.lastindex or 0], "dot") if match else (word,))
    )


def _without(words: tuple[str, ...], others: Collection[str]) -> tuple[str, ...]:
    return tuple(word for word in words if word not in others)


def is_no_coordinate(head: str) -> bool:
    """Tell whether the last part of a field's path names a stamp or the number of a thing: ``state.timestamp``."""
    last = head.rpartition(".")[2]
    return _is_stamp(last) or _is_number_of_thing(last)


def _is_number_of_thing(head: str) -> bool:
    """Tell whether a head names the number that a thing has, which does not move: ``id``, ``tracking_id``."""
    return words_of(head)[-1:] == ("id",)


def counts_samples(head: str, beside: Iterable[str] = ()) -> bool:
    """Tell whether a head names a counter of samples, or how many things there are: ``frame``, ``num_bodies``.

    A finger beside others, and the line of a picture beside its column, are none: ``index``, ``row``.
    """
    words = [word for word in words_of(head) if not word.isdecimal()]
    if len(words) > 1 and words[0] == "num":
        return True
    if not {*words} & _COUNTERS or not {*words} <= _COUNTERS | _BESIDE_COUNTERS:
        return False
    return not _names_thing(head, beside)


def _names_thing(head: str, beside: Iterable[str]) -> bool:
    """Tell whether a head with a word of counters names a finger or a line of a picture, to judge by those beside."""
    others = {other for word in words_of(head) for other in _NO_COUNTERS.get(word, ())}
    return bool(others) and any(others & {*words_of(each)} for each in beside)


def may_count(head: str) -> bool:
    """Tell whether a head is that of a counter if its values count, as ``frame``, ``world_index``, ``RDTSequence``."""
    return counts_samples(head) or bool({*words_of(head)[-1:]} & {"sequence", "seq", "index", "idx", "counter"})


def _counters(
    heads: Sequence[str], among: Iterable[int], values: Callable[[int], Any] | None, beside: Sequence[int | None]
) -> set[int]:
    """The columns that are named as counters and, where their values are at hand, count within each movement.

    A movement ends where times, the first column `beside`, go back, or one of the others changes.
    """
    certain = {k for k in among if counts_samples(heads[k], heads)}
    several = [k for k in among if may_count(heads[k])]
    if values is None or not several:
        return certain
    times, *names = (None if k is None else values(k) for k in beside)
    ends = [rows[1:] != rows[:-1] for rows in names if rows is not None]
    if times is not None and times.dtype.kind in "iufmM":
        ends.append(times[1:] < times[:-1])
    apart = np.any(ends, axis=0) if ends else False
    return {
        k
        for k in several
        if (k in certain and _OF_PANDAS_OR_THINGS.match(heads[k]))
        or _counts(values(k), apart, _names_thing(heads[k], heads))
    }


def _counts(values: Any, apart: Any, exactly: bool) -> bool:
    """Tell whether numbers are whole and go back only where they begin anew; `exactly` from 0 or 1 in steps of 1."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return not exactly  # texts
    filled = numbers[np.isfinite(numbers)]
    if not len(filled):
        return not exactly
    steps = np.diff(numbers)
    along = steps[~(apart | (steps < -np.ptp(filled) / 2) | np.isnan(steps))]
    if exactly:
        return bool((along == 1).all() and filled[0] in (0, 1))
    return bool((along >= 0).all() and (filled == np.rint(filled)).all())


def _says_nothing_new(head: str, plain: set[str]) -> bool:
    """Tell whether a column is redundant: a stamp beside the times, an unnamed marker, a turning."""
    if (
        _is_number_of_thing(head)
        or not head.strip()
        or _ROS_HEADER.fullmatch(head)
        or _UNNAMED.fullmatch(head)
        or words_of(head)[-2:] == ("time", "fine")  # of Xsens, whose ticks begin anew
        or head in ("next.done", "next.success")  # the end of an episode of LeRobot
        or (head in ("reward", "discount") and any(name.startswith("observation") for name in plain))  # of a robot
    ):
        return True
    if _plain(head).endswith("/speed") and f"{_plain(head).removesuffix('speed')}value" in plain:  # of OpenSim's states
        return True
    turning = _TURNING.fullmatch(_plain(head))
    return turning is not None and any(turning[1] + dot + "w" in plain for dot in ("", ".", "_", " "))
