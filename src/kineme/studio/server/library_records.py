"""What answers about the library hold."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from kineme.studio.server.records import ChannelOut, Points


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
    """Where a movement lies among others: near those that it is like."""

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
