"""JSON, JSON lines and messages in JSON of an MCAP file as trees of arrays: samples become columns, lists arrays."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.arrays import arrays_movements, has_known_names
from kineme.io.arrays.tree_movements import no_stamp, tree_movements
from kineme.io.limits import check_expanded
from kineme.io.records import needs
from kineme.io.ros.bags import REMEDIES, records_of_mcap, refused
from kineme.io.tables.dialect import is_number
from kineme.movements.channels.column_match import with_unit
from kineme.movements.tables.columns import counts_samples, is_time
from kineme.movements.tables.layout import Layout, Parsed, listed
from kineme.movements.tables.time_stamps import is_date, seconds_of_dates, words_of
from kineme.reporting.text import first_names
from kineme.units import is_unit_of

_RECORDED = "timestamp [s]"  # head of the times of the recording
_PER_SECOND = 1e9
_CHECKED = 2**12  # messages between two looks at the memory

_PARTS = ("name", "part", "bodypart", "joint", "handedness", "side")  # names of a part of a sample
_NAMES = (*_PARTS, "label", "id")  # also of movements and samples
_SAID = (*_PARTS, "type", "label")  # before numbers
_LEFT_OR_RIGHT = frozenset({"left", "right"})
_THINGS = frozenset({"marker", "joint", "keypoint", "landmark", "point", "object"})  # marker_id
_FOUND = frozenset({"tracking", "track", "body", "person", "hand", "user", "player", "skeleton"})  # tracking_id
_BODIES = frozenset({"hands", "bodies", "people", "persons", "users", "players", "skeletons"})
_GIVEN = re.compile(r"\0id(\d+)")  # the number that a device gave a body, in the name of a column
_NAMED = 6  # numbers of bodies in a note
_OPENPOSE = re.compile(r"\w+_keypoints_[23]d")
_UNITS = ("unit", "units")
_COUNT, _HANDS, _SIDE = "\0count", "\0hands", "\0side"  # of parts without names
# Where MediaPipe says which hand it is, in JavaScript, in Python and in its older solutions, and what is beside that.
_SIDES = ("categoryName", "category_name", "label")
_BESIDE_SIDE = frozenset({"index", "score", "displayName", "display_name", *_SIDES})
_NO_HANDS = frozenset({"pose", "face", "body"})
_AXES = frozenset("xyz")
_NUMBER, _LIST = 32, 88  # bytes of a Python object


def json_movements(data: bytes, layout: Layout) -> Parsed:
    """Read movements in JSON: named arrays, samples ``[{"t": 0, "x": 1}, ...]``, lists of either, or these by name."""
    check_expanded(size_of_objects(data))
    try:
        entries = json.loads(data, object_pairs_hook=_each_once)
    except json.JSONDecodeError as error:
        first = error.doc[: error.pos].strip()
        if error.msg == "Extra data" and error.colno == 1 and "\n" not in first:  # JSON lines of that ending
            return json_lines_movements(data, layout)
        raise DataError(f"expected JSON, got a truncated or damaged file ({error}); write it again") from error
    parsed = _parsed(entries, layout)
    units = [entries[name] for name in _UNITS if isinstance(entries, Mapping) and isinstance(entries.get(name), str)]
    if units and (is_unit_of(units[0], "length") or is_unit_of(units[0], "angle")):
        return parsed._replace(detected=with_unit(parsed.detected, parsed.block, units[0], layout.kinds or {}))
    return parsed


def _parsed(entries: Any, layout: Layout) -> Parsed:
    if isinstance(entries, Mapping):
        if (frame := _frame(entries)) is not None:
            return tree_movements(_columns_of(frame), layout, "JSON", many="take")
        if has_known_names(entries):
            return arrays_movements(entries, layout, "JSON")
    elif not isinstance(entries, list) or not any(isinstance(entry, (Mapping, list)) for entry in entries[:1]):
        raise DataError(f"expected an object with times and positions, got a {type(entries).__name__}")
    return _tree_movements(entries, layout, "JSON")


def json_lines_movements(data: bytes, layout: Layout) -> Parsed:
    """Return the movements in JSON lines: a sample in each line, or a movement in each line."""
    check_expanded(size_of_objects(data))
    entries = []
    for k, line in enumerate(data.decode("utf-8-sig").splitlines(), 1):
        if not line.strip():
            continue
        try:
            entries.append(json.loads(line, object_pairs_hook=_each_once))
        except json.JSONDecodeError as error:
            raise DataError(f"expected JSON in line {k}, got {line.strip()[:40]!r} ({error.msg}); repair it") from error
    if not entries:
        raise DataError("expected samples, got an empty file")
    return _tree_movements(entries, layout, "JSON lines")


def _frame(entries: Mapping[str, Any]) -> dict[str, list[Any]] | None:
    """Give the columns, and the index as one, of a data frame as pandas writes it; None of something else."""
    if {*entries} == {"columns", "index", "data"} or _is_split(entries):
        if any(not isinstance(row, list) or len(row) != len(entries["columns"]) for row in entries["data"]):
            raise DataError("expected a row of data with a number for each of the columns, got another one")
        heads = ["_".join(map(str, head)) if isinstance(head, list) else str(head) for head in entries["columns"]]
        columns = map(list, zip(*entries["data"], strict=True))
        named = dict(zip(heads, columns, strict=True))
        return _with_index(entries["index"], named) if "index" in entries else named
    rows = list(entries.values())
    if not rows or not all(isinstance(row, Mapping) and row and row.keys() == rows[0].keys() for row in rows):
        return None
    if any(isinstance(cell, (Mapping, list)) for row in rows for cell in row.values()):
        return None
    if _counts(rows[0]):
        return _with_index(list(rows[0]), {head: list(column.values()) for head, column in entries.items()})
    if _counts(entries):
        return _with_index(list(entries), {head: [row[head] for row in rows] for head in rows[0]})
    return None


def _is_split(entries: Mapping[str, Any]) -> bool:
    """Tell whether these are the heads and the rows of a frame without its index."""
    if {*entries} != {"columns", "data"} or not all(isinstance(entry, list) for entry in entries.values()):
        return False
    rows, width = entries["data"], len(entries["columns"])
    are_rows = all(isinstance(row, list) and len(row) == width for row in rows)
    return are_rows and not any(isinstance(cell, (Mapping, list)) for row in rows for cell in row)


def _counts(names: Iterable[str]) -> bool:
    """Tell whether names are those of the rows of a frame: numbers or dates."""
    return all(is_number(name, False) or is_date(name) for name in names)


def _with_index(index: list[Any], columns: dict[str, list[Any]]) -> dict[str, list[Any]]:
    texts = [str(entry) for entry in index]
    if all(map(is_date, texts)):
        return {"time": texts} | columns
    return {"index": [float(text) if is_number(text, False) else text for text in texts]} | columns


def _columns_of(frame: Mapping[str, list[Any]]) -> dict[str, Any]:
    """Return columns as arrays; of times that are texts the seconds, which their head says."""
    tree = {}
    for head, cells in frame.items():
        if is_time(head) and any(isinstance(cell, str) for cell in cells):
            seconds, others = seconds_of_dates([str(cell) for cell in cells])
            if others:
                raise no_stamp(head, others)
            tree[f"{head} (s)"] = seconds
        else:
            tree[head] = _array(cells, f" in {head!r}")
    return tree


def size_of_objects(data: bytes) -> int:
    """Return the memory [bytes] that JSON takes with the Python objects that it becomes."""
    lists = data.count(b"[") + data.count(b"{")
    return len(data) + _NUMBER * data.count(b",") + _LIST * lists


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries = dict(pairs)
    if len(entries) < len(pairs):
        twice = next(name for name in entries if sum(key == name for key, _ in pairs) > 1)
        raise DataError(f"expected each entry once, got {twice!r} several times")
    return entries


def _tree_movements(entries: Any, layout: Layout, kind: str) -> Parsed:
    notes: list[str] = []
    parsed = tree_movements(_as_tree(entries, notes), layout, kind, many="take")
    notes += parsed.detected.notes
    return parsed._replace(detected=parsed.detected._replace(notes=tuple(dict.fromkeys(notes))))


def _as_tree(value: Any, notes: list[str]) -> Any:
    """Return parsed JSON as a tree of arrays, and note what may be wrong."""
    if isinstance(value, Mapping):
        if any(_OPENPOSE.fullmatch(name) for name in value):
            raise DataError(
                "expected movements, got the people of one frame, as OpenPose writes it: which of them moves nothing "
                "says; write a table with a line for each frame, its number or time and the points of one person"
            )
        if any(name.lower() == "name" for name in value):
            # The points of several strokes of what has one name are one after the other, as of the $N recognizer.
            for name, entry in value.items():
                if name.lower() == "strokes" and isinstance(entry, list) and all(map(_are_objects, entry)):
                    value = {**value, name: [point for stroke in entry for point in stroke]}
        stamped = {len(entry) for name, entry in value.items() if is_time(name) and isinstance(entry, list)}
        tree = {name: _as_tree(entry, notes) for name, entry in value.items()}
        return {
            name: _stacked(entry) if isinstance(entry, list) and len(entry) in stamped else entry
            for name, entry in tree.items()
        }
    if not isinstance(value, list) or not value:
        return value
    if all(isinstance(element, Mapping) for element in value):
        return _columns(value, notes) if all(map(_is_sample, value[:2])) else [_as_tree(each, notes) for each in value]
    if any(isinstance(element, Mapping) for element in value):
        raise DataError("expected a list of samples or of movements, got objects beside other values")
    if all(
        isinstance(element, list) and element and all(isinstance(cell, str) for cell in element) for element in value
    ):
        return None  # pairs of names, as of the bones between joints
    if all(isinstance(row, list) for row in value) and not all(
        not isinstance(cell, (list, Mapping)) for row in value for cell in row[:1]
    ):
        return [_as_tree(element, notes) for element in value]
    return _array(value)


def _stacked(rows: list[Any]) -> Any:
    """Return points (T, J, d) over time as one array, of a list of arrays (J, d)."""
    alike = all(isinstance(row, np.ndarray) and row.ndim == 2 and row.shape == rows[0].shape for row in rows)
    return np.stack(rows) if alike and rows[0].dtype.kind == "f" else rows


def _are_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(element, Mapping) for element in value)


def _is_sample(entry: Mapping[str, Any]) -> bool:
    """Tell whether an object is one sample, not a movement whose entries are lists over time."""
    for name, value in entry.items():
        if is_time(name) or counts_samples(name, entry):
            return not isinstance(value, list)
    if any(_sides(name, value) for name, value in entry.items()):
        return True
    if any(  # objects that each have a name and numbers: the points of a body at one time
        isinstance(value, list)
        and bool(value)
        and all(isinstance(part, Mapping) and _name(part, _PARTS) for part in value)
        and not any(isinstance(cell, list) or is_time(key) for part in value for key, cell in part.items())
        for value in entry.values()
    ):
        return True
    if any(name.lower() in _AXES and isinstance(value, list) for name, value in entry.items()):  # x over time
        return False
    lists = [entry for entry in entry.values() if isinstance(entry, list)]
    return len(lists) < len(entry) and not any(
        isinstance(cell, (list, Mapping)) for value in lists for cell in value[:1]
    )


def _name(part: Mapping[str, Any], keys: Sequence[str] = _NAMES) -> str | None:
    name = next((part[key] for key in keys if key in part), None)
    return str(name) if isinstance(name, (str, int)) else None


def _told_by(part: Mapping[str, Any], key: str, of: str) -> str | None:
    """Return the name or number by which an entry tells a part of a list from others; None where it does not.

    The number of a body or a hand is marked: devices give another one whenever they find it.
    """
    value, words = part.get(key), words_of(key)
    is_number = words[-1:] == ("id",) and {*words[:-1]} <= _THINGS | _FOUND
    is_name = key in _SAID and (key != "type" or str(value).lower() in _LEFT_OR_RIGHT)
    if not isinstance(value, (str, int)) or not (is_number or is_name):
        return None
    found = is_number and ({*words[:-1]} & _FOUND or (key == "id" and {*words_of(of)} & _BODIES))
    return f"\0id{value}" if found and str(value).isdecimal() else str(value)


def _keys_of_parts(samples: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Give for each list of parts the entries that tell these apart in all samples, names before numbers."""
    keys: dict[str, list[str]] = {}

    def look(sample: Mapping[str, Any], path: str) -> None:
        for name, value in sample.items():
            here = f"{path}.{name}"
            if isinstance(value, Mapping):
                look(value, here)
            elif _are_objects(value):
                keys[here] = [
                    key
                    for key in keys.get(here, dict.fromkeys((*_SAID, *value[0])))
                    if None not in (told := {_told_by(part, key, name) for part in value}) and len(told) == len(value)
                ]
                for part in value:
                    look(part, here)

    for sample in samples:
        look(sample, "")
    return keys


def _numbered(flat: Sequence[dict[str, Any]], notes: list[str]) -> list[dict[str, Any]]:
    """Return samples in which bodies are counted from 0, whatever numbers a device gave them.

    A body that is found again has a new number: it takes the first place whose body does not come any more.
    """
    spans: dict[str, dict[str, tuple[int, int]]] = {}  # whose -> number -> the first sample with it, and the last
    for row, cells in enumerate(flat):
        for name in cells:
            for match in _GIVEN.finditer(name):
                ids = spans.setdefault(name[: match.start()], {})
                ids[match[1]] = ids.get(match[1], (row, row))[0], row
    places: dict[str, int] = {}
    for whose, ids in spans.items():
        held: list[list[str]] = []
        for number in sorted(ids, key=lambda number: (ids[number][0], int(number))):
            place = next((place for place in held if ids[place[-1]][1] < ids[number][0]), None)
            if place is None:
                held.append(place := [])
            place.append(number)
            places[f"{whose}\0id{number}"] = held.index(place)
        notes += [
            f"{_GIVEN.sub('', whose)}{k} had the ids {first_names(place, _NAMED)} one after the other, and is read as "
            "one; look whether it is the same"
            for k, place in enumerate(held)
            if len(place) > 1
        ]
    named = cache(lambda name: _GIVEN.sub(lambda match: str(places[name[: match.end()]]), name))
    return [{named(name): cell for name, cell in cells.items()} for cells in flat] if places else [*flat]


def _columns(samples: Sequence[Mapping[str, Any]], notes: list[str]) -> dict[str, Any]:
    """Return samples with names as an array for each name, NaN where it is missing; parts by name or number."""
    keys = _keys_of_parts(samples)
    flat = [_flat(sample, keys) for sample in samples]
    if any(count > 1 for cells in flat for name, count in cells.items() if name.endswith(_HANDS)):
        flat = [_flat(sample, keys, by_side=True) for sample in samples]  # they come in another order now and then
    flat = _numbered(flat, notes)
    names = dict.fromkeys(name for cells in flat for name in cells)
    for name in [name for name in names if name.endswith((_COUNT, _HANDS, _SIDE))]:
        del names[name]
        if name.endswith(_SIDE):
            if len(sides := {cells[name] for cells in flat if name in cells}) > 1:
                notes.append(f"one hand is {' and '.join(sorted(sides))} in turns, and read as one; look whether it is")
            continue
        if len(counts := {cells[name] for cells in flat if name in cells}) > 1:
            raise DataError(
                f"expected as many {name.rpartition('.')[0]!r} in each sample, since nothing names them, got "
                f"{min(counts)} to {max(counts)}; give each a name"
            )
    check_expanded(8 * len(flat) * len(names))
    return _columns_of({name: [cells.get(name) for cells in flat] for name in names})


def _flat(
    sample: Mapping[str, Any], keys: Mapping[str, Sequence[str]], path: str = "", by_side: bool = False
) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    told = {name: _sides(name, value) for name, value in sample.items()}
    sides = next((several for several in told.values() if several and {*map(str.lower, several)} <= _LEFT_OR_RIGHT), [])
    if not by_side:
        plain, sides = {_SIDE: sides[0]} if len(sides) == 1 else {}, []
    for name in [name for name, several in told.items() if not several]:
        value, here = sample[name], f"{path}.{name}"
        if isinstance(value, list) and value and all(map(_has_points, value)):  # hands
            if sides and not _NO_HANDS & {*words_of(name)}:
                if len({*sides}) < len(sides) or len(sides) != len(value):
                    raise DataError(
                        f"expected another side of each of the {len(value)} {name!r} in each sample, got {sides!r:.80}"
                        "; correct that sample, or leave it out"
                    )
                hands = _flat(dict(zip(sides, value, strict=True)), keys, here)
            else:
                hands = _flat({str(k): hand for k, hand in enumerate(value)}, keys, here) | {_HANDS: len(value)}
            plain |= {f"{name}.{inner}": cell for inner, cell in hands.items()}
        elif isinstance(value, Mapping):
            plain |= {f"{name}.{inner}": cell for inner, cell in _flat(value, keys, here, by_side).items()}
        elif _are_objects(value):
            key = next(iter(keys.get(here, ())), None)
            parts = [_told_by(part, key, name) if key else _name(part) for part in value]
            if None not in parts and len({*parts}) < len(parts):
                raise DataError(f"expected parts of {name!r} with different names in each sample, got {parts!r:.80}")
            count = None if len({*parts} - {None}) == len(parts) else len(value)
            aside = () if count else (*_NAMES, key)
            for k, part in enumerate(value):
                cells = {inner: cell for inner, cell in _flat(part, keys, here).items() if inner not in aside}
                plain |= {f"{name}.{k if count else parts[k]}.{inner}": cell for inner, cell in cells.items()}
            if count:
                plain[f"{name}.{_COUNT}"] = count
        else:
            plain[name] = value
    return plain


def _has_points(hand: Any) -> bool:
    """Tell whether this is a list of points, or holds nothing else, as ``{"landmark": [...]}``."""
    return _are_objects(hand) or (
        isinstance(hand, Mapping) and [*hand] == ["landmark"] and _are_objects(*hand.values())
    )


def _sides(name: str, value: Any) -> list[str]:
    """Return what MediaPipe holds each hand for, a side or a gesture; nothing of anything else."""
    sides = [_side(hand, "handedness" in words_of(name)) for hand in value] if isinstance(value, list) else []
    return sides if all(sides) else []


def _side(hand: Any, is_bare: bool) -> str:
    if is_bare and isinstance(hand, str):
        return hand
    if isinstance(hand, Mapping) and [*hand] == ["classification"]:
        hand = hand["classification"]
    first = hand[0] if _are_objects(hand) else hand if is_bare else None
    if not isinstance(first, Mapping) or not {*first} <= _BESIDE_SIDE:
        return ""
    return next((str(first[key]) for key in _SIDES if key in first), "")


def _array(values: list[Any], where: str = "") -> Any:
    """Return numbers as an array, NaN for null; texts as objects; nulls alone are empty texts, which are left aside."""
    nothing = all(
        value is None or (isinstance(value, list) and all(cell is None for cell in value)) for value in values
    )
    if nothing or any(isinstance(value, str) for value in values):
        texts = np.empty(len(values), dtype=object)
        texts[:] = ["" if nothing or value is None else str(value) for value in values]
        return texts
    width = max((len(value) for value in values if isinstance(value, list)), default=0)
    if width:
        values = [[np.nan] * width if value is None else value for value in values]
    try:
        return np.array(values, dtype=np.bool_ if {*map(type, values)} == {bool} else np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"expected samples of one length{where}, each a list of numbers, got rows that differ in length or "
            "hold texts"
        ) from error


def json_messages(path: Path, layout: Layout) -> Parsed:
    """Read a topic as a movement. Its times are those in the messages, or where these have none of the recording."""
    with needs("mcap", "read MCAP", "ros"):
        from mcap.records import Channel, Message

    wanted = set(layout.topics)
    channels: dict[int, Any] = {}
    topics: dict[str, list[tuple[int, bytes]]] = {}
    n = n_bytes = 0
    with refused("expected an MCAP file that can be read", REMEDIES[".mcap"]), path.open("rb") as file:
        for record in records_of_mcap(file):
            if isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and channels[record.channel_id].message_encoding == "json":
                if wanted and channels[record.channel_id].topic not in wanted:
                    continue
                topics.setdefault(channels[record.channel_id].topic, []).append((record.log_time, record.data))
                n, n_bytes = n + 1, n_bytes + size_of_objects(record.data)
                if n % _CHECKED == 0:
                    check_expanded(n_bytes, "messages in JSON")
    check_expanded(n_bytes, "messages in JSON")
    encodings = {channel.message_encoding for channel in channels.values()}
    if len(topics) != 1:
        got = f"the topics {listed(topics)}; say which with topic=, in the shell --topic" if topics else ""
        none = f"messages in {listed(sorted(encodings))}; write a topic as CSV or JSON lines"
        raise DataError(f"expected an MCAP file of ROS 2, or one topic with messages in JSON, got {got or none}")
    ((name, messages),) = topics.items()
    samples = []
    for recorded, raw in sorted(messages, key=lambda message: message[0]):
        try:
            sample = json.loads(raw)
        except ValueError as error:
            raise DataError(f"topic {name}: expected messages in JSON, got {raw[:40]!r} ({error})") from error
        if not isinstance(sample, dict):
            raise DataError(f"topic {name}: expected messages that are objects, got {raw[:40]!r}")
        samples.append(sample if any(map(is_time, sample)) else {_RECORDED: recorded / _PER_SECOND} | sample)
    parsed = _tree_movements(samples, replace(layout, topic=None), "MCAP")
    return parsed._replace(detected=parsed.detected._replace(layout=f"topic {name} in JSON"))
