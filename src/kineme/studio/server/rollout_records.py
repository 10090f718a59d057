"""What requests for new movements and the answers to them hold."""

from __future__ import annotations

from typing import Any, Self

from pydantic import BaseModel, Field, model_validator

from kineme.io.write_movement import WRITERS
from kineme.studio.server.records import Number, Point, Points, Sent, Text


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
