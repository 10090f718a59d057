"""Answers to movements: their symbols, why, how two differ, and which symbols are mixed up."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from kineme.errors import SpecificationError
from kineme.sampling import evenly_spaced
from kineme.studio.server import records
from kineme.studio.server.studio import Reads, Studio

MovementId = Annotated[int, Query(description="Id of a movement, as in `/api/library/movements`.")]


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


router = APIRouter(prefix="/api", tags=["recognition"])

_CONFUSED, _MOST_CONFUSED = 300, 40  # movements, which take seconds, and symbols, whose names are legible


@router.post("/recognize", response_model=AnswerOut, summary="Recognize a whole movement")
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
    turned: float
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


@router.post("/why", response_model=WhyOut, summary="Explain the answer to a whole movement")
def explain(studio: Reads, body: RecognizeRequest) -> dict[str, Any]:
    """The movement over its nearest example and over the runner-up, as `kineme why` draws it."""
    movement = records.trajectory(body.times, body.positions)
    return studio.library.recognize(movement, body.error_rate).explain().to_dict()


@router.get("/compare", response_model=WhyOut, summary="Compare two movements of the library")
def compare_stored(studio: Reads, first: MovementId, second: MovementId) -> dict[str, Any]:
    """The second laid over the first, where they differ, and a sentence, as `kineme.recognition.compare` gives them."""
    from kineme.recognition.differences import compare  # scikit-learn, which the studio starts without

    studio.check_movements([first, second])
    movement, other = studio.library.movements(ids=[first, second])
    return compare(movement, other, studio.library.specification.recognizer()).to_dict()


class ConfusionOut(BaseModel):
    """Names, how many movements of each (row) were taken for each (column), and how many are right, in words."""

    names: list[str]
    counts: list[list[int]]
    in_words: str


@router.get("/confusion", response_model=ConfusionOut, summary="Which symbols are taken for which")
async def mistakes(studio: Reads) -> dict[str, Any]:
    """Up to 300 movements of the forty largest symbols, each recognized by those of which it is none."""
    return await studio.cached_in_background("confusion", lambda: _mistakes(studio))


def _mistakes(studio: Studio) -> dict[str, Any]:
    from kineme.recognition.differences import confusion

    symbols = sorted(studio.view().symbols.values(), key=lambda symbol: (-len(symbol), symbol.name))
    symbols = [symbol for symbol in symbols if len(symbol) > 1][:_MOST_CONFUSED]
    if len(symbols) < 2:
        raise SpecificationError("expected two symbols of two movements or more, got fewer; draw each of two again")
    share = _CONFUSED // len(symbols)
    ids = [symbol.members[evenly_spaced(len(symbol), share)] for symbol in symbols]
    labels = [symbol.name for symbol, members in zip(symbols, ids, strict=True) for _ in members]
    movements = studio.library.movements(ids=np.concatenate(ids))
    counted = confusion(movements, labels, recognizer=studio.library.specification.recognizer())
    return {"names": counted.labels, "counts": counted.counts[:, :-1].tolist(), "in_words": counted.in_words}
