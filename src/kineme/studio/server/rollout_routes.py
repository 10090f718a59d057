"""New movements, as numbers and as files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel, Field, model_validator

from kineme.dmp.generation.generate import (
    Generated,
    Learned,
    MovementOptions,
    checked_point,
    generate,
    in_turn,
    learn_one,
)
from kineme.dmp.styles.model import StyleModel, learn_styles
from kineme.errors import SpecificationError, heard_warnings
from kineme.io.writing.write_movement import WRITERS, encode_movement
from kineme.library.grounding import prototype_of
from kineme.library.storage import read
from kineme.studio.server import records
from kineme.studio.server.studio import Reads, Studio
from kineme.studio.snapshot import snapshot_of_primitive
from kineme.validation import Array

_SAMPLES, _MOST_SAMPLES = 200, 20_000
_MOST_BENDS = 24  # around obstacles
_MARGIN = 0.1  # of the radius of an obstacle, by which the movement passes it
_SAME_BEND = 0.05  # share of the duration within which a bend around an obstacle replaces another one, and goes
_WIDER = 1.5  # times as far beside it
_CENTERED = 1e-3  # of the radius: as near to the middle of an obstacle a path has no side


def learned_as(studio: Studio, body: PrimitiveRequest) -> Learned:
    """Learn the primitive that is asked for, in the formulation that is asked for, once for each version."""
    key = body.what.model_dump_json() + str(body.formulation)
    return studio.cached_item("learned", key, lambda: _learned(studio, body.what, body.formulation))


def styles_of(studio: Studio, symbol: str) -> StyleModel:
    """Learn the directions in which the members of a symbol differ, once for each version."""
    name = studio.symbol(symbol).name
    return studio.cached_item("styles", symbol, lambda: learn_styles(studio.library.primitives(name)))


def make(studio: Studio, body: RolloutRequest) -> tuple[Generated, Array | None, list[str]]:
    """Generate the movement that is asked for; with the goal that it was given, and warnings."""
    learned = learned_as(studio, body)
    duration = body.duration or float(learned.primitive.durations[0])
    rate = body.rate or _SAMPLES / duration
    if rate * duration > _MOST_SAMPLES:
        raise SpecificationError(
            f"expected at most {_MOST_SAMPLES:,} samples, got {rate:g} per second for {duration:g} s; take a lower rate"
        )
    points, notes = _points(learned, body)
    options = MovementOptions(
        start=points["start"],
        goal=points["goal"],
        duration=body.duration,
        rate=rate,
        meet_goal=True,  # it ends where the hand put it
        via=tuple((share, np.array(point)) for share, point in sorted(body.via, key=lambda pair: pair[0])),
    )
    movement, warnings = _around(learned, options, body.obstacles)
    return movement, points["goal"], notes + warnings


def _points(learned: Learned, body: RolloutRequest) -> tuple[dict[str, Array | None], list[str]]:
    """Start and goal, angles in the turn of the recording unless they are wanted as they are, and what is turned."""
    points, notes = dict[str, Array | None](), list[str]()
    for name, given in (("start", body.start), ("goal", body.goal)):
        points[name] = None if given is None else np.array(given)
        checked_point(learned, points[name], name)
        if body.in_turn:
            points[name], said = in_turn(learned, points[name], name)
            notes += said
    return points, notes


def name_of(studio: Studio, what: Subject) -> str:
    """Return the name of the symbol that moves, or the number of the movement."""
    symbol = what.symbol or (what.style.symbol if what.style else None)
    return studio.symbol(symbol).name if symbol else f"movement {what.movement}"


def as_file(data: bytes, name: str, ending: str) -> Response:
    """Answer with a file: letters and digits of its name, whatever alphabet they are of."""
    plain = "".join(mark if mark.isalnum() or mark in "-_" else "_" for mark in name)[:80] or "movement"
    ascii_only = plain.encode("ascii", "replace").decode().replace("?", "_")
    saved_as = f"attachment; filename=\"{ascii_only}{ending}\"; filename*=UTF-8''{quote(plain + ending)}"
    return Response(data, media_type="application/octet-stream", headers={"Content-Disposition": saved_as})


def moving_positions(learned: Learned, movement: Generated) -> Array:
    """Select the positions that can be led elsewhere: all but discrete channels, such as a gripper's."""
    places = [learned.columns.index(name) for name in learned.moving_columns]
    return np.asarray(movement.columns["positions"])[:, places]


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
    """Bend the movement around balls; return warnings of those that it touches.

    Where the path lies deepest in a ball it gets a via point outside that ball, until it is clear of all. Each changes
    the weights as little as possible, and the via points that are asked for are met exactly.
    """
    if not balls:
        with heard_warnings() as heard:
            return generate(learned, options), heard
    if len({len(ball.center) for ball in balls}) > 1:
        raise SpecificationError("expected obstacles of equally many dimensions")
    # Columns that are no part of an orientation have a velocity of the same name.
    placed = [k for k, name in enumerate(learned.moving_columns) if name in learned.rates]
    centers, radii = np.array([ball.center for ball in balls]), np.array([ball.radius for ball in balls])
    if centers.shape[1] == len(learned.moving_columns):  # a point of the movement: an orientation says nothing of where
        centers = centers[:, placed]
    if not 2 <= len(placed) == centers.shape[1]:
        raise SpecificationError(
            f"expected obstacles in the {len(placed)} dimensions of the movement, two or more, got {centers.shape[1]}"
        )

    def attempt(bends: dict[float, Array]) -> tuple[Generated, list[str], Array, Array]:
        with heard_warnings() as heard:
            via = sorted([*options.via, *bends.items()], key=lambda pair: pair[0])
            movement = generate(learned, replace(options, via=tuple(via)))
        path = moving_positions(learned, movement)
        return movement, heard, path, radii - np.linalg.norm(path[:, None, placed] - centers, axis=2)

    bends: dict[float, Array] = {}
    owners, margins = dict[float, int](), np.full(len(balls), _MARGIN)
    best = movement = attempt(bends)
    # Around a ball in which a point of the movement lies there is no way: it is said alone.
    fixed = np.array([best[2][0], best[2][-1], *(point for _, point in options.via)])[:, None, placed]
    passable = (np.linalg.norm(fixed - centers, axis=2) > radii).all(axis=0)
    for _ in range(_MOST_BENDS):
        path, depths = movement[2], np.where(passable, movement[3], -np.inf)
        if depths.max() <= 0:
            break
        t, ball = (int(k) for k in np.unravel_index(depths.argmax(), depths.shape))
        share, point = t / (len(path) - 1), path[t].copy()
        for other in [other for other in bends if owners[other] == ball and abs(other - share) < _SAME_BEND]:
            del bends[other]
            margins[ball] *= _WIDER
        point[placed] = _beside(path[:, placed], t, centers[ball], radii[ball] * (1 + margins[ball]))
        bends[share], owners[share] = point, ball
        try:
            movement = attempt(bends)
        except SpecificationError:  # more bends than there are weights
            break
        if movement[3][:, passable].max() < best[3][:, passable].max():
            best = movement
    return best[0], best[1] + [
        f"the movement passes {radius - depth:.3g} from the middle of obstacle {k + 1}, whose radius is {radius:.3g}: "
        "move the obstacle, or the point that lies in it"
        for k, (depth, radius) in enumerate(zip(best[3].max(axis=0).tolist(), radii.tolist(), strict=True))
        if depth > 0
    ]


def _beside(path: Array, t: int, center: Array, distance: float) -> Array:
    """A place so far from a center, from where the path (T, d) is at sample t straight away from the center."""
    along = path[min(t + 1, len(path) - 1)] - path[max(t - 1, 0)]
    along = along / (np.linalg.norm(along) or 1.0)
    away = path[t] - center
    away = away - along * (along @ away)
    if np.linalg.norm(away) < _CENTERED * distance:  # through the middle: to one side
        away = np.eye(len(along))[np.abs(along).argmin()]
        away = away - along * (along @ away)
    return np.asarray(center + away * distance / np.linalg.norm(away))


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
    in_turn: bool = Field(
        True, description="Angles of start and goal are taken in the turn of the recording, which a warning says."
    )


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
    (movement, goal, warnings), learned = make(studio, body), learned_as(studio, body)
    columns, recording = movement.columns, learned.demonstration
    positions = moving_positions(learned, movement)
    return {
        **{name: records.numbers(columns[name]) for name in ("times", "velocities", "accelerations")},
        "positions": records.numbers(positions),
        "columns": list(learned.moving_columns),
        "start": records.numbers(positions[0]),
        "goal": records.numbers(positions[-1] if goal is None else goal),
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
    movement, *_ = make(studio, body)
    ending = f".{body.format.lower().lstrip('.')}"
    data = encode_movement(movement.columns, ending, movement.names)
    return as_file(data, name_of(studio, body.what), ending)
