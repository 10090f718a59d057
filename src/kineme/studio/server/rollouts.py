"""New movements of what a library holds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from kineme.dmp.control.options import ObstacleAvoidance
from kineme.dmp.generation.generate import Generated, MovementOptions, generate
from kineme.dmp.generation.learned import Learned, learn_one
from kineme.dmp.styles.model import StyleModel, learn_styles
from kineme.errors import SpecificationError, heard_warnings
from kineme.io.writing.write_movement import WRITERS
from kineme.library.grounding import prototype_of
from kineme.library.storage import read
from kineme.studio.server.records import Number, Point, Points, Sent, Text
from kineme.studio.server.studio import Studio
from kineme.studio.snapshot.movements import snapshot_of_primitive
from kineme.validation import Array

_SAMPLES, _MOST_SAMPLES = 200, 20_000
_STRONGER = (1.0, 2.0, 4.0, 8.0)  # steering that is tried until no obstacle is touched


class Made(NamedTuple):
    """A new movement, and what is to be said of it."""

    movement: Generated
    warnings: list[str]


def learned_as(studio: Studio, asked: Operated) -> Learned:
    """The primitive of what is asked for, in the formulation that is asked for; kept until the library changes."""
    key = asked.what.model_dump_json() + str(asked.formulation)
    return studio.kept_some("learned", key, lambda: _learned(studio, asked.what, asked.formulation))


def styles_of(studio: Studio, symbol: str) -> StyleModel:
    """The directions in which the members of a symbol differ; kept in the same way."""
    name = studio.symbol(symbol).name
    return studio.kept_some("styles", symbol, lambda: learn_styles(studio.library.primitives(name)))


def make(studio: Studio, asked: Wanted) -> Made:
    """The movement that is asked for.

    Raises
    ------
    SpecificationError, TrajectoryError
        See `kineme.dmp.generation.generate.generate`.
    """
    learned = learned_as(studio, asked)
    duration = asked.duration or float(learned.primitive.durations[0])
    rate = asked.rate or _SAMPLES / duration
    if rate * duration > _MOST_SAMPLES:
        raise SpecificationError(
            f"expected at most {_MOST_SAMPLES:,} samples, got {rate:g} per second for {duration:g} s; take a lower rate"
        )
    options = MovementOptions(
        start=None if asked.start is None else np.array(asked.start),
        goal=None if asked.goal is None else np.array(asked.goal),
        duration=asked.duration,
        rate=rate,
        meet_goal=True,  # it ends where the hand put it
        via=tuple((share, np.array(point)) for share, point in sorted(asked.via, key=lambda one: one[0])),
    )
    with heard_warnings() as heard:
        movement, said = _around(learned, options, asked.obstacles)
    return Made(movement, list(dict.fromkeys([*heard, *said])))


def moving_positions(learned: Learned, made: Generated) -> Array:
    """The positions that can be led elsewhere: those of discrete channels, such as a gripper's, are left out."""
    there = list(made.names.positions)
    return np.asarray(made.columns["positions"])[:, [there.index(name) for name in learned.moving_columns]]


def _placed(learned: Learned) -> list[int]:
    """Which of these columns are no part of an orientation: those that have a velocity of the same name."""
    return [k for k, name in enumerate(learned.moving_columns) if name in learned.rates]


def primitive_document(studio: Studio, asked: Operated) -> str:
    """The primitive of what is asked for as JSON, for the runtime; ``null`` where only the server lets it move."""
    made = snapshot_of_primitive(learned_as(studio, asked).primitive)
    return "null" if made is None else made.to_json()


def _learned(studio: Studio, what: What, formulation: str | None) -> Learned:
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
    """The movement, steered around balls as strongly as it takes; what it touches all the same is said."""
    if not balls:
        return generate(learned, options), []
    centers, radii = [ball.center for ball in balls], np.array([ball.radius for ball in balls])
    if len({len(center) for center in centers}) > 1:
        raise SpecificationError("expected obstacles of equally many dimensions")
    points, placed = np.array(centers), _placed(learned)
    if points.shape[1] == len(learned.moving_columns):  # a point of the movement: an orientation says nothing of where
        points = points[:, placed]
    for stronger in _STRONGER:
        avoidance = ObstacleAvoidance(gamma=1000.0 * stronger)
        made = generate(learned, replace(options, obstacles=points, avoidance=avoidance))
        path = moving_positions(learned, made)[:, placed][:, : points.shape[1]]
        gaps = np.linalg.norm(path[:, None] - points, axis=2).min(axis=0) - radii
        if (gaps >= 0).all():
            return made, []
    said = [
        f"the movement passes {gap + radius:.3g} from the middle of obstacle {k + 1}, whose radius is {radius:.3g}: "
        "move the obstacle, or add a via point beside it"
        for k, (gap, radius) in enumerate(zip(gaps.tolist(), radii.tolist(), strict=True))
        if gap < 0
    ]
    return made, said


class Style(Sent):
    """A symbol with values of the directions in which its members differ."""

    symbol: Text
    values: list[Number] = Field(min_length=1, max_length=100)


class What(Sent):
    """What moves: the prototype of a symbol, a stored movement, or a style of a symbol; one of the three."""

    symbol: Text | None = None
    movement: int | None = None
    style: Style | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(one is not None for one in (self.symbol, self.movement, self.style)) != 1:
            raise ValueError("expected one of symbol, movement and style")
        return self


class Obstacle(Sent):
    """A ball to pass by."""

    center: Point
    radius: Number = Field(0.0, ge=0)


class Operated(Sent):
    """A primitive, in the formulation of the library or in another one."""

    what: What
    formulation: Text | None = None


class Wanted(Operated):
    """A new movement; what is left out is as demonstrated. Via points are pairs: share of the duration, point."""

    start: Point | None = None
    goal: Point | None = None
    via: list[tuple[Number, Point]] = Field([], max_length=100)
    obstacles: list[Obstacle] = Field([], max_length=100)
    duration: Number | None = Field(None, gt=0, description="[s]")
    rate: Number | None = Field(None, gt=0, description="Samples per second; by default 200 in all.")


class Exported(Wanted):
    """The same as a file."""

    format: Text = Field(description=f"One of {', '.join(WRITERS)}.")


class Moved(BaseModel):
    """A new movement, and what is to be said of it."""

    times: list[float]
    positions: Points
    velocities: Points
    accelerations: Points
    columns: list[str]
    start: list[float]
    goal: list[float]
    recorded: Points | None = Field(description="At most 64 points of the recording that moves; null for a style.")
    warnings: list[str]


class PrimitiveOut(BaseModel):
    """A primitive as the runtime reads it: its specification, and arrays as one block of bytes in base64."""

    format: str
    version: int
    movements: dict[str, Any]
    arrays: dict[str, tuple[str, int, int]] = Field(description="Kind, first byte and length of each.")
    data: str


class StylesOut(BaseModel):
    """How far the members of a symbol go in each direction of their styles, and where its prototype lies."""

    lowest: list[float]
    highest: list[float]
    explained: list[float]
    formulation: str = Field(description="That of the library, the only one in which styles move.")
