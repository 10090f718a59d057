"""Recordings that clients send: what they hold, what happens when in them, and learning it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Header, Request
from fastapi.responses import Response
from pydantic import BaseModel, Field

from kineme.errors import DataError, SpecificationError
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.read_labels import LabelRow, LabelTable, labeled_pieces
from kineme.io.writing.annotations import WRITERS, Annotation, write_annotations
from kineme.io.writing.rerun import points_in, recording_scenes, write_rerun
from kineme.library.annotate import annotate_by
from kineme.library.learn import learn_recordings
from kineme.library.recognize import some_of_each_symbol
from kineme.recognition.answer import certainty
from kineme.sampling import evenly_spaced
from kineme.studio.server import records
from kineme.studio.server.importing import columns_of, command, reader_options, unclear
from kineme.studio.server.opened import movement_of
from kineme.studio.server.refusals import MissingError, in_studio_words
from kineme.studio.server.rollout_routes import as_file
from kineme.studio.server.studio import Reads, Studio, Work, Writes, while_wanted


class ChannelChoice(records.Change):
    """A table of a recording, and some of its columns; by default the first, and those that are found."""

    table: records.Text | None = None
    channels: list[records.Text] | None = Field(None, max_length=1000)


class SpotRequest(ChannelChoice):
    """A search for movements of the library."""

    error_rate: records.Number = Field(0.05, gt=0, lt=1)


class Span(records.RequestBody):
    """A stretch of a recording, in seconds since its first sample, and what it shows."""

    begin: records.Number
    end: records.Number
    label: records.Name | None = None


class LearnRequest(ChannelChoice):
    """Stretches of one table to be learned; without them all tables of the file, by the labels that it gives them."""

    spans: list[Span] | None = Field(None, min_length=1, max_length=100_000)


class ColumnOut(BaseModel):
    """Values of one column."""

    name: str
    values: list[float | None]


class PlotOut(BaseModel):
    """Columns over time, thinned: of each stretch the least and the greatest value."""

    times: list[float]
    columns: list[ColumnOut]


class TableOut(BaseModel):
    """One recording of a file."""

    name: str
    channels: list[records.ChannelOut]
    duration: float
    rate: float | None
    n_samples: int
    label: str | None = Field(description="What the file says that it shows.")


class UploadOut(BaseModel):
    """The contents of a file; it has no tables where somebody has to say first how it is read."""

    recording: str
    tables: list[TableOut]
    problems: list[str]
    plots: list[PlotOut] = Field(description="One of each table.")
    preview: dict[str, Any] | None = Field(None, description="First rows, and guesses at how they are read.")
    unclear: str = Field("", description="Why somebody should say how it is read.")
    command: str = Field(description="Of the shell, that finds movements in the file as it was read.")


class ReadRequest(records.RequestBody):
    """How a table is read."""

    time: records.Text | None = Field(None, description="Column of the times.")
    units: Annotated[str, Field(max_length=20)] | None = Field(None, description="Of the times.")
    rate: records.Number | None = Field(None, gt=0, description="Samples a second, where there are no times.")
    columns: list[records.Text] = Field(min_length=1, max_length=1000)
    measured_in: Annotated[str, Field(max_length=20)] | None = Field(None, description="Unit of the coordinates.")


class ShapesRequest(ChannelChoice):
    """Stretches of one table whose shapes are drawn, each by at most so many points."""

    spans: list[Span] = Field(max_length=10_000)
    points: int = Field(64, ge=2, le=2000)


class ShapeOut(BaseModel):
    """A path in the plane or in space, and the seconds since the first sample at which it is at its points."""

    times: list[float]
    path: records.Points


class FoundSpan(Span):
    """A stretch with how sure its name is, unless a person gave it."""

    p: records.Number | None = None
    confidence: records.Number | None = None
    certainty: records.Text | None = None

    def annotation(self, recording: str, place: str, origin: float) -> Annotation:
        """Return it by the clock of a recording that begins at `origin` [s]; without a p-value, a person said it."""
        certainty = math.nan if self.p is None else self.p, 1.0 if self.confidence is None else self.confidence
        return Annotation(recording, place, origin + self.begin, origin + self.end, self.label, *certainty, origin)


class AnnotationsRequest(ChannelChoice):
    """Annotations of one table, and the format in which they are written."""

    spans: list[FoundSpan] = Field(max_length=10_000)
    format: str = Field("csv", max_length=20)


class RestOut(BaseModel):
    """A stretch without motion."""

    begin: float
    end: float


class SpannedOut(RestOut):
    """A stretch of motion, and what it shows; null is unknown."""

    label: str | None
    p: float | None
    confidence: float | None
    certainty: str | None = Field(None, description="sure, probably, looks like or new; null where nobody said it.")


class SpottedOut(BaseModel):
    """Movements and rests of a recording, with their times."""

    spans: list[SpannedOut]
    rests: list[RestOut]


class SearchedOut(BaseModel):
    """The share of a recording that is searched, from 0 to 1; null where nothing is searched."""

    share: float | None


router = APIRouter(prefix="/api/recordings", tags=["recordings"])
annotation_router = APIRouter(prefix="/api/recordings", tags=["annotations"])

#: Format of annotations that is a file of its own -> its ending.
_ENDINGS = {name: writer.endings[0] for name, writer in WRITERS.items() if writer.copies is None} | {"rerun": ".rrd"}
_MOST_POINTS = 1_000_000  # of all shapes that are asked for at once
_PLOTTED = 1000  # samples of a column, at most


@router.post(
    "",
    response_model=UploadOut,
    summary="Send a recording",
    openapi_extra={"requestBody": {"content": {"application/octet-stream": {}}, "required": True}},
)
async def send(
    studio: Reads,
    request: Request,
    x_file_name: Annotated[
        str, Header(max_length=2000, description="Percent-encoded; its ending says the format.")
    ] = "recording.csv",
) -> dict[str, Any]:
    """The bytes of one file of any format; ``X-File-Name`` is its name, percent-encoded. The last eight are kept."""
    return await _received(studio, request, await studio.uploads.receive(x_file_name, request.stream()))


@router.post("/{key}/read", response_model=UploadOut, summary="Say how a table is read")
async def read_as(studio: Reads, request: Request, key: records.RecordingKey, body: ReadRequest) -> dict[str, Any]:
    """The file that was sent, with these columns and this unit of time or this rate from now on."""
    preview = studio.uploads.previews.get(key)
    if preview is None:
        raise MissingError("expected a table of text that was sent, got another recording")
    return await _received(studio, request, key, reader_options(preview, body.model_dump()))


async def _received(
    studio: Studio, request: Request, key: str, options: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Read a file that was sent, with the options that somebody chose; one that is not clear is described alone."""
    work, uploads = Work(), studio.uploads

    def act() -> Recordings:
        return uploads.recordings(key, (), work.check) if options is None else uploads.read_as(key, options, work.check)

    read: Recordings | str
    async with uploads.readers:
        try:
            read = await while_wanted(request, studio.long, work, act)
        except DataError as error:
            if options is not None or uploads.previews.get(key) is None:
                raise
            read = in_studio_words(str(error))
    preview, n = uploads.previews.get(key), 0 if isinstance(read, str) else len(read)
    about: dict[str, Any] = {"recording": key, "tables": [], "plots": [], "problems": [], "preview": preview}
    if not isinstance(read, str):
        about["tables"], about["plots"] = ([act(read, k) for k in range(n)] for act in (table_of, plot_of))
        about["problems"] = [in_studio_words(str(problem)) for problem in read.problems]
    return about | {
        "unclear": unclear(preview, read) if options is None else "",
        "command": command(uploads.path(key).name, str(studio.library.folder), uploads.options.get(key, {})),
    }


@router.post("/{key}/shapes", response_model=list[ShapeOut], summary="The shapes of stretches of a recording")
def shapes(studio: Reads, key: records.RecordingKey, body: ShapesRequest) -> list[dict[str, Any]]:
    """Each path by the coordinates of the first point among the channels, or else by the first three columns."""
    read = _read(studio, key)
    rows = slice(*read.demonstrations.offsets[(k := _number(read, body.table)) : k + 2])
    demos, names = read.demonstrations, columns_of(read)
    chosen = [name for name in _columns_of(read, body.channels or names) if name in names]
    values = demos.recorded[rows][:, [*map(names.index, chosen)]]
    times = demos.times[rows] - demos.times[rows.start]
    points = next(iter(points_in(chosen, values).values()), values[:, :3])
    ends = np.array([(span.begin, span.end) for span in body.spans]).reshape(-1, 2)
    drawn = []
    for first, end in zip(times.searchsorted(ends[:, 0]), times.searchsorted(ends[:, 1], "right"), strict=True):
        n = min(body.points, _MOST_POINTS // len(ends))
        shown = first + evenly_spaced(max(end - first, 0), n) if end > first else np.zeros(0, np.intp)
        drawn.append(
            {"times": times[shown].tolist(), "path": records.thumbnail(points[shown], n) if len(shown) else []}
        )
    return drawn


@annotation_router.post(
    "/{key}/annotations",
    summary="Annotations as a file",
    response_class=Response,
    responses={200: {"content": {"application/octet-stream": {}}, "description": "The file, with its name."}},
)
def export(studio: Reads, key: records.RecordingKey, body: AnnotationsRequest) -> Response:
    """Write stretches and their names as `kineme annotate` does, in each of its formats that is a file of its own."""
    if body.format not in _ENDINGS:
        raise SpecificationError(f"expected one of the formats {', '.join(_ENDINGS)}, got {body.format!r}")
    recording = _one(studio, key, body)
    source, origin = recording.sources[0], float(recording.demonstrations.movements.stamps[0])
    spans = sorted(body.spans, key=lambda span: span.begin)
    notes = [span.annotation(source.path, source.place, origin) for span in spans]
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"labels{(ending := _ENDINGS[body.format])}"
        if body.format == "rerun":
            write_rerun(path, recording_scenes(recording, notes))
        else:
            write_annotations(path, notes, [Path(source.path)], body.format)
        return as_file(path.read_bytes(), f"{source.path} {source.place}".strip(), f"-labels{ending}")


@annotation_router.post("/{key}/spotted", response_model=SpottedOut, summary="What happens when in a recording")
async def spotted(studio: Reads, request: Request, key: records.RecordingKey, body: SpotRequest) -> dict[str, Any]:
    """Movements of the library's symbols, and motion that is like none; times are seconds since the first sample.

    A search ends where the client that asked for it goes, and where another one of the same recording begins.
    """
    work = studio.works.begin(key)

    def search() -> dict[str, Any]:
        work.check()  # it may have waited for others
        recording = _one(studio, key, body, work.check)
        duration = float(recording.demonstrations.durations[0])
        classes = some_of_each_symbol(studio.library.store)
        report = annotate_by(classes, recording, body.error_rate, lambda done: work.tell(done / duration))
        if report.problems:
            raise SpecificationError(report.problems[0].what)
        spans = [
            {
                **{"begin": each.span[0], "end": each.span[1], "label": each.symbol},
                **{"p": records.numbers(each.p_value), "confidence": records.numbers(each.confidence)},
                "certainty": certainty(each.confidence, is_new=each.unknown, is_guess=not report.calibrated),
            }
            for each in report.annotations
        ]
        ends = [0.0, *(span["end"] for span in spans)]
        begins = [*(span["begin"] for span in spans), duration]
        gaps = zip(ends, begins, strict=True)
        return {"spans": spans, "rests": [{"begin": begin, "end": end} for begin, end in gaps if end > begin]}

    try:
        return await while_wanted(request, studio.long, work, search)
    finally:
        studio.works.end(key, work)


@annotation_router.get("/{key}/spotted", response_model=SearchedOut, summary="How much of a recording is searched")
def searched(studio: Reads, key: records.RecordingKey) -> dict[str, Any]:
    """The share that is done; null where nothing is searched."""
    return {"share": studio.works.share(key)}


@annotation_router.post("/{key}/learn", response_model=records.LearnedOut, summary="Learn stretches of a recording")
def learn(studio: Writes, key: records.RecordingKey, body: LearnRequest) -> dict[str, Any]:
    """Each stretch becomes a movement of the symbol that its label names; one without a label, an unnamed one.

    Without stretches each table of the file becomes a movement, of the symbol that the file names, if it does.
    """
    if body.spans is None:
        pieces = _in_columns(studio, key, body)
    else:
        rows = (LabelRow(span.begin, span.end, span.label, "", "", k + 1) for k, span in enumerate(body.spans))
        pieces = labeled_pieces(_one(studio, key, body), LabelTable("of the spans", tuple(rows), True))
        if lost := [problem for problem in pieces.problems if problem.file == "of the spans"]:
            raise DataError(str(lost[0]))  # beside what would be learned, nobody would see it
    columns = _columns_of(_read(studio, key), body.channels) if body.channels else None
    report = learn_recordings(studio.library.store, pieces, {"columns": columns})
    return {"ids": report.ids.tolist(), "version": report.version}


def _read(studio: Studio, key: str, columns: Sequence[str] = (), check: Callable[[], object] = bool) -> Recordings:
    """Read a file that was sent, or an episode of what was opened, in these columns or in those that are found."""
    if studio.opened is not None and key in studio.opened:
        return studio.opened.recordings(key, columns)
    return studio.uploads.recordings(key, columns, check)


def _in_columns(studio: Studio, key: str, body: ChannelChoice, check: Callable[[], object] = bool) -> Recordings:
    """Read all tables of a file, in the columns that are asked for, or those of the library where it has them."""
    read = _read(studio, key, check=check)
    ours = [column for channel in studio.library.channels or () for column in channel.columns]
    wanted = _columns_of(read, body.channels) if body.channels else ours
    if wanted != columns_of(read) and (body.channels or (ours and set(ours) <= set(columns_of(read)))):
        read = _read(studio, key, wanted, check)
    return read


def _one(studio: Studio, key: str, body: ChannelChoice, check: Callable[[], object] = bool) -> Recordings:
    """Read one table of a file, in the same columns."""
    read = _in_columns(studio, key, body, check)
    return movement_of(read, _number(read, body.table))


def _number(read: Recordings, table: str | None) -> int:
    """Return which movement of a file has that name; by default the first."""
    names = [_name(read, k) for k in range(len(read))]
    if table is not None and table not in names:
        raise SpecificationError(f"expected one of the tables {', '.join(names[:20])}, got {table!r}")
    return 0 if table is None else names.index(table)


def _name(read: Recordings, k: int) -> str:
    return read.sources[k].place or read.sources[k].path


def _columns_of(read: Recordings, names: Sequence[str]) -> list[str]:
    """List the columns of channels, such as the four of an orientation; other names are those of columns."""
    columns = {channel.name: channel.columns for channel in read.demonstrations.channels or ()}
    return [column for name in names for column in columns.get(name, (name,))]


def table_of(read: Recordings, k: int) -> dict[str, Any]:
    """Describe a recording of a file."""
    demos, duration = read.demonstrations, float(read.demonstrations.durations[k])
    n = int(demos.offsets[k + 1] - demos.offsets[k])
    channels = [{"name": name, "kind": "position", "columns": [name], "unit": None} for name in columns_of(read)]
    if demos.channels is not None:
        channels = [channel._asdict() for channel in demos.channels]
    return {
        "name": _name(read, k),
        "channels": channels,
        "duration": duration,
        "rate": records.numbers((n - 1) / duration),
        "n_samples": n,
        "label": read.labels[k],
    }


def plot_of(read: Recordings, k: int, width: int = _PLOTTED // 2) -> dict[str, Any]:
    """Return its columns over seconds since the first sample, at most 2 `width` samples of each."""
    demos = read.demonstrations
    rows = slice(demos.offsets[k], demos.offsets[k + 1])
    return records.plot(demos.times[rows], demos.recorded[rows], columns_of(read), width)
