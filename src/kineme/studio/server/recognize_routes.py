"""What a movement is."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from kineme.studio.server.plain import plain_answer, trajectory
from kineme.studio.server.recognize_records import AnswerOut, Asked
from kineme.studio.server.studio import Reads

router = APIRouter(prefix="/api", tags=["recognition"])


@router.post("/recognize", response_model=AnswerOut, summary="Recognize a whole movement")
def recognize(studio: Reads, asked: Asked) -> dict[str, Any]:
    """Its symbol, or null for unknown; with p-values that are calibrated where there are enough demonstrations."""
    return plain_answer(studio.library.recognize(trajectory(asked.times, asked.positions), asked.error_rate))
