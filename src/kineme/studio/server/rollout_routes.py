"""New movements, as numbers and as files."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from fastapi import APIRouter
from fastapi.responses import Response

from kineme.io.writing.write_movement import encode_movement
from kineme.studio.server.records import SymbolKey, numbers, thumbnail
from kineme.studio.server.rollouts import (
    Exported,
    Moved,
    Operated,
    PrimitiveOut,
    StylesOut,
    Wanted,
    learned_as,
    make,
    moving_positions,
    primitive_document,
    styles_of,
)
from kineme.studio.server.studio import Reads

router = APIRouter(prefix="/api", tags=["movement"])


@router.post("/rollout", response_model=Moved, summary="A new movement")
def rollout(studio: Reads, asked: Wanted) -> dict[str, Any]:
    """Of a symbol, a stored movement or a style: from another start, to another goal, past points and obstacles.

    Its columns are those that a start and a goal have; the steps of a gripper are in the file that is exported.
    """
    made, learned = make(studio, asked), learned_as(studio, asked)
    columns, recording = made.movement.columns, learned.demonstration
    positions = moving_positions(learned, made.movement)
    return {
        **{name: numbers(columns[name]) for name in ("times", "velocities", "accelerations")},
        "positions": numbers(positions),
        "columns": list(learned.moving_columns),
        "start": numbers(positions[0]),
        "goal": numbers(positions[-1] if asked.goal is None else asked.goal),
        "recorded": None if recording is None else thumbnail(recording.positions),
        "warnings": made.warnings,
    }


@router.post("/primitive", response_model=PrimitiveOut | None, summary="A primitive for the runtime of the page")
def primitive(studio: Reads, asked: Operated) -> Response:
    """To follow a hand without a request for each picture, by ``/runtime/primitive.js``; null where that cannot be."""
    key = asked.model_dump_json()
    document = studio.kept_some("primitive", key, lambda: primitive_document(studio, asked))
    return Response(document, media_type="application/json")


@router.get(
    "/library/symbols/{key}/styles", response_model=StylesOut, summary="In which ways members of a symbol differ"
)
def styles(studio: Reads, key: SymbolKey) -> dict[str, Any]:
    """The range of each direction; values of a rollout's style lie between."""
    model = styles_of(studio, key)
    ranges = {"lowest": model.lowest, "highest": model.highest, "explained": model.explained_variance}
    shown = {name: numbers(values) for name, values in ranges.items()}
    return {**shown, "formulation": studio.library.specification.dmp.formulation}


@router.post(
    "/export",
    summary="A new movement as a file",
    response_class=Response,
    responses={200: {"content": {"application/octet-stream": {}}, "description": "The file, with its name."}},
)
def export(studio: Reads, asked: Exported) -> Response:
    """With times, positions, velocities and accelerations, in each format that movements are written in."""
    made = make(studio, asked)
    ending = f".{asked.format.lower().lstrip('.')}"
    data = encode_movement(made.movement.columns, ending, made.movement.names)
    symbol = asked.what.symbol or (asked.what.style.symbol if asked.what.style else None)
    name = studio.symbol(symbol).name if symbol else f"movement {asked.what.movement}"
    return Response(
        data, media_type="application/octet-stream", headers={"Content-Disposition": _saved_as(name, ending)}
    )


def _saved_as(name: str, ending: str) -> str:
    """A file's name for browsers: letters and digits of the name, whatever alphabet they are of."""
    plain = "".join(mark if mark.isalnum() or mark in "-_" else "_" for mark in name)[:80] or "movement"
    ascii_only = plain.encode("ascii", "replace").decode().replace("?", "_")
    return f"attachment; filename=\"{ascii_only}{ending}\"; filename*=UTF-8''{quote(plain + ending)}"
