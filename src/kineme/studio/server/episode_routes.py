"""Episodes of the recordings that the studio was started with: pages of them, strips, symbols, videos, corrections."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, Field

from kineme.errors import KinemeError
from kineme.studio.server import records
from kineme.studio.server.importing import command
from kineme.studio.server.opened import KEY, Lane, Opened, OpenedRecordings
from kineme.studio.server.recording_routes import FoundSpan, PlotOut, SpannedOut, UploadOut, plot_of, table_of
from kineme.studio.server.refusals import MissingError, in_studio_words
from kineme.studio.server.studio import Reads, Writes

EpisodeKey = Annotated[str, Path(description="Key of an episode, as in `/api/episodes`.")]
CameraName = Annotated[str, Path(description="Camera of the episode, as in `/api/episodes/{key}`.")]
Width = Annotated[int, Query(ge=16, le=8192, description="Of the picture in pixels; at most two samples for each.")]


class VideoOut(BaseModel):
    """The video of a camera."""

    camera: str
    start: float = Field(description="When the episode begins in it [s].")
    codec: str | None = Field(description="As the data set declares it, such as av1.")


class EpisodeOut(BaseModel):
    """An episode in a list: what was done in it, and what was found; times are seconds since its first sample."""

    key: str
    number: int
    place: str
    task: str | None
    duration: float
    n_samples: int
    problems: list[str]
    spans: list[SpannedOut]
    corrected: bool = Field(description="Whether a person has corrected the spans.")


class EpisodesOut(BaseModel):
    """Some of `total` episodes; the total is null until the last one has been read."""

    name: str | None = Field(None, description="Of what was opened; null if nothing was.")
    total: int | None = 0
    offset: int
    episodes: list[EpisodeOut]
    file: str | None = Field(None, description="The table of corrections, beside what was opened.")
    n_corrected: int = Field(0, description="Stretches in the episodes that a person corrected.")
    saved: bool = Field(True, description="Whether the table holds them all.")
    problem: str | None = None


class EpisodeDetail(UploadOut):
    """An episode as a recording, with its videos and what was found in it."""

    episode: EpisodeOut
    videos: list[VideoOut]
    chosen: list[str] = Field(description="Channels of the feature that is read by default.")


class SpansRequest(records.RequestBody):
    """All that an episode shows."""

    spans: list[FoundSpan] = Field(max_length=10_000)
    corrected: bool = Field(False, description="Whether a person changed any.")


class SaveRequest(records.RequestBody):
    """A table to write beside what was opened."""

    replace: bool = Field(False, description="Also if others have written it since.")


class SavedOut(BaseModel):
    """The name of the file that was written, and how many stretches it holds."""

    file: str
    n_spans: int


router = APIRouter(prefix="/api/episodes", tags=["episodes"])


async def _opened(studio: Reads) -> OpenedRecordings:
    if studio.opened is None:
        raise MissingError("expected recordings, the studio was started without; start it with --recordings")
    return studio.opened


Recorded = Annotated[OpenedRecordings, Depends(_opened)]


@router.get("", response_model=EpisodesOut, summary="Episodes, some at a time")
async def episodes(
    studio: Reads,
    offset: Annotated[int, Query(ge=0, le=10**9, description="How many to pass over.")] = 0,
    limit: Annotated[int, Query(ge=1, le=100, description="How many at most.")] = 20,
) -> dict[str, Any]:
    """Those of the data set or the files that the studio was started with, read when they are asked for."""
    opened = studio.opened
    if opened is None:
        return {"offset": 0, "episodes": []}
    page = await studio.reading(opened.page, offset, limit)
    corrections = opened.corrections
    return {
        "name": opened.name,
        "total": opened.total,
        "offset": offset,
        "episodes": [_episode(opened, episode, offset + k) for k, episode in enumerate(page)],
        "file": corrections.path.name,
        "n_corrected": len(corrections.corrected),
        "saved": corrections.saved,
        "problem": corrections.problem,
    }


@router.get(
    "/corrections.csv",
    summary="Corrections as a file",
    response_class=Response,
    responses={200: {"content": {"text/csv": {}}}},
)
def corrections(opened: Recorded) -> Response:
    """Annotations of the episodes that a person corrected, as `kineme annotate` writes them."""
    name = "".join(
        mark if mark.isascii() and (mark.isalnum() or mark in "-_.") else "_" for mark in opened.corrections.path.name
    )
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(opened.corrections.table(), headers=headers, media_type="text/csv; charset=utf-8")


@router.post("/corrections", response_model=SavedOut, summary="Save corrections")
def save(studio: Writes, opened: Recorded, body: SaveRequest) -> dict[str, Any]:
    """Write them beside what was opened; 409 if others have written that file since."""
    corrections = opened.corrections
    return {"file": corrections.save(replace=body.replace).name, "n_spans": len(corrections.corrected)}


@router.get("/{key}", response_model=EpisodeDetail, summary="One episode")
async def episode(studio: Reads, opened: Recorded, key: EpisodeKey, width: Width = 1000) -> dict[str, Any]:
    """Its signals, thinned to a width, its channels and videos; `/api/recordings/{key}` searches and learns it."""
    shown = await studio.reading(_detail, opened, key, width)
    return shown | {"command": command(opened.name, str(studio.library.folder), {})}


@router.get("/{key}/strip", response_model=PlotOut, summary="The signals of an episode as a strip")
async def strip(studio: Reads, opened: Recorded, key: EpisodeKey, width: Width = 600) -> dict[str, Any]:
    """The feature that is read by default, thinned to a width: every peak is there."""
    item = await studio.reading(opened.episode, key)
    return await studio.reading(_strip, item, width)


@router.post("/{key}/spans", response_model=EpisodeOut, summary="Keep what an episode shows")
async def put_spans(studio: Reads, opened: Recorded, key: EpisodeKey, body: SpansRequest) -> dict[str, Any]:
    """Until the studio ends, or they are saved: what a person corrected is in the table of corrections."""
    item = await studio.reading(opened.episode, key)
    spans = sorted((span for span in body.spans if span.end > span.begin), key=lambda span: span.begin)
    entire = FoundSpan(begin=0.0, end=item.duration)
    *annotations, unknown = (span.annotation(*item.movement, item.origin) for span in (*spans, entire))
    opened.corrections.put(item.movement, Lane(tuple(annotations), body.corrected, (unknown,)))
    return _episode(opened, item, int(key.removeprefix(KEY)))


@router.get(
    "/{key}/videos/{camera}",
    summary="The video of a camera",
    response_class=FileResponse,
    responses={200: {"content": {"video/mp4": {}, "video/webm": {}}}},
)
async def video(studio: Reads, opened: Recorded, key: EpisodeKey, camera: CameraName) -> FileResponse:
    """The file as the data set has it, also in parts (``Range``)."""
    item = await studio.reading(opened.episode, key)
    path, kind = await studio.reading(opened.video, item, camera)
    return FileResponse(path, media_type=kind, headers={"Cache-Control": "private, max-age=3600"})


def _episode(opened: OpenedRecordings, item: Opened, position: int) -> dict[str, Any]:
    lane = opened.corrections.lane(item.movement)
    spans = [
        {
            "begin": note.start - item.origin,
            "end": note.end - item.origin,
            "label": note.symbol,
            "p": records.numbers(note.p_value),
            "confidence": records.numbers(note.confidence),
        }
        for note in lane.annotations
    ]
    return {
        "key": f"{KEY}{position}",
        "number": item.episode.number,
        "place": item.episode.place,
        "task": item.episode.task,
        "duration": item.duration,
        "n_samples": len(item.episode),
        "problems": [in_studio_words(problem) for problem in item.episode.problems],
        "spans": spans,
        "corrected": lane.corrected,
    }


def _strip(item: Opened, width: int) -> dict[str, Any]:
    """Thin the feature that is read by default."""
    for feature, heads in item.heads.items():
        return records.plot(item.times, item.episode.signals[feature], heads, width)
    return {"times": [], "columns": []}


def _detail(opened: OpenedRecordings, key: str, width: int) -> dict[str, Any]:
    item = opened.episode(key)
    shown = _episode(opened, item, int(key.removeprefix(KEY)))
    videos = [{"camera": camera, **opened.about_video(item, camera)} for camera in item.episode.videos]
    heads = item.heads
    default = set(next(iter(heads.values()), ()))
    try:
        read = opened.recordings(key)
    except KinemeError as error:  # no movement: it is shown as it is
        shown["problems"].append(in_studio_words(str(error)))
        table: dict[str, Any] = {
            "rate": None,
            "n_samples": len(item.episode),
            "duration": item.duration,
            "channels": [],
        }
        drawn = _strip(item, width)
    else:
        table, drawn = table_of(read, 0), plot_of(read, 0, width)
    chosen = [channel["name"] for channel in table["channels"] if default & set(channel["columns"])]
    return {
        "recording": key,
        "tables": [table | {"name": item.place or item.recording, "label": None}],
        "problems": shown["problems"],
        "plots": [drawn],
        "episode": shown,
        "videos": videos,
        "chosen": chosen,
    }
