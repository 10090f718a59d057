"""Movements, episodes of robot data and lanes of symbols in a file for the viewer of Rerun."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import UNKNOWN, needs
from kineme.io.writing.annotations import Annotation
from kineme.io.writing.write_movement import ColumnNames, Columns, columns_of
from kineme.movements.channels.detect import NO_PLACES
from kineme.movements.episodes import Episode
from kineme.movements.tables.time_stamps import words_of
from kineme.movements.trajectories.movements import axis_names
from kineme.reporting.atomic import whole_file
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.text import printable
from kineme.sampling import evenly_spaced
from kineme.units import split_head
from kineme.validation import Array

ENDING = ".rrd"
TIMELINE = "time"  # seconds since the first sample of a scene

_PALETTE = (BLUE, ORANGE, GREEN, PURPLE)
_LIGHTER = 0.4  # of the way to white, when all colors are taken, once or twice
_POINTS = 5000  # of a drawn path, at most
_DOT = 6.0  # radius of a moving point, on the screen
_ABOVE = 1.5  # of the extent of paths in a plane: height from which they are seen
_LEAST = 1e-6  # extent, where nothing moves
_LATEST = 9e9  # [s] since the first sample: the viewer counts nanoseconds in 64 bits
_PLOTS = 6  # plots of one scene; features beyond share one
_TABS = 50  # scenes with a view of their own; the tree of the viewer has all
_AXIS = re.compile(r"(?:(.*)[._/ -])?([xyz])", re.IGNORECASE)
#: Words of what has three entries and is no point.
_DIRECTIONS = NO_PLACES | frozenset(
    {"quat", "quaternion", "orientation", "rot", "rotation", "rotvec", "axis", "angle", "rpy", "v", "angular", "wrench",
     "scale"}
)  # fmt: skip


class Stretch(NamedTuple):
    """A state of a lane between two time stamps [s], by the clock of its scene."""

    start: float
    end: float
    state: str


@dataclass(frozen=True, eq=False)
class Scene:
    """One movement or episode as the viewer shows it: T samples at common time stamps.

    - `name`: its place in the tree of the viewer.
    - `times` (T,): stamps [s]; shown since the first one, those without a finite one, or one centuries later, are not.
    - `signals`: name of a plot -> its curves (T, d).
    - `names`: name of a plot -> the names of its d curves.
    - `paths`: name of a point -> its positions (T, 3), or (T, 2), which are shown in the plane z = 0.
    - `lanes`: name of a lane -> its stretches; where two overlap, the one that begins later is shown.
    """

    name: str
    times: Array
    signals: Mapping[str, Array] = field(default_factory=dict)
    names: Mapping[str, Sequence[str]] = field(default_factory=dict)
    paths: Mapping[str, Array] = field(default_factory=dict)
    lanes: Mapping[str, Sequence[Stretch]] = field(default_factory=dict)


def episode_scene(episode: Episode, lanes: Mapping[str, Sequence[Stretch]] | None = None) -> Scene:
    """Return an episode as a scene: a plot for each feature, a path for each point among their names."""
    paths = {
        f"{feature} {point}".strip(): xs
        for feature, values in episode.signals.items()
        for point, xs in points_in(episode.names.get(feature, ()), values).items()
    }
    return Scene(episode.label, episode.times, episode.signals, episode.names, paths, lanes or {})


def movement_scene(
    name: str, columns: Columns, names: ColumnNames | None, lanes: Mapping[str, Sequence[Stretch]] | None = None
) -> Scene:
    """Return a movement, as `kineme.io.writing.write_movement` takes it, as a scene."""
    signals = {key: values for key, values in columns.items() if key != "times"}
    heads = {key: tuple(axis_names(values.shape[1])) for key, values in signals.items()}
    if names is not None:
        heads = {key: names.positions if key == "positions" else names.rates for key in signals}
    paths = points_in(heads["positions"], signals["positions"])
    return Scene(name, columns["times"], signals, heads, paths, lanes or {})


def recording_scenes(recordings: Recordings, annotations: Sequence[Annotation]) -> Iterator[Scene]:
    """Yield a scene for each movement of some recordings, with the lane ``symbols`` where they are annotated."""
    lanes: dict[tuple[str, str], list[Stretch]] = {}
    for note in annotations:
        state = UNKNOWN if note.symbol is None else note.symbol
        lanes.setdefault((note.recording, note.place), []).append(Stretch(note.start, note.end, state))
    for movement, source in zip(recordings.demonstrations, recordings.sources, strict=True):
        stretches = lanes.get((source.path, source.place))
        columns, names = columns_of(movement)
        name = f"{source.path} {source.place}".strip()
        yield movement_scene(name, columns, names, {"symbols": stretches} if stretches else None)


def points_in(names: Sequence[str], values: Array) -> dict[str, Array]:
    """Find the points whose x and y, or x, y and z, are among columns: point -> positions (T, 2) or (T, 3).

    Names end in the axis, before a unit in brackets: ``x``, ``hand.x [mm]``. Velocities, quaternions and rotation
    vectors, by the words of their names, are no points. The name of a point may be empty.
    """
    axes: dict[str, dict[str, int]] = {}
    for k, name in enumerate(names):
        head = split_head(name)[0]
        if match := _AXIS.fullmatch(head):
            axes.setdefault(match[1] or "", {}).setdefault(match[2].lower(), k)
    heads = {split_head(name)[0].lower() for name in names}
    return {
        point: values[:, [places[axis] for axis in sorted(places)]]
        for point, places in axes.items()
        if sorted(places) in (["x", "y"], ["x", "y", "z"])
        and not {*words_of(point)} & _DIRECTIONS
        and not any(f"{point}{mark}w".lower() in heads for mark in "._/ -")  # of a quaternion
    }


def write_rerun(path: Path, scenes: Iterable[Scene], *, replace: bool = False) -> Path:
    """Write scenes to an ``.rrd`` file, whole or not at all, one after the other: one is in memory at a time.

    Each scene has its own branch ``/NAME`` of the tree, on the timeline ``time``, which counts seconds since its first
    sample: paths and moving points below ``points``, curves below ``signals``, states below ``symbols``. The blueprint
    in the file lays them out, in tabs where there are several.

    Raises `DataError`: another ending than .rrd; no package rerun-sdk; Rerun switched off by its environment variable;
    no scene. Raises `OSError`: a file that is there, unless it is replaced; a folder that cannot be written to.
    """
    if path.suffix.lower() != ENDING:
        raise DataError(f"expected a file ending in {ENDING} for Rerun, got {path.suffix or 'no ending'!r}")
    with needs("rerun-sdk", "write for the viewer of Rerun", "rerun"):
        import rerun as rr
    views: list[Any] = []
    colors: dict[str, int] = {UNKNOWN: _rgba(GRAY)}
    names: set[str] = set()
    with whole_file(path, replace=replace) as beside:
        recording = rr.RecordingStream("kineme")
        if not rr.is_enabled(recording):
            raise DataError("expected Rerun to write, the environment variable RERUN switches it off; unset it")
        recording.save(beside)
        try:
            recording.send_recording_name(printable(path.stem))
            for scene in scenes:
                name, k = scene.name, 1
                while name in names:
                    k += 1
                    name = f"{scene.name} ({k})"
                names.add(name)
                branch = f"/{rr.escape_entity_path_part(printable(name))}"
                _log_scene(rr, recording, branch, scene, colors)
                if len(views) < _TABS:
                    views.append(_view(rr, branch, printable(name), scene))
            if not views:
                raise DataError("expected movements or episodes to write for Rerun, got none")
            shown = views[0] if len(views) == 1 else rr.blueprint.Tabs(*views)
            recording.send_blueprint(rr.blueprint.Blueprint(shown, rr.blueprint.TimePanel(timeline=TIMELINE)))
            recording.flush()
        finally:
            recording.disconnect()
    return path


def _log_scene(rr: Any, recording: Any, branch: str, scene: Scene, colors: dict[str, int]) -> None:
    """Log a scene below a branch of the tree, each array as one column; `colors` of states are added to."""
    import pyarrow as pa  # of which rerun-sdk consists

    times = np.asarray(scene.times, float)
    finite = times[np.isfinite(times)]
    origin = float(finite[0]) if len(finite) else 0.0
    rows = np.flatnonzero(np.abs(times - origin) <= _LATEST)
    index = [rr.TimeColumn(TIMELINE, duration=times[rows] - origin)]
    for plot, values in scene.signals.items():
        entity = f"{branch}/signals/{rr.escape_entity_path_part(plot)}"
        curves = np.asarray(values, float)[rows]
        curves = curves.reshape(len(rows), math.prod(curves.shape[1:]))
        heads = [printable(head) for head in scene.names.get(plot, ())] or [str(k) for k in range(curves.shape[1])]
        recording.log(entity, rr.SeriesLines(names=heads), static=True, strict=True)
        recording.send_columns(entity, indexes=index, columns=rr.Scalars.columns(scalars=curves), strict=True)
    for k, (point, positions) in enumerate(scene.paths.items()):
        entity = f"{branch}/points/{rr.escape_entity_path_part(printable(point) or 'point')}"
        xyz = np.zeros((len(rows), 3))
        xyz[:, : positions.shape[1]] = positions[rows]
        finite = np.isfinite(xyz).all(axis=1)
        line, color = xyz[finite], _shade(k)
        if len(line):
            drawn = rr.LineStrips3D([line[evenly_spaced(len(line), _POINTS)]], colors=color)
            recording.log(f"{entity}/path", drawn, static=True, strict=True)
            look = rr.Points3D.from_fields(colors=color, radii=rr.Radius.ui_points(_DOT))
            recording.log(entity, look, static=True, strict=True)
            stamps = [rr.TimeColumn(TIMELINE, duration=times[rows][finite] - origin)]
            recording.send_columns(entity, indexes=stamps, columns=rr.Points3D.columns(positions=line), strict=True)
    for lane, several in scene.lanes.items():
        stretches = [each for each in several if np.abs(np.array(each[:2]) - origin).max() <= _LATEST]
        if not stretches:
            continue
        entity = f"{branch}/symbols/{rr.escape_entity_path_part(printable(lane))}"
        for state in dict.fromkeys(stretch.state for stretch in stretches):
            colors.setdefault(state, _shade(len(colors) - 1))
        shown = {printable(stretch.state): colors[stretch.state] for stretch in stretches}
        look = rr.StateConfiguration(values=[*shown], labels=[*shown], colors=np.array([*shown.values()], np.uint32))
        recording.log(entity, look, static=True, strict=True)
        stamps, states = _changes(stretches)
        changes = [rr.TimeColumn(TIMELINE, duration=np.array(stamps) - origin)]
        # A null in an Arrow array ends a state; None in a list is taken for a text, and in `StateChange` dropped.
        columns = rr.StateChange.columns(state=pa.array(states, pa.string()))
        recording.send_columns(entity, indexes=changes, columns=columns, strict=True)


def _changes(stretches: Sequence[Stretch]) -> tuple[list[float], list[str | None]]:
    """Return when a lane changes its state [s], and the states it then has; None where it has none."""
    ordered = sorted(stretches)
    following = [stretch.start for stretch in ordered[1:]] + [np.inf]
    changes: list[tuple[float, str | None]] = []
    for stretch, after in zip(ordered, following, strict=True):
        changes.append((stretch.start, printable(stretch.state)))
        if stretch.end < after:
            changes.append((stretch.end, None))
    return [when for when, _ in changes], [state for _, state in changes]


def _shade(k: int) -> int:
    """Return the k-th color, as `_rgba`, for something with a name: those of the palette, then the same lighter."""
    return _rgba(_PALETTE[k % len(_PALETTE)], 1.0 - (1.0 - _LIGHTER) ** (k // len(_PALETTE) % 3))


def _rgba(color: str, lighter: float = 0.0) -> int:
    """Return a color ``#RRGGBB``, so much of the way to white, as the number 0xRRGGBBFF."""
    channels = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    red, green, blue = (round(channel + lighter * (255 - channel)) for channel in channels)
    return red << 24 | green << 16 | blue << 8 | 0xFF


def _view(rr: Any, branch: str, name: str, scene: Scene) -> Any:
    """Lay a scene out: points at the left, curves over lanes at the right."""
    rrb = rr.blueprint
    plots = [(plot, f"{branch}/signals/{rr.escape_entity_path_part(plot)}") for plot in scene.signals]
    if len(plots) > _PLOTS:
        plots = [("signals", f"{branch}/signals")]
    rows = [rrb.TimeSeriesView(origin=origin, name=printable(plot)) for plot, origin in plots]
    shares = [2.0] * len(rows)
    if scene.lanes:
        rows.append(rrb.StateTimelineView(origin=f"{branch}/symbols", name="symbols"))
        shares.append(1.0)
    over_time = [rrb.Vertical(*rows, row_shares=shares)] if rows else []
    eye, planar = None, [xy for xy in scene.paths.values() if xy.shape[1] == 2 and np.isfinite(xy).any()]
    if planar and len(planar) == len(scene.paths):  # as paths in the plane are drawn: seen from above, y upwards
        low, high = np.nanmin(np.concatenate(planar), axis=0), np.nanmax(np.concatenate(planar), axis=0)
        x, y = (low + high) / 2
        height = _ABOVE * max(float((high - low).max()), _LEAST)
        eye = rrb.EyeControls3D(position=(x, y, height), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0))
    points = [rrb.Spatial3DView(origin=f"{branch}/points", name="paths", eye_controls=eye)] if scene.paths else []
    return rrb.Horizontal(*points, *over_time, name=name)
