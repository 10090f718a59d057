"""What a movement to be recognized and the answer to it hold."""

from __future__ import annotations

from pydantic import BaseModel, Field

from kineme.studio.server.records import Number, Point, Sent, Times


class Asked(Sent):
    """A movement to be recognized."""

    times: Times
    positions: list[Point]
    error_rate: Number = Field(0.05, gt=0, lt=1)


class RankedOut(BaseModel):
    """A class, its probability if the movement is of a known one, and its p-value."""

    name: str
    probability: float | None
    p_value: float | None


class NearestOut(BaseModel):
    """A stored movement that is like the one asked for."""

    id: int
    name: str | None
    similarity: float | None


class AnswerOut(BaseModel):
    """What a movement is; label null is unknown."""

    label: str | None
    certainty: str
    confidence: float | None
    p_known: float | None
    p_values: dict[str, float | None]
    ranked: list[RankedOut]
    nearest: list[NearestOut]
    calibrated: bool
    rule: str
    promise: str
