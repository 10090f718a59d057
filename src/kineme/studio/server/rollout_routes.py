"""New movements, as numbers and as files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel, Field, model_validator

from kineme.dmp.control.plan import ObstacleAvoidance
from kineme.dmp.generation.generate import Generated, Learned, MovementOptions, generate, learn_one
from kineme.dmp.styles.model import StyleModel, learn_styles
from kineme.errors import SpecificationError, heard_warnings
from kineme.io.writing.write_movement import WRITERS, encode_movement
from kineme.library.grounding import prototype_of
from kineme.library.storage import read
from kineme.studio.server import records
from kineme.studio.server.studio import Reads, Studio
from kineme.studio.snapshot import snapshot_of_primitive
from kineme.validation import Array

recognition_router = APIRouter(prefix="/api", tags=["recognition"])

_SAMPLES, _MOST_SAMPLES = 200, 20_000
_STRONGER = (1.0, 2.0, 4.0, 8.0)  # steering that is tried until no obstacle is touched


def learned_as(studio: Studio, body: PrimitiveRequest) -> Learned:
    """Learn the primitive that is asked for, in the formulation that is asked for, once for each version."""
    key = body.what.model_dump_json() + str(body.formulation)
    return studio.cached_item("learned", key, lambda: _learned(studio, body.what, body.formulation))


def styles_of(studio: Studio, symbol: str) -> StyleModel:
    """Learn the directions in which the members of a symbol differ, once for each version."""
    name = studio.symbol(symbol).name
    return studio.cached_item("styles", symbol, lambda: learn_styles(studio.library.primitives(name)))


def make(studio: Studio, body: RolloutRequest) -> tuple[Generated, list[str]]:
    """Generate the movement that is asked for, with warnings."""
    learned = learned_as(studio, body)
    duration = body.duration or float(learned.primitive.durations[0])
    rate = body.rate or _SAMPLES / duration
    if rate * duration > _MOST_SAMPLES:
        raise SpecificationError(
            f"expected at most {_MOST_SAMPLES:,} samples, got {rate:g} per second for {duration:g} s; take a lower rate"
        )
    options = MovementOptions(
        start=None if body.start is None else np.array(body.start),
        goal=None if body.goal is None else np.array(body.goal),
        duration=body.duration,
        rate=rate,
        meet_goal=True,  # it ends where the hand put it
        via=tuple((share, np.array(point)) for share, point in sorted(body.via, key=lambda pair: pair[0])),
    )
    with heard_warnings() as heard:
        movement, touched = _around(learned, options, body.obstacles)
    return movement, list(dict.fromkeys([*heard, *touched]))


def moving_positions(learned: Learned, movement: Generated) -> Array:
    """Select the positions that can be led elsewhere: all but discrete channels, such as a gripper's."""
    names = list(movement.names.positions)
    return np.asarray(movement.columns["positions"])[:, [names.index(name) for name in learned.moving_columns]]


def _learned(studio: Studio, what: Subject, formulation: str | None) -> Learned:
    store, dmp = studio.library.store, studio.library.specification.dmp
    if what.style is not None:
        if formulation not in {None, dmp.formulation}:
            raise SpecificationError(f"expected styles in the formulation {dmp.formulation!r}, got {formulation!r}")
        return Learned(styles_of(studio, what.style.symbol).primitive(what.style.values))
    if what.movement is not None:
        studio.check_movements([what.movement])
        key = what.movement
    else:
        symbol = studio.symbol(what.symbol or "")
        if not len(symbol):
            raise SpecificationError(f"expected a symbol with movements, {symbol.name!r} has none; assign some")
        key = prototype_of(store, symbol)
    recording = read.movements(store, np.array([key]))[0]
    return learn_one(recording, dmp if formulation is None else replace(dmp, formulation=formulation))


def _around(learned: Learned, options: MovementOptions, balls: list[Obstacle]) -> tuple[Generated, list[str]]:
    """Steer the movement around balls as strongly as it takes; return warnings of those that it touches."""
    if not balls:
        return generate(learned, options), []
    centers, radii = [ball.center for ball in balls], np.array([ball.radius for ball in balls])
    if len({len(center) for center in centers}) > 1:
        raise SpecificationError("expected obstacles of equally many dimensions")
    # Columns that are no part of an orientation have a velocity of the same name.
    points, placed = np.array(centers), [k for k, name in enumerate(learned.moving_columns) if name in learned.rates]
    if points.shape[1] == len(learned.moving_columns):  # a point of the movement: an orientation says nothing of where
        points = points[:, placed]
    for stronger in _STRONGER:
        avoidance = ObstacleAvoidance(gamma=1000.0 * stronger)
        movement = generate(learned, replace(options, obstacles=points, avoidance=avoidance))
        path = moving_positions(learned, movement)[:, placed][:, : points.shape[1]]
        gaps = np.linalg.norm(path[:, None] - points, axis=2).min(axis=0) - radii
        if (gaps >= 0).all():
            return movement, []
    return movement, [
        f"the movement passes {gap + radius:.3g} from the middle of obstacle {k + 1}, whose radius is {radius:.3g}: "
        "move the obstacle, or add a via point beside it"
        for k, (gap, radius) in enumerate(zip(gaps.tolist(), radii.tolist(), strict=True))
        if gap < 0
    ]


class Style(records.RequestBody):
    """A symbol with values of the directions in which its members differ."""

    symbol: records.Text
    values: list[records.Number] = Field(min_length=1, max_length=100)


class Subject(records.RequestBody):
    """The prototype of a symbol, a stored movement, or a style of a symbol; one of the three."""

    symbol: records.Text | None = None
    movement: int | None = None
    style: Style | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(choice is not None for choice in (self.symbol, self.movement, self.style)) != 1:
            raise ValueError("expected one of symbol, movement and style")
        return self


class Obstacle(records.RequestBody):
    """A ball to pass by."""

    center: records.Point
    radius: records.Number = Field(0.0, ge=0)


class PrimitiveRequest(records.RequestBody):
    """A primitive, in the formulation of the library or in another one."""

    what: Subject
    formulation: records.Text | None = None


class RolloutRequest(PrimitiveRequest):
    """A new movement; what is left out is as demonstrated. Via points are pairs: share of the duration, point."""

    start: records.Point | None = None
    goal: records.Point | None = None
    via: list[tuple[records.Number, records.Point]] = Field([], max_length=100)
    obstacles: list[Obstacle] = Field([], max_length=100)
    duration: records.Number | None = Field(None, gt=0, description="[s]")
    rate: records.Number | None = Field(None, gt=0, description="Samples per second; by default 200 in all.")


class ExportRequest(RolloutRequest):
    """The same as a file."""

    format: records.Text = Field(description=f"One of {', '.join(WRITERS)}.")


class RolloutOut(BaseModel):
    """A new movement, with warnings."""

    times: list[float]
    positions: records.Points
    velocities: records.Points
    accelerations: records.Points
    columns: list[str]
    start: list[float]
    goal: list[float]
    recorded: records.Points | None = Field(
        description="At most 64 points of the recording that moves; null for a style."
    )
    warnings: list[str]


class PrimitiveOut(BaseModel):
    """A primitive as the runtime reads it: its specification, and arrays as one block of bytes in base64."""

    format: str
    version: int
    movements: dict[str, Any]
    arrays: dict[str, tuple[str, int, int]] = Field(description="Kind, first byte and length of each.")
    data: str


class StylesOut(BaseModel):
    """Ranges of the members of a symbol in each direction of their styles, and where its prototype lies."""

    lowest: list[float]
    highest: list[float]
    explained: list[float]
    formulation: str = Field(description="That of the library, the only one in which styles move.")


router = APIRouter(prefix="/api", tags=["movement"])


@router.post("/rollout", response_model=RolloutOut, summary="A new movement")
def rollout(studio: Reads, body: RolloutRequest) -> dict[str, Any]:
    """Of a symbol, a stored movement or a style: from another start, to another goal, past points and obstacles.

    Its columns are those that a start and a goal have; the steps of a gripper are in the file that is exported.
    """
    (movement, warnings), learned = make(studio, body), learned_as(studio, body)
    columns, recording = movement.columns, learned.demonstration
    positions = moving_positions(learned, movement)
    return {
        **{name: records.numbers(columns[name]) for name in ("times", "velocities", "accelerations")},
        "positions": records.numbers(positions),
        "columns": list(learned.moving_columns),
        "start": records.numbers(positions[0]),
        "goal": records.numbers(positions[-1] if body.goal is None else body.goal),
        "recorded": None if recording is None else records.thumbnail(recording.positions),
        "warnings": warnings,
    }


@router.post("/primitive", response_model=PrimitiveOut | None, summary="A primitive for the runtime of the page")
def primitive(studio: Reads, body: PrimitiveRequest) -> Response:
    """To follow a hand without a request for each picture, by ``/runtime/primitive.js``; null where that cannot be."""

    def document() -> str:
        snapshot = snapshot_of_primitive(learned_as(studio, body).primitive)
        return "null" if snapshot is None else snapshot.to_json()

    key = body.model_dump_json()
    return Response(studio.cached_item("primitive", key, document), media_type="application/json")


@router.get("/library/symbols/{key}/styles", response_model=StylesOut, summary="How members of a symbol differ")
def styles(studio: Reads, key: records.SymbolKey) -> dict[str, Any]:
    """The range of each direction; values of a rollout's style lie between."""
    model = styles_of(studio, key)
    ranges = {"lowest": model.lowest, "highest": model.highest, "explained": model.explained_variance}
    shown = {name: records.numbers(values) for name, values in ranges.items()}
    return {**shown, "formulation": studio.library.specification.dmp.formulation}


@router.post(
    "/export",
    summary="A new movement as a file",
    response_class=Response,
    responses={200: {"content": {"application/octet-stream": {}}, "description": "The file, with its name."}},
)
def export(studio: Reads, body: ExportRequest) -> Response:
    """With times, positions, velocities and accelerations, in each format that movements are written in."""
    movement, _ = make(studio, body)
    ending = f".{body.format.lower().lstrip('.')}"
    data = encode_movement(movement.columns, ending, movement.names)
    symbol = body.what.symbol or (body.what.style.symbol if body.what.style else None)
    name = studio.symbol(symbol).name if symbol else f"movement {body.what.movement}"
    # Letters and digits of the name, whatever alphabet they are of.
    plain = "".join(mark if mark.isalnum() or mark in "-_" else "_" for mark in name)[:80] or "movement"
    ascii_only = plain.encode("ascii", "replace").decode().replace("?", "_")
    saved_as = f"attachment; filename=\"{ascii_only}{ending}\"; filename*=UTF-8''{quote(plain + ending)}"
    return Response(data, media_type="application/octet-stream", headers={"Content-Disposition": saved_as})


class RecognizeRequest(records.RequestBody):
    """A movement to be recognized."""

    times: records.Times
    positions: list[records.Point]
    error_rate: records.Number = Field(0.05, gt=0, lt=1)


class RankedOut(BaseModel):
    """A class, its probability if the movement is of a known one, and its p-value."""

    label: str
    probability: float | None
    p_value: float | None


class NearestOut(BaseModel):
    """A stored movement that is like the one asked for; its index is its id."""

    index: int
    name: str | None
    similarity: float


class TransformOut(BaseModel):
    """The map from the nearest movement onto the one asked for."""

    matrix: list[list[float]]
    shift: list[float]
    scale: list[float]
    angle: float
    duration_ratio: float


class AnswerOut(BaseModel):
    """The answer to a movement, as `kineme.recognition.Answer.to_dict` gives it; label null is unknown."""

    label: str | None
    certainty: str
    confidence: float
    p_known: float
    rule: str
    promise: str
    calibrated: bool
    ranked: list[RankedOut]
    nearest: list[NearestOut]
    transform: TransformOut
    responsibilities: dict[str, float]


@recognition_router.post("/recognize", response_model=AnswerOut, summary="Recognize a whole movement")
def recognize(studio: Reads, body: RecognizeRequest) -> dict[str, Any]:
    """Its symbol, or null for unknown; with p-values that are calibrated where there are enough demonstrations."""
    return studio.library.recognize(records.trajectory(body.times, body.positions), body.error_rate).to_dict()


class OverlayOut(BaseModel):
    """An example laid over the movement, see `kineme.recognition.explanation.Overlay`."""

    label: str
    similarity: float
    largest_difference: float
    start: float = Field(validation_alias="from", serialization_alias="from")
    to: float
    part: str | None
    differences: list[float]
    path: list[list[float]]


class WhyOut(BaseModel):
    """Why a movement got its answer, as `kineme.recognition.explanation.Explanation.to_dict` gives it."""

    answer: str
    in_words: str
    by_convolutions: bool
    columns: list[str]
    path: list[list[float]]
    nearest: OverlayOut
    runner_up: OverlayOut | None
    shares: dict[str, float]


@recognition_router.post("/why", response_model=WhyOut, summary="Explain the answer to a whole movement")
def explain(studio: Reads, body: RecognizeRequest) -> dict[str, Any]:
    """The movement over its nearest example and over the runner-up, as `kineme why` draws it."""
    movement = records.trajectory(body.times, body.positions)
    return studio.library.recognize(movement, body.error_rate).explain().to_dict()
