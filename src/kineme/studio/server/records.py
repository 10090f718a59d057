"""What requests and answers of several kinds have in common."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path
from pydantic import BaseModel, ConfigDict, Field

#: With a limit pydantic also refuses halves of characters, which JSON can hold and which nothing can write.
Text = Annotated[str, Field(max_length=10_000)]
Name = Annotated[Text, Field(min_length=1)]
Description = Annotated[str, Field(max_length=1_000_000)]
Ids = Annotated[list[int], Field(min_length=1, max_length=1_000_000)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=1, max_length=1000)]
Times = Annotated[list[Number], Field(min_length=1, max_length=1_000_000)]
Points = list[list[float | None]]
SymbolKey = Annotated[str, Path(description="Id of a symbol, as in `/api/library`.")]
MovementKey = Annotated[int, Path(description="Id of a movement, as in `/api/library/movements`.")]
ProposalKey = Annotated[str, Path(description="Id of a proposal, as in `/api/proposals`.")]
RecordingKey = Annotated[str, Path(description="What was answered when the recording was sent.")]

VERSION = "The version that the client has seen; 409 if what is named is gone."


class Sent(BaseModel):
    """What a client sends: nothing but the fields that are known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Change(Sent):
    """What a change may say beside what it is."""

    version: int | None = Field(None, description=VERSION)


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
