"""The library as it is: symbols, movements, the map, the history."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from kineme.anchoring.space import classical_scaling, conceptual_space
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.io.writing.write_movement import WRITERS
from kineme.library.members import described
from kineme.library.storage import read
from kineme.library.storage.rows import Row, among, listed, select
from kineme.library.storage.schema import COLUMNS, RETURNS, UNDO
from kineme.library.storage.store import Version
from kineme.library.storage.undo import can_undo
from kineme.reporting.text import counted, first_names, printable, shortened
from kineme.sampling import evenly_spaced
from kineme.studio.server.records import ChannelOut, MovementKey, Points, numbers, thumbnail
from kineme.studio.server.refusals import ConflictError
from kineme.studio.server.studio import Reads, Studio

_VERSIONS = 200  # that are listed, the last ones
_NAMES = 8  # of a list; more are counted
_LISTED = 20  # items of a list in a detail; of longer ones the length
_STATE = {name: k for k, name in enumerate(COLUMNS["symbol_state"])}


def said(version: Version, before: Row | None = None, undone: Sequence[Version] = ()) -> str:
    """Describe a change in one sentence; `before` is the annotated symbol as it was, `undone` what was taken back."""
    if undone:
        first, last = undone[0].id, undone[-1]
        which = f"version {last.id}" if first == last.id else f"versions {first} to {last.id}"
        details = [dict(each.detail) for each in undone]
        if len(undone) > 1 and all("added" in detail and "symbols" in detail for detail in details):
            added = sum(detail["added"] for detail in details)  # all that one call learned
            symbols = [name for detail in details for name in detail["symbols"]]
            last = replace(last, detail={"added": added, "symbols": symbols})
        return f"Took back {which}: {said(last)}"
    detail = dict(version.detail)
    words = _SAID.get(version.action, lambda _: version.action)
    try:
        return words(detail if before is None else {**detail, "before": before})
    except (KeyError, TypeError):  # what another version of kineme wrote
        return version.action


def _learned(detail: dict[str, Any]) -> str:
    added, symbols = detail["added"], detail["symbols"]
    what = f"Learned {_movements(added)}" if added else "Learned more of movements that were there"
    return f"{what}; new: {_names(symbols)}" if symbols else what


def _annotated(detail: dict[str, Any]) -> str:
    before = detail.get("before")
    parts = []
    for name in ("description", "prototype", "threshold"):
        if name in detail:
            was = "" if before is None else f" instead of {_value(before[_STATE[name]])}"
            parts.append(f"{name} {_value(detail[name])}{was}")
    return f"{_name(detail['symbol'])}: {', '.join(parts)}"


_SAID: dict[str, Any] = {
    "learn": _learned,
    "rename": lambda detail: f"Renamed {_name(detail['old'])} to {_name(detail['new'])}",
    "annotate": _annotated,
    "delete": lambda detail: (
        f"Deleted {_name(detail['symbol'])}; its movements stayed"
        if "symbol" in detail
        else f"Deleted {_movements(detail['movements'])}"
    ),
    "merge": lambda detail: f"Merged {_names(detail['names'])} into {_name(detail['into'])}",
    "split": lambda detail: (
        f"Split {_movements(detail['movements'])} off {_name(detail['symbol'])} as {_name(detail['new'])}"
    ),
    "assign": lambda detail: f"Assigned {_movements(detail['movements'])} to {_name(detail['symbol'])}",
    "release": lambda detail: f"Took the name off {_movements(detail['movements'])}",
    "reject": lambda detail: f"Rejected a proposal of {_movements(len(detail['movements']))}",
    "discover": lambda detail: (
        f"Proposed {counted(len(detail['names']), 'kind')} of {_movements(len(detail['movements']))}"
    ),
    "restore": lambda detail: f"Restored version {detail['to']}",
}


def _movements(n: int) -> str:
    return counted(n, "movement")


def _name(name: str) -> str:
    return shortened(printable(name), 60)


def _names(names: list[str]) -> str:
    return first_names(list(map(_name, names)), _NAMES)


def _value(value: Any) -> str:
    if value is None or value == "":
        return "none"
    return f"\u201c{_name(value)}\u201d" if isinstance(value, str) else f"{value:g}"


def _same_as(every: Sequence[Version], number: int, returns: Sequence[str] = RETURNS) -> int:
    """Return the first version that had the state of this one, as far as the history says so."""
    while number and (version := every[number - 1]).action in returns and _returned(version):
        number = version.detail["to"]
    return number


def _returned(version: Version) -> bool:
    """Tell whether a version says to which earlier one it returned, as all do but those of a damaged library."""
    to = version.detail.get("to")
    return isinstance(to, int) and 0 <= to < version.id


def _undone(every: Sequence[Version], version: Version) -> Sequence[Version]:
    """Find the versions that an undo took back: up to the one before it, or to the one whose state that one had."""
    if version.action != UNDO or not _returned(version):
        return ()
    return every[version.detail["to"] : _same_as(every, version.id - 1, (UNDO,))]


class SymbolOut(BaseModel):
    """A symbol, with the path of its prototype or first movement, at most 64 points."""

    id: str
    name: str
    description: str
    n_members: int
    prototype: int | None
    path: Points | None
    duration: float | None


class LibraryOut(BaseModel):
    """The library as it is now."""

    folder: str
    version: int
    n_movements: int
    n_dims: int | None
    channels: list[ChannelOut] | None
    read_only: bool
    can_undo: bool
    symbols: list[SymbolOut]
    unlabeled: int
    formats: list[str]
    formulations: list[str]


class MovementOut(BaseModel):
    """A movement in a list: at most 64 points of its path."""

    id: int
    name: str | None
    symbol: str | None
    group: str | None
    duration: float
    path: Points


class MovementsOut(BaseModel):
    """Some of `total` movements."""

    total: int
    movements: list[MovementOut]


class RecordingOut(BaseModel):
    """A whole movement."""

    id: int
    name: str | None
    symbol: str | None
    times: list[float]
    positions: Points


class MapPoint(BaseModel):
    """A movement among others: near those that it is like."""

    id: int
    symbol: str | None
    x: float
    y: float


class MapOut(BaseModel):
    """Some movements in the plane, equally many of each symbol."""

    points: list[MapPoint]


class VersionOut(BaseModel):
    """One change."""

    number: int
    time: str
    what: str
    said: str
    can_restore: bool
    detail: dict[str, Any]


class HistoryOut(BaseModel):
    """The last 200 changes, the last one first, and how many there are in all."""

    versions: list[VersionOut]
    total: int


router = APIRouter(prefix="/api/library", tags=["library"])

_ON_MAP = 600  # movements; their distances take 0.3 s
_MOST_ON_MAP = 2000  # where there are more symbols than that


@router.get("", response_model=LibraryOut, summary="What the library holds")
def library(request: Request, studio: Reads) -> Response:
    """Symbols with the path of their prototype, and how many movements have none."""

    def document() -> tuple[bytes, str]:
        """Make the answer of one version, and a tag that is another one when the answer is."""
        collects = gc.isenabled()
        gc.disable()  # 10,000 symbols are 640,000 lists, and a search for garbage would go through all again and again
        try:
            body = LibraryOut.model_validate(_library(studio)).model_dump_json().encode()
        finally:
            if collects:
                gc.enable()
        return body, f'"{sha256(body).hexdigest()[:20]}"'

    body, tag = studio.cached("library", document)
    same = request.headers.get("if-none-match") == tag
    return Response(None if same else body, 304 if same else 200, {"ETag": tag}, media_type="application/json")


@router.get("/movements", response_model=MovementsOut, summary="Movements, some at a time")
def movements(
    studio: Reads,
    symbol: Annotated[str | None, Query(description="Those of the symbol of this id.")] = None,
    unlabeled: Annotated[bool, Query(description="Those that belong to no symbol.")] = False,
    offset: Annotated[int, Query(ge=0, description="How many to pass over.")] = 0,
    limit: Annotated[int, Query(ge=1, le=500, description="How many at most.")] = 60,
    version: Annotated[int | None, Query(description="That the client has seen: a symbol gone since has none.")] = None,
) -> dict[str, Any]:
    """Those of a symbol, those without one, or all; in the order in which they were learned."""
    ids: Any
    if symbol is not None:
        try:
            ids = studio.symbol(symbol, version).members
        except ConflictError:  # its client hears of the change, and asks for it no more
            ids = ()
    else:
        ids = studio.library.unlabeled() if unlabeled else studio.library.ids()
    return {"total": len(ids), "movements": _listed(studio, ids[offset : offset + limit])}


@router.get("/movements/{key}", response_model=RecordingOut, summary="One whole movement")
def movement(studio: Reads, key: MovementKey) -> dict[str, Any]:
    """Its times [s] and positions as they were recorded."""
    studio.check_movements([key])
    recording = studio.library.movements(ids=[key])[0]
    return {
        "id": key,
        "name": recording.name,
        "symbol": studio.view().symbol_of.get(key),
        "times": numbers(recording.times),
        "positions": numbers(recording.positions),
    }


@router.get("/map", response_model=MapOut, summary="Movements in the plane, alike ones near each other")
def movement_map(studio: Reads) -> dict[str, Any]:
    """Classical scaling of their distances, of 600 movements, equally many of each symbol, or of one of each."""
    return studio.cached("map", lambda: _map(studio))


@router.get("/history", response_model=HistoryOut, summary="What was changed, the last change first")
def history(studio: Reads) -> dict[str, Any]:
    """The last 200 versions, each in a sentence, and whether its state is another one than now."""
    every = studio.library.history()
    last = every[: -_VERSIONS - 1 : -1]
    keys = {"keys": listed(version.id for version in last if version.action == "annotate")}
    with studio.library.store.reading() as connection:
        rows = select(connection, "symbol_state", among("removed"), keys)
    before = {row[_STATE["removed"]]: row for row in rows}  # version -> the state of the symbol that it replaced
    now = _same_as(every, len(every))
    versions = [
        {
            "number": version.id,
            "time": version.at,
            "what": version.action,
            "said": said(version, before.get(version.id), _undone(every, version)),
            "can_restore": not studio.read_only and _same_as(every, version.id) != now,
            "detail": {
                name: len(value) if isinstance(value, list) and len(value) > _LISTED else value
                for name, value in version.detail.items()
            },
        }
        for version in last
    ]
    return {"total": len(every), "versions": versions}


def _library(studio: Studio) -> dict[str, Any]:
    library, view = studio.library, studio.view()
    symbols = sorted(view.symbols.values(), key=lambda symbol: symbol.name)
    typical = [symbol.prototype or (int(symbol.members[0]) if len(symbol) else None) for symbol in symbols]
    paths = _listed(studio, np.array([key for key in typical if key], dtype=np.int64))
    drawn = {movement["id"]: movement for movement in paths}
    channels = library.channels
    return {
        "folder": printable(library.folder),
        "version": view.version,
        "n_movements": len(library),
        "n_dims": library.n_dims,
        "channels": None if channels is None else [channel._asdict() for channel in channels],
        "read_only": studio.read_only,
        "can_undo": can_undo(library.store),
        "unlabeled": len(library) - len(view.symbol_of),
        "formats": list(WRITERS),
        "formulations": list(FORMULATIONS),
        "symbols": [
            {
                "id": symbol.id,
                "name": symbol.name,
                "description": symbol.description,
                "n_members": len(symbol),
                "prototype": symbol.prototype,
                "path": drawn[key]["path"] if key else None,
                "duration": drawn[key]["duration"] if key else None,
            }
            for symbol, key in zip(symbols, typical, strict=True)
        ],
    }


def _listed(studio: Studio, ids: read.Ids) -> list[dict[str, Any]]:
    if not len(ids):
        return []
    store, symbol_of = studio.library.store, studio.view().symbol_of
    people = read.groups(store, ids)
    return [
        {
            "id": key,
            "name": recording.name,
            "symbol": symbol_of.get(key),
            "group": person,
            "duration": float(recording.duration),
            "path": thumbnail(recording.positions),
        }
        for key, recording, person in zip(ids.tolist(), read.movements(store, ids), people, strict=True)
    ]


def _map(studio: Studio) -> dict[str, Any]:
    view = studio.view()
    groups = [symbol.members for symbol in view.symbols.values() if len(symbol)]
    if len(rest := studio.library.unlabeled()):
        groups.append(rest)
    if not groups:
        return {"points": []}
    share = max(1, _ON_MAP // len(groups))
    ids = np.concatenate([group[evenly_spaced(len(group), share)] for group in groups])[:_MOST_ON_MAP]
    like = studio.library.specification.comparison
    space = conceptual_space(tuple(ids.tolist()), described(studio.library.store, ids), like)
    where = classical_scaling(space.distances)[0]
    return {
        "points": [
            {"id": key, "symbol": view.symbol_of.get(key), "x": x, "y": y}
            for key, (x, y) in zip(ids.tolist(), where.tolist(), strict=True)
        ]
    }
