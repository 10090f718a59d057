"""Recordings that the studio was started with: episodes, read when they are looked at, and what was found in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.lerobot import info
from kineme.io.reading.episode_recordings import episode_recordings, heads_of
from kineme.io.reading.episodes import holds_episodes, read_episodes
from kineme.io.reading.formats import entries_of, name_of
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.read_labels import read_labels
from kineme.io.reading.recordings import read_recordings
from kineme.io.records import needs
from kineme.io.writing.annotations import Annotation, to_csv
from kineme.library.correct import corrections_beside
from kineme.movements.episodes import Episode, place_of
from kineme.reporting.atomic import write_atomically
from kineme.studio.server.importing import columns_of
from kineme.studio.server.refusals import ConflictError, MissingError
from kineme.validation import Array

KEY = "episode-"  # what the key of an episode begins with; its position follows
HELD = 2**28  # bytes of the episodes that are kept in memory

#: First bytes of files that are videos, where they begin, and their kinds: nothing else is sent as one.
_VIDEOS = ((4, b"ftyp", "video/mp4"), (0, b"\x1a\x45\xdf\xa3", "video/webm"))
_HEAD = 16  # bytes that are read to know them

_NOTHING = np.zeros(0)

Movement = tuple[str, str]  # recording and place, as in `Annotation`


class Lane(NamedTuple):
    """The symbols of one movement."""

    annotations: tuple[Annotation, ...] = ()
    corrected: bool = False  # whether a person has changed any, and so has looked at all of them
    unknown: tuple[Annotation, ...] = ()  # the whole movement as one that is like no symbol

    @property
    def rows(self) -> tuple[Annotation, ...]:
        """What the table of corrections has of it: where all symbols were removed, that nothing is like one."""
        return self.annotations or self.unknown


def _lanes(annotations: Iterable[Annotation], corrected: bool) -> dict[Movement, Lane]:
    notes: dict[Movement, list[Annotation]] = {}
    for note in annotations:
        notes.setdefault((note.recording, note.place), []).append(note)
    return {movement: Lane(tuple(own), corrected) for movement, own in notes.items()}


class Corrections:
    """The lanes of all movements that were looked at, and a table of those that a person corrected.

    The table lies beside what was opened, see `corrections_beside`; one that is there is read, so that work goes on
    where it ended. A table that is none is left as it is, and is a problem.
    """

    def __init__(self, opened: Path) -> None:
        self.path = corrections_beside(opened)
        self.problem: str | None = None
        self.saved = True  # whether the table holds all that was corrected
        self._lanes: dict[Movement, Lane] = {}
        self._bytes: bytes | None = None  # of the table as it was read or written last; None: there was none
        self._turn = Lock()
        if self.path.is_file():
            self._read()

    def _read(self) -> None:
        try:
            rows = read_labels(self.path).rows
            self._bytes = self.path.read_bytes()
        except (DataError, OSError) as error:
            self.problem = f"{self.path.name} was not read: {error}"
            return
        notes = (Annotation(row.recording, row.place, row.start, row.end, row.label, float("nan"), 1.0) for row in rows)
        self._lanes = _lanes(notes, corrected=True)

    def add(self, annotations: Iterable[Annotation]) -> None:
        """Add what is known of movements from elsewhere, but for those that a person corrected."""
        self._lanes = _lanes(annotations, corrected=False) | self._lanes

    def lane(self, movement: Movement) -> Lane:
        """Return what was found in a movement, or corrected."""
        return self._lanes.get(movement, Lane())

    def put(self, movement: Movement, lane: Lane) -> None:
        """Replace it."""
        with self._turn:
            self.saved = self.saved and not (lane.corrected or self.lane(movement).corrected)
            self._lanes[movement] = lane

    @property
    def corrected(self) -> Sequence[Annotation]:
        """All annotations of movements that a person corrected, in the order in which they were first looked at."""
        return [note for lane in list(self._lanes.values()) if lane.corrected for note in lane.rows]

    def table(self) -> bytes:
        """Return `corrected` as `kineme annotate` writes annotations."""
        return to_csv(self.corrected)

    def save(self, *, replace: bool = False) -> Path:
        """Write the table; a ConflictError if it was written by others since, unless that is to be replaced."""
        with self._turn:
            now = self.path.read_bytes() if self.path.is_file() else None
            if now is not None and now != self._bytes and not replace:
                raise ConflictError(
                    f"expected {self.path.name} as this studio left it, others wrote it; replace it, or download yours"
                )
            table = self.table()
            try:
                write_atomically(self.path, table)
            except OSError as error:
                raise DataError(
                    f"expected to write {self.path.name} beside the recordings, got: {error.strerror or error}; "
                    "download it instead"
                ) from error
            self._bytes, self.saved = table, True
        return self.path


class Opened(NamedTuple):
    """A movement of what was opened."""

    episode: Episode
    recording: str  # it and the place as in `kineme.io.writing.annotations.Annotation`
    place: str
    file: Path | None = None  # which file it is a movement of; None: of a data set of episodes

    @property
    def movement(self) -> Movement:
        """The name under which its symbols are kept."""
        return self.recording, self.place

    @property
    def times(self) -> Array:
        """Time stamps (T,) [s]; those of the rate, where one is missing."""
        stamps, rate = self.episode.times, self.episode.fps
        return stamps if np.isfinite(stamps).all() else np.arange(len(stamps)) / (rate if rate > 0 else 1.0)

    @property
    def origin(self) -> float:
        """Time stamp of the first sample [s]."""
        return float(self.times[0]) if len(self.episode) else 0.0

    @property
    def heads(self) -> dict[str, tuple[str, ...]]:
        """Names of the columns of each feature; the one that is read by default comes first."""
        return heads_of(self.episode)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.times[-1]) - self.origin if len(self.episode) else 0.0


class OpenedRecordings:
    """The episodes of a path, by their position, with what was found in them; any thread may use it.

    Of a data set of LeRobot only the episodes that are asked for are read, where its description says that they lie.
    Anything else is read from its beginning up to them, and again where they were let go.
    """

    def __init__(self, path: Path, held: int = HELD) -> None:
        self.path, self.held = path, held
        self.name = str(name_of(path))
        self.corrections = Corrections(path)
        self.total: int | None = None  # None until all of it has been read
        self._info: info.Info | None = None
        self._numbers: list[int] | None = None
        if not path.exists():
            raise DataError(f"expected a file or folder of recordings, found nothing at {str(path)!r}")
        if (path / info.MARKER).is_file():
            with needs("pyarrow", "read LeRobot", "parquet"):
                from kineme.io.lerobot import episodes, motions
            self._lerobot = episodes
            self._info = info.read_info(path)
            self._numbers = info.read_episodes(path, self._info).numbers.tolist()
            self.total = len(self._numbers)
            try:
                self.corrections.add(
                    Annotation(self.name, place_of(motion.episode), *motion[1:6], uncertainty=motion.uncertainty)
                    for motion in motions.read_motions(path)
                )
            except DataError as error:
                self.corrections.problem = str(error)
        self._episodes: dict[int, Opened] = {}
        self._stream, self._next = opened_at(path), 0
        self._videos: dict[int, dict[str, info.Video]] | None = None  # by number and camera
        self._turn = Lock()

    def __contains__(self, key: str) -> bool:
        """Tell whether a key is of an episode, rather than of a file that was sent."""
        return key.startswith(KEY)

    def episode(self, key: str) -> Opened:
        """Return the episode of a key."""
        position = key.removeprefix(KEY)
        page = self.page(int(position), 1) if position.isdecimal() and len(position) < 10 else []
        if not page:
            raise MissingError(f"expected an episode of {self.name}, got {key[:40]!r}")
        return page[0]

    def page(self, offset: int, limit: int) -> list[Opened]:
        """Return some episodes in their order; behind the last there are none."""
        with self._turn:
            wanted = range(offset, offset + limit if self.total is None else min(offset + limit, self.total))
            if not all(k in self._episodes for k in wanted):
                if self._numbers is None:
                    self._stream_to(wanted)
                else:
                    self._read(self._numbers, [k for k in wanted if k not in self._episodes])
            page = [self._episodes[k] for k in wanted if k in self._episodes]
            for k in wanted:  # those asked for last are let go last
                if k in self._episodes:
                    self._episodes[k] = self._episodes.pop(k)
            sizes = {
                k: sum(values.nbytes for values in (item.episode.times, *item.episode.signals.values()))
                for k, item in self._episodes.items()
            }
            total = sum(sizes.values())
            for k in [k for k in self._episodes if k not in wanted]:
                if total <= self.held:
                    break
                total -= sizes[k]
                del self._episodes[k]
        return page

    def _read(self, numbers: Sequence[int], positions: Sequence[int]) -> None:
        """Read the episodes at these positions; one that cannot be read is there with its problem."""
        where = {numbers[k]: k for k in positions}
        reason = "expected frames of the episode, got none"
        try:
            for episode in self._lerobot.episodes(self.path, None, where):
                # Of one whose frames lie in two places, the first.
                opened = Opened(episode, self.name, place_of(episode.number))
                self._episodes.setdefault(where[episode.number], opened)
        except KinemeError as error:
            reason = str(error)
        for number, k in where.items():
            if k not in self._episodes:
                lost = Episode(number, _NOTHING, {}, {}, problems=(reason,), place=place_of(number))
                self._episodes[k] = Opened(lost, self.name, lost.place)

    def _stream_to(self, wanted: range) -> None:
        """Read on until these episodes are there, and one more says that there are others."""
        if any(k < self._next for k in wanted if k not in self._episodes):
            self._stream, self._next = opened_at(self.path), 0
        end = wanted.stop + (self.total is None)
        while self._next < end:
            episode = next(self._stream, None)
            if episode is None:
                self.total = self._next
                break
            self._episodes[self._next] = episode
            self._next += 1

    def about_video(self, opened: Opened, camera: str) -> dict[str, Any]:
        """Return when an episode begins in the video of a camera [s], and its codec, None if no file says it."""
        if self._info is None:
            return {"start": 0.0, "codec": None}
        if self._videos is None:
            self._videos = info.read_videos(self.path, self._info)
        video = self._videos.get(opened.episode.number, {}).get(camera)
        return {"start": 0.0 if video is None else video.start, "codec": self._info.cameras.get(camera)}

    def video(self, opened: Opened, camera: str) -> tuple[Path, str]:
        """Return the file of a camera's video in the data set and its kind by its first bytes, or a MissingError."""
        name = opened.episode.videos.get(camera)
        if name is None or Path(name).is_absolute() or ".." in Path(name).parts:
            cameras = list(opened.episode.videos)
            raise MissingError(f"expected a video of {opened.place}, of one of {cameras}, got {camera[:80]!r}")
        path = self.path / name
        try:
            with path.open("rb") as file:
                head = file.read(_HEAD)
        except OSError as error:
            raise MissingError(f"expected the video {path.name}, got: {error.strerror or error}") from error
        for at, mark, kind in _VIDEOS:
            if head[at : at + len(mark)] == mark:
                return path, kind
        raise MissingError(f"expected a video (MP4, WebM) in {path.name}, got something else")

    def recordings(self, key: str, columns: Sequence[str] = ()) -> Recordings:
        """Read one episode as a recording, in these columns or in all, or, if these are none, those read by default."""
        opened = self.episode(key)
        if opened.file is None:
            try:
                return episode_recordings(opened.episode, opened.recording, columns)
            except KinemeError:
                default = next(iter(opened.heads.values()), ())
                if columns or not default:
                    raise
                return episode_recordings(opened.episode, opened.recording, default)
        read = read_recordings(opened.file, columns=list(columns) or None)
        sources = [source._replace(path=opened.recording) for source in read.sources]
        if opened.place not in (places := [source.place for source in sources]):
            raise DataError(f"expected the movement {opened.place!r} in {opened.recording} in these columns, got none")
        return movement_of(replace(read, sources=tuple(sources), problems=()), places.index(opened.place))


def movement_of(read: Recordings, k: int) -> Recordings:
    """Return one of the movements that were read."""
    return replace(read, demonstrations=read.demonstrations[k : k + 1], sources=read.sources[k : k + 1])


def opened_at(path: Path) -> Iterator[Opened]:
    """Yield the movements of a data set of episodes, or of files; a file that cannot be read is one with a problem."""
    if holds_episodes(path):
        for episode in read_episodes(path):
            is_file = bool(episode.place) and path.is_dir() and (path / episode.place).is_file()
            yield Opened(episode, *((episode.place, "") if is_file else (str(name_of(path)), episode.place)))
        return
    number = 0
    for entry in entries_of([path])[0]:
        try:
            read = read_recordings(entry.path)
        except KinemeError as error:
            lost = Episode(number, _NOTHING, {}, {}, problems=(str(error),), place=entry.name)
            yield Opened(lost, entry.name, "", entry.path)
            number += 1
            continue
        demos, names = read.demonstrations, {"": tuple(columns_of(read))}
        for k, source in enumerate(read.sources):
            rows = slice(demos.offsets[k], demos.offsets[k + 1])
            where = " ".join(filter(None, (entry.name, source.place)))
            label = source.label or entry.relative.parent.name or None
            values = {"": demos.recorded[rows].copy()}
            episode = Episode(number, demos.times[rows].copy(), values, names, label, place=where)
            yield Opened(episode, entry.name, source.place, entry.path)
            number += 1
