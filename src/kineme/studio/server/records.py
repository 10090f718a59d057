"""What requests and answers of several kinds have in common."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

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


class AsOf(Change):
    """The version that the client has seen, if it matters."""


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
