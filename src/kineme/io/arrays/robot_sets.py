"""Data sets of robots in arrays: the table of their layouts, their episodes, and their movements.

Sources of the layouts: robomimic, "Dataset Structure" of its documentation, with what LIBERO and robocasa add; ACT,
``record_sim_episodes.py``, and ALOHA, ``record_episodes.py``; UMI, ``07_generate_replay_buffer.py``; Diffusion Policy,
``replay_buffer.py``. Names of features are those that LeRobot gives after conversion. Images are never read.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.hdf5 import DAMAGE, hdf5_file, hdf5_group, hdf5_tree, texts_of
from kineme.io.arrays.tree_movements import heads_of_array, tree_movements
from kineme.io.arrays.trees import GROUPS, flat, rate_of
from kineme.io.arrays.zarr_arrays import ZarrArray, zarr_arrays
from kineme.io.limits import check_expanded
from kineme.io.records import damaged_as
from kineme.movements.episodes import Episode, head_of, place_of
from kineme.movements.tables.layout import Layout, Parsed, listed
from kineme.movements.tables.time_stamps import words_of
from kineme.validation import Array, check_number

HDF5, ZARR = (".hdf5", ".h5"), (".zarr", ".zip")
ENDS = "meta/episode_ends"  # of Zarr: the number of rows up to the end of each episode
_DATA = "data/"  # of Zarr: what the names of arrays with a row for each frame begin with

_WIDEST = 1000  # numbers in a row; images have more
_LONGEST = 2**20  # letters of a description in JSON
_NUMBER = re.compile(r"(\d{1,18})$")
_JOINTS = ("waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "gripper")
_FILL = "the fill value of the array"


class RobotLayout(NamedTuple):
    """A layout of robot data in arrays: where it has what, and what is said of it where the file does not say it."""

    name: str
    marks: tuple[str, ...]  # patterns of what a file has, one of each
    # Paths of arrays within an episode -> names of the features; arrays that match none are read where they are named.
    features: tuple[tuple[str, str], ...]
    coordinates: str  # features of a movement, unless others are chosen
    unit: str  # of these
    hertz: float  # where the file says no rate
    convention: str  # whose rate that is


ROBOMIMIC = RobotLayout(
    "robomimic", (r"data/demo_\d+",), ((r"actions?", "action"), (r"obs/(.*)", r"observation.\1")),
    r"observation\..*(eef|ee)_pos", "m", 20.0, "the control rate of robosuite",
)  # fmt: skip
ALOHA = RobotLayout(
    "ALOHA", ("action", "observations/qpos"),
    (("action", "action"), ("observations/qpos", "observation.state"), ("observations/qvel", "observation.velocity"),
     ("observations/effort", "observation.effort"), ("base_action", "base_action")),
    r"observation\.state", "rad", 50.0, "the rate of ALOHA and ACT",
)  # fmt: skip
UMI = RobotLayout(
    "UMI", (r"data/robot\d+_eef_pos", ENDS),
    ((r"(robot\d+_(?:eef_pos|eef_rot_axis_angle|gripper_width))", r"observation.\1"), ("action", "action")),
    r"observation\.robot\d+_eef_pos", "m", 60_000 / 1001, "the frame rate of its camera",
)  # fmt: skip
BUFFER = RobotLayout(
    "Diffusion Policy", ("data/action", ENDS),
    (("action", "action"), ("state", "observation.state"), (r"(\w*(?:pos|rot|pose|width|qvel))", r"observation.\1")),
    r"observation\.state|observation\..*eef_pos", "", 10.0, "the rate of its policies",
)  # fmt: skip

#: Layouts of HDF5, and of Zarr, in the order in which they are tried.
LAYOUTS = {"HDF5": (ROBOMIMIC, ALOHA), "Zarr": (UMI, BUFFER)}


class _Part(NamedTuple):
    """One episode in a file: its arrays, not read yet, and what the file says of it."""

    place: str
    arrays: Mapping[str, Any]  # path within the episode -> what has a shape, a dtype, and rows
    hertz: float = math.nan
    task: str | None = None
    notes: tuple[str, ...] = ()
    length: int | None = None  # as it is declared
    problems: tuple[str, ...] = ()


def robot_layout(path: Path) -> RobotLayout | None:
    """Tell the layout of a file, or of the first in a folder; None of others, a `DataError` if a package is missing."""
    try:
        for source in _sources(path)[:1]:
            if source.suffix.lower() in HDF5:
                with hdf5_file(source) as file:
                    return _of_hdf5(file)
            with zarr_arrays(source) as arrays:
                return _marked(arrays, LAYOUTS["Zarr"])
    except (OSError, ValueError) as error:  # a `DataError` is an OSError
        if isinstance(error.__cause__, ImportError):
            raise
    return None


def robot_episodes(path: Path, features: Sequence[str] | None = None, rate: float | None = None) -> Iterator[Episode]:
    """Yield the episodes of a file, or of all files of a folder, one in memory at a time.

    Features are those of the robot and of its commands, or those that are named, also by the paths of their arrays. The
    stamps are even: by `rate` [1/s], else by what the file says, else by the custom of the layout, which `notes` say.
    What cannot be read of an episode is among its `problems`. A `DataError` says why a set cannot be read at all.
    """
    if rate is not None:
        check_number("rate", rate, above=0)
    sources, number, taken = _sources(path), 0, set[int]()
    if not sources:
        raise DataError(f"expected HDF5 files of a robot in {path.name}, got none")
    for source in sources:
        beside = source.name if len(sources) > 1 else ""
        try:
            for row, part in _parts(source):
                place = "/".join(text for text in (beside, part.place) if text) or source.name
                # Numbers in several files of many episodes would repeat.
                own = _NUMBER.search(part.place or source.stem) if row is ALOHA or not beside else None
                number = free_number(int(own[1]) if own else number, taken)
                yield _episode(row, part, features, number, place, rate)
                number += 1
        except DataError as error:
            if not beside or features is not None:
                raise
            number = free_number(number, taken)
            yield Episode(number, np.empty(0), {}, {}, problems=(str(error),), place=beside)
            number += 1


def free_number(number: int, taken: set[int]) -> int:
    """Return a number, or the next one where files of several names count alike, and add it to those taken."""
    number = max(taken) + 1 if number in taken else number
    taken.add(number)
    return number


def _parts(source: Path) -> Iterator[tuple[RobotLayout, _Part]]:
    """Yield the episodes of one file, whose arrays are not read yet."""
    if source.suffix.lower() in HDF5:
        with hdf5_file(source) as file:
            if (row := _of_hdf5(file)) is None:
                raise DataError(f"expected episodes of a robot in {source.name}, got {listed(file)}")
            for part in _in_hdf5(file, row):
                yield row, part
        return
    with zarr_arrays(source) as arrays:
        row = _buffer_in(arrays, source)
        for k, (start, end) in enumerate(_spans(arrays)):
            rows = {name.removeprefix(_DATA): _Rows(array, start, end) for name, array in arrays.items()}
            yield row, _Part(place_of(k), rows, length=max(0, end - start))


def _in_hdf5(file: Any, row: RobotLayout) -> Iterator[_Part]:
    """Yield the episodes of an open file; the demonstrations of robomimic by their numbers."""
    if row is ALOHA:
        yield _Part("", dict(flat(hdf5_tree(file), "/")), task=_text(file.attrs.get("task")))
        return
    data, masks = hdf5_group(file, "data"), hdf5_group(file, "mask")
    hertz = _described(data, "env_args", "env_kwargs", "control_freq")
    task = _described(data, "problem_info", "language_instruction") or _described(data, "env_args", "env_name")
    subsets = {name: {*texts_of(masks[name])} for name in masks if getattr(masks[name], "ndim", 0) == 1}
    for name in sorted((name for name in data if _NUMBER.search(name)), key=in_order):
        part = _Part(
            f"data/{name}",
            {},
            hertz if isinstance(hertz, int | float) and 0 < hertz < math.inf else math.nan,
            _text(task),
            tuple(f"in the subset {subset}" for subset, names in subsets.items() if name in names),
        )
        try:
            with damaged_as(f"expected the group data/{name}, got a damaged one", *DAMAGE):
                demo = hdf5_group(data, name)
                task_of_demo = _text(_described(demo, "ep_meta", "lang")) if demo else None
                length = demo.attrs.get("num_samples") if demo else None
                part = part._replace(
                    arrays=dict(flat(hdf5_tree(demo), "/")) if demo else {},
                    task=task_of_demo or part.task,
                    length=int(length) if isinstance(length, int | np.integer) else None,
                )
        except DataError as error:
            part = part._replace(problems=(str(error),))
        yield part


class _Rows:
    """Rows of an array in Zarr, from `start` to before `end`, or why it is not read."""

    def __init__(self, array: ZarrArray | DataError, start: int, end: int) -> None:
        self._array, self.fault = array, str(array) if isinstance(array, DataError) else ""
        shape = (0,) if isinstance(array, DataError) else array.shape
        self.dtype = np.dtype(np.float64 if isinstance(array, DataError) else array.dtype)
        self._first, self._last = max(0, start), max(0, start, min(end, shape[0]))
        self.shape = (self._last - self._first, *shape[1:])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        if isinstance(self._array, DataError):
            raise self._array
        return np.asarray(self._array.rows(self._first, self._last), dtype)

    @property
    def is_partial(self) -> bool:
        """True if parts of it are not there."""
        return isinstance(self._array, ZarrArray) and self._array.lacks(self._first, self._last)


def _episode(
    row: RobotLayout, part: _Part, features: Sequence[str] | None, number: int, place: str, rate: float | None
) -> Episode:
    """Read an episode, at the rate that is asked for [1/s], if one is."""
    arrays = {name: part.arrays[path] for name, path in _features(row, part.arrays, features).items()}
    if features is not None and not part.problems and (unknown := [name for name in features if name not in arrays]):
        there = listed([*_features(row, part.arrays, None), *part.arrays])
        raise DataError(f"expected features of {place} ({there}), got {unknown[0]!r}")
    faults = {name: array.fault for name, array in arrays.items() if getattr(array, "fault", "")}
    lengths = Counter(array.shape[0] for name, array in arrays.items() if name not in faults)
    length = lengths.most_common(1)[0][0] if lengths else 0
    problems = [*part.problems] if length or part.problems else ["expected arrays of numbers with rows, got none"]
    if part.length not in (None, length):
        problems.append(f"expected {part.length} rows as declared, got {length}")
    check_expanded(8 * sum(math.prod(array.shape) for array in arrays.values()), "an episode")
    signals: dict[str, Array] = {}
    for name, array in arrays.items():
        if name in faults:
            problems.append(faults[name])
            continue
        if array.shape[0] != length:
            problems.append(f"expected {length} rows of {name} as of others, got {array.shape[0]}")
            continue
        try:
            with damaged_as(f"expected numbers in {name}, got damaged ones", *DAMAGE):
                signals[name] = np.asarray(array, np.float64).reshape(length, math.prod(array.shape[1:]))
        except DataError as error:
            problems.append(str(error))
        if getattr(array, "is_partial", False):
            problems.append(f"parts of {name} are not there: lost, or never written; they count as {_FILL}")
    fps = part.hertz if rate is None else rate
    custom = () if fps > 0 else (f"{row.hertz:.4g} Hz assumed, {row.convention}",)
    times = np.arange(length) / (fps if fps > 0 else row.hertz)
    names = {name: _entries(row, name, values.shape[1]) for name, values in signals.items()}
    notes = (*custom, *part.notes)
    return Episode(number, times, signals, names, part.task, fps, tuple(problems), place, notes=notes)


def _features(row: RobotLayout, arrays: Mapping[str, Any], chosen: Sequence[str] | None) -> dict[str, str]:
    """Return feature -> path of its array, of those of numbers that are no images; or of those chosen."""
    features: dict[str, str] = {}
    for path, array in arrays.items():
        is_image = len(array.shape) > 2 and array.dtype == np.uint8
        is_row = bool(array.shape) and 0 < math.prod(array.shape[1:]) <= _WIDEST
        if array.dtype.kind not in "biuf" or is_image or not is_row:
            continue
        matches = ((re.fullmatch(pattern, path), name) for pattern, name in row.features)
        name = next((match.expand(name) for match, name in matches if match), None)
        if chosen is None and name is not None:
            features[name] = path
        elif chosen is not None:
            features |= {each: path for each in (name or path, path) if each in chosen}
    return features if chosen is None else {name: features[name] for name in chosen if name in features}


def _entries(row: RobotLayout, feature: str, width: int) -> tuple[str, ...]:
    """Name the entries of a feature: joints of ALOHA, axes of a position, components of a quaternion, else numbers."""
    arms = {7: ("",), 14: ("left_", "right_")}.get(width, ())
    if row is ALOHA and arms:
        return tuple(f"{arm}{joint}" for arm in arms for joint in _JOINTS)
    last = words_of(feature)[-1:]
    if width == 1 or (width == 3 and last == ("pos",)) or (width == 4 and last == ("quat",)):
        return {1: ("",), 3: ("x", "y", "z"), 4: ("x", "y", "z", "w")}[width]
    return tuple(map(str, range(width)))


def hdf5_or_robot_movements(path: Path, layout: Layout) -> Parsed:
    """Return the movements in an HDF5 file; columns, their units and a rate need not be said of a robot's layout."""
    with hdf5_file(path) as file:
        tree, row = hdf5_tree(file), _of_hdf5(file)
        first = None if row is None else next(_in_hdf5(file, row), None)
        if row is None or first is None:
            return tree_movements(tree, layout, "HDF5", GROUPS)
        if row is ALOHA:
            return _movements(tree, tree, row, first, layout, "HDF5")
        for name in (name for name, demo in tree["data"].items() if isinstance(demo, dict)):
            demo = hdf5_group(hdf5_group(file, "data"), name)
            tree["data"][name]["task"] = _text(_described(demo, "ep_meta", "lang")) or first.task
        return _movements(tree, tree["data"], row, first, layout, "HDF5")


def zarr_movements(path: Path, layout: Layout) -> Parsed:
    """Return the movements of a replay buffer in Zarr, one for each episode; coordinates as of `robot_episodes`."""
    with zarr_arrays(path) as arrays:
        row = _buffer_in(arrays, path)
        of_data = {
            name.removeprefix(_DATA): array
            for name, array in arrays.items()
            if name.startswith(_DATA) and isinstance(array, ZarrArray) and math.prod(array.shape[1:]) <= _WIDEST
        }
        spans = [(k, start, end) for k, (start, end) in enumerate(_spans(arrays))]
        n_rows = min((array.shape[0] for array in of_data.values()), default=0)
        left_out = [
            f"{place_of(k)}: expected rows among {n_rows:,}, got {start} to {end}"
            for k, start, end in spans
            if not start < end <= n_rows
        ]
        tree: dict[str, Any] = {
            place_of(k): {name: _Rows(array, start, end) for name, array in of_data.items()}
            for k, start, end in spans
            if start < end <= n_rows
        }
        first = _Part("", next(iter(tree.values()), {}))
        parsed = _movements(tree, tree, row, first, layout, "Zarr")
        return parsed._replace(left_out=(*parsed.left_out, *left_out))


def _movements(
    tree: dict[str, Any], group: dict[str, Any], row: RobotLayout, first: _Part, layout: Layout, kind: str
) -> Parsed:
    """Read the movements of a tree, all in one group of it, by the coordinates and the rate of the first."""
    rated = rate_of(group) is not None or rate_of(tree) is not None
    if not rated:
        rated = first.hertz > 0
        group["rate"] = first.hertz if rated else row.hertz
    features = _features(row, first.arrays, None)
    paths = {name: path for name, path in features.items() if re.fullmatch(row.coordinates, name)}
    joints = {  # head in the file -> name of the joint
        f"{path}.{k}": entry
        for name, path in paths.items()
        if row is ALOHA and len(first.arrays[path].shape) == 2
        for k, entry in enumerate(_entries(row, name, first.arrays[path].shape[1]))
        if not entry.isdecimal()
    }
    of_file = {entry: head for head, entry in joints.items()}
    for name, path in features.items():  # as `robot_episodes` calls them, and a library that was discovered in these
        of_array = heads_of_array(path, first.arrays[path].shape)
        entries = _entries(row, name, len(of_array))
        of_file |= {head_of(name, entry): head for entry, head in zip(entries, of_array, strict=True)}
    named = {of_file[str(column)]: str(column) for column in layout.coordinates or () if str(column) in of_file}
    columns = [of_file.get(str(column), column) for column in layout.coordinates or paths.values()]
    parsed = tree_movements(tree, replace(layout, columns=columns or None), kind, GROUPS)
    heads = parsed.detected.columns
    names = tuple(named.get(head, joints.get(head, head)) for head in heads)
    starts = tuple(f"{path}." for path in paths.values())
    measured = {  # those whose unit is that of the coordinates: of a gripper it is another
        head: head in joints and not joints[head].endswith("gripper") if row is ALOHA else head.startswith(starts)
        for head in heads
    }
    units = parsed.detected.measured_in or tuple(row.unit if measured[head] else "" for head in heads)
    parsed = parsed._replace(detected=parsed.detected._replace(columns=names, measured_in=units))
    detected = parsed.detected._replace(layout=row.name)
    if not rated and not isinstance(layout.units, int | float):
        custom = f"{row.hertz:.4g} Hz assumed, {row.convention}; else give --units, the seconds between two samples"
        detected = detected._replace(units_from=custom)
    return parsed._replace(detected=detected)


def _sources(path: Path) -> list[Path]:
    """List the file or the Zarr folder itself, or the HDF5 files in a folder by the numbers in their names."""
    if not path.is_dir() or path.suffix.lower() == ZARR[0] or (path / ENDS).is_dir():
        return [path] if path.suffix.lower() in (*HDF5, *ZARR) or path.is_dir() else []
    top = path.resolve()
    files = [file for file in path.iterdir() if file.suffix.lower() in HDF5 and not file.name.startswith(".")]
    # No link leads to other files.
    return sorted((file for file in files if file.resolve().is_relative_to(top)), key=lambda file: in_order(file.stem))


def in_order(name: str) -> tuple[str, int, str]:
    """Return a key that sorts names by the numbers at their ends."""
    match = _NUMBER.search(name)
    return (name[: match.start()], int(match[1]), name) if match else (name, -1, name)


def _spans(arrays: Mapping[str, ZarrArray | DataError]) -> list[tuple[int, int]]:
    """Return the first row of each episode, and the one after its last."""
    ends = arrays[ENDS]
    if isinstance(ends, DataError):
        raise ends
    if len(ends.shape) != 1 or ends.dtype.kind not in "iu" or ends.lacks(0, ends.shape[0]):
        raise DataError(f"expected whole numbers in {ENDS}, got {ends.dtype} of shape {ends.shape}, or none")
    values = ends.rows(0, ends.shape[0]).astype(np.int64)
    return list(zip(np.append(0, values[:-1]).tolist(), values.tolist(), strict=True))


def _of_hdf5(file: Any) -> RobotLayout | None:
    """Tell the layout of an open HDF5 file by the names of its groups and data sets."""
    names = [*file, *(f"{group}/{name}" for group in ("data", "observations") for name in hdf5_group(file, group))]
    return _marked(names, LAYOUTS["HDF5"])


def _buffer_in(arrays: Mapping[str, Any], path: Path) -> RobotLayout:
    """Tell the layout of a replay buffer in Zarr; a `DataError` if it is none."""
    if (row := _marked(arrays, LAYOUTS["Zarr"])) is None:
        raise DataError(f"expected a replay buffer in {path.name}, with data/ and {ENDS}, got {listed(arrays)}")
    return row


def _marked(names: Iterable[str], rows: Sequence[RobotLayout]) -> RobotLayout | None:
    return next(
        (row for row in rows if all(any(re.fullmatch(mark, name) for name in names) for mark in row.marks)), None
    )


def _described(stored: Any, name: str, *keys: str) -> Any:
    """Return an entry of the JSON in an attribute, by its keys; None where there is none."""
    with suppress(RecursionError, *DAMAGE):
        value = json.loads(_text(stored.attrs.get(name)) or "null")
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return value
    return None


def _text(value: Any) -> str | None:
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return value if isinstance(value, str) and len(value) <= _LONGEST else None
