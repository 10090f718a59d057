"""Recordings that clients send: what they hold, what happens when in them, and learning it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from pydantic import BaseModel, Field

from kineme.errors import SpecificationError
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.read_labels import LabelRow, LabelTable, labeled_pieces
from kineme.library.annotate import annotate
from kineme.library.learn import learn_recordings
from kineme.studio.server import records
from kineme.studio.server.opened import columns_of, movement_of
from kineme.studio.server.refusals import in_studio_words
from kineme.studio.server.studio import Reads, Studio, Work, Writes, while_wanted
from kineme.studio.server.uploads import go_on


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
    """The contents of a file."""

    recording: str
    tables: list[TableOut]
    problems: list[str]
    plots: list[PlotOut] = Field(description="One of each table.")


class RestOut(BaseModel):
    """A stretch without motion."""

    begin: float
    end: float


class SpannedOut(RestOut):
    """A stretch of motion, and what it shows; null is unknown."""

    label: str | None
    p: float | None
    confidence: float | None


class SpottedOut(BaseModel):
    """Movements and rests of a recording, with their times."""

    spans: list[SpannedOut]
    rests: list[RestOut]


class SearchedOut(BaseModel):
    """The share of a recording that is searched, from 0 to 1; null where nothing is searched."""

    share: float | None


router = APIRouter(prefix="/api/recordings", tags=["recordings"])

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
    key = await studio.uploads.receive(x_file_name, request.stream())
    work = Work()
    async with studio.uploads.readers:
        read = await while_wanted(request, studio.long, work, lambda: studio.uploads.recordings(key, check=work.check))
    return {
        "recording": key,
        "tables": [table_of(read, k) for k in range(len(read))],
        "problems": [in_studio_words(str(problem)) for problem in read.problems],
        "plots": [plot_of(read, k) for k in range(len(read))],
    }


@router.post("/{key}/spotted", response_model=SpottedOut, summary="What happens when in a recording")
async def spotted(studio: Reads, request: Request, key: records.RecordingKey, body: SpotRequest) -> dict[str, Any]:
    """Movements of the library's symbols, and motion that is like none; times are seconds since the first sample.

    A search ends where the client that asked for it goes, and where another one of the same recording begins.
    """
    work = studio.works.begin(key)

    def search() -> dict[str, Any]:
        work.check()  # it may have waited for others
        recording = _one(studio, key, body, work.check)
        duration = float(recording.demonstrations.durations[0])
        report = annotate(studio.library.store, recording, body.error_rate, lambda done: work.tell(done / duration))
        if report.problems:
            raise SpecificationError(report.problems[0].what)
        spans = [
            {
                **{"begin": each.span[0], "end": each.span[1], "label": each.symbol},
                **{"p": records.numbers(each.p_value), "confidence": records.numbers(each.confidence)},
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


@router.get("/{key}/spotted", response_model=SearchedOut, summary="How much of a recording is searched")
def searched(studio: Reads, key: records.RecordingKey) -> dict[str, Any]:
    """The share that is done; null where nothing is searched."""
    return {"share": studio.works.share(key)}


@router.post("/{key}/learn", response_model=records.LearnedOut, summary="Learn stretches of a recording")
def learn(studio: Writes, key: records.RecordingKey, body: LearnRequest) -> dict[str, Any]:
    """Each stretch becomes a movement of the symbol that its label names; one without a label, an unnamed one.

    Without stretches each table of the file becomes a movement, of the symbol that the file names, if it does.
    """
    if body.spans is None:
        pieces = _in_columns(studio, key, body)
    else:
        rows = (LabelRow(span.begin, span.end, span.label, "", "", k + 1) for k, span in enumerate(body.spans))
        pieces = labeled_pieces(_one(studio, key, body), LabelTable("of the spans", tuple(rows), True))
    columns = _columns_of(_read(studio, key), body.channels) if body.channels else None
    report = learn_recordings(studio.library.store, pieces, {"columns": columns})
    return {"ids": report.ids.tolist(), "version": report.version}


def _read(studio: Studio, key: str, columns: Sequence[str] = (), check: Callable[[], object] = go_on) -> Recordings:
    """Read a file that was sent, or an episode of what was opened, in these columns or in those that are found."""
    if studio.opened is not None and key in studio.opened:
        return studio.opened.recordings(key, columns)
    return studio.uploads.recordings(key, columns, check)


def _in_columns(studio: Studio, key: str, body: ChannelChoice, check: Callable[[], object] = go_on) -> Recordings:
    """Read all tables of a file, in the columns that are asked for, or those of the library where it has them."""
    read = _read(studio, key, check=check)
    ours = [column for channel in studio.library.channels or () for column in channel.columns]
    wanted = _columns_of(read, body.channels) if body.channels else ours
    if wanted != columns_of(read) and (body.channels or (ours and set(ours) <= set(columns_of(read)))):
        read = _read(studio, key, wanted, check)
    return read


def _one(studio: Studio, key: str, body: ChannelChoice, check: Callable[[], object] = go_on) -> Recordings:
    """Read one table of a file, in the same columns."""
    read, table = _in_columns(studio, key, body, check), body.table
    names = [_name(read, k) for k in range(len(read))]
    k = 0 if table is None else names.index(table) if table in names else -1
    if k < 0:
        raise SpecificationError(f"expected one of the tables {', '.join(names[:20])}, got {table!r}")
    return movement_of(read, k)


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
    values = (demos.positions if demos.channels is None else demos.recorded)[rows]
    return records.plot(demos.movements.stamps[rows], values, columns_of(read), width)
