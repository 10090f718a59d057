"""What a movement is."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, Field

from kineme.studio.server.records import Number, Point, Sent, Times, plain_answer, trajectory
from kineme.studio.server.studio import Reads


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


router = APIRouter(prefix="/api", tags=["recognition"])


@router.post("/recognize", response_model=AnswerOut, summary="Recognize a whole movement")
def recognize(studio: Reads, asked: Asked) -> dict[str, Any]:
    """Its symbol, or null for unknown; with p-values that are calibrated where there are enough demonstrations."""
    return plain_answer(studio.library.recognize(trajectory(asked.times, asked.positions), asked.error_rate))
