"""What requests hold and what is answered, as the description of the interface shows them."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Name = Annotated[str, Field(min_length=1, max_length=10_000)]
Ids = Annotated[list[int], Field(min_length=1, max_length=1_000_000)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=1, max_length=1000)]
Times = Annotated[list[Number], Field(min_length=1, max_length=1_000_000)]
Points = list[list[float | None]]


class Sent(BaseModel):
    """What a client sends: nothing but the fields that are known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Change(Sent):
    """What a change may say beside what it is."""

    version: int | None = Field(None, description="The version that the client has seen; 409 if what is named is gone.")


class NewMovement(Change):
    """A movement to be stored."""

    times: Times
    positions: list[Point]
    label: Name | None = Field(None, description="Name of its symbol, which is made if needed.")
    group: Name | None = Field(None, description="Who showed it.")


class Rename(Change):
    """A new name of a symbol."""

    name: Name


class Describe(Change):
    """A description of a symbol."""

    text: str = Field(max_length=1_000_000)


class Split(Change):
    """Members of a symbol that become a new one."""

    ids: Ids
    name: Name


class Merge(Change):
    """Symbols that become one."""

    ids: list[str] = Field(min_length=1, max_length=10_000)
    into: Name


class Assign(Change):
    """Movements, and the symbol that they belong to from now on; none if null."""

    ids: Ids
    symbol: Name | None


class Chosen(Change):
    """Movements."""

    ids: Ids


class AsOf(Change):
    """The version that the client has seen, if it matters."""


class Asked(Sent):
    """A movement to be recognized."""

    times: Times
    positions: list[Point]
    error_rate: Number = Field(0.05, gt=0, lt=1)


class Style(Sent):
    """A symbol with values of the directions in which its members differ."""

    symbol: str
    values: list[Number] = Field(min_length=1, max_length=100)


class What(Sent):
    """What moves: the prototype of a symbol, a stored movement, or a style of a symbol; one of the three."""

    symbol: str | None = None
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
    """A movement as a sum over start and goal."""

    what: What
    formulation: str | None = None


class Wanted(Operated):
    """A new movement; what is left out is as demonstrated. Via points are pairs: share of the duration, point."""

    start: Point | None = None
    goal: Point | None = None
    via: list[tuple[Number, Point]] = Field([], max_length=100)
    obstacles: list[Obstacle] = Field([], max_length=100)
    duration: Number | None = Field(None, gt=0)
    rate: Number | None = Field(None, gt=0, description="Samples per second; by default 200 in all.")


class Exported(Wanted):
    """The same as a file."""

    format: str = Field(description="csv, npz, json, parquet")


class Moved(BaseModel):
    """A new movement, and what is to be said of it."""

    times: list[float]
    positions: Points
    velocities: Points
    accelerations: Points
    columns: list[str]
    start: list[float]
    goal: list[float]
    warnings: list[str]


class OperatorsOut(BaseModel):
    """``positions = of_start * start + of_goal * goal + constant``, at shares of the demonstrated duration."""

    times: list[float]
    of_start: list[float]
    of_goal: list[float]
    constant: Points


class StylesOut(BaseModel):
    """How far the members of a symbol go in each direction of their styles, and where its prototype lies."""

    lowest: list[float]
    highest: list[float]
    explained: list[float]


class ProposalOut(BaseModel):
    """Alike movements without a name."""

    id: str
    members: list[int]
    medoid: int
    suggested: str | None
    cohesion: float
    stability: float | None
    path: Points


class ProposalsOut(BaseModel):
    """The largest first."""

    proposals: list[ProposalOut]
    left_over: int


class Named(Change):
    """A name for a proposal."""

    name: Name
    description: str | None = None


class Version(BaseModel):
    """The version of the library after a change."""

    version: int


class Learned(Version):
    """Ids of the movements; of one that was stored before, the id it had."""

    ids: list[int]


class ChannelOut(BaseModel):
    """What some columns of the recordings are."""

    name: str
    kind: str
    columns: list[str]
    unit: str | None


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
    """At most 2,000 movements in the plane."""

    points: list[MapPoint]


class VersionOut(BaseModel):
    """One change."""

    number: int
    time: str
    what: str
    detail: dict[str, Any]


class HistoryOut(BaseModel):
    """All changes, the last one first."""

    versions: list[VersionOut]
    total: int


class RankedOut(BaseModel):
    """A class, and its p-value."""

    name: str
    p_value: float | None


class NearestOut(BaseModel):
    """A stored movement that is like the one asked for."""

    id: int
    name: str | None
    similarity: float | None


class AnswerOut(BaseModel):
    """What a movement is; label null is unknown."""

    label: str | None
    confidence: float | None
    p_known: float | None
    p_values: dict[str, float | None]
    ranked: list[RankedOut]
    nearest: list[NearestOut]
    calibrated: bool
    rule: str
    promise: str
