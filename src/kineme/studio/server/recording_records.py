"""What requests and answers about recordings hold."""

from __future__ import annotations

from pydantic import BaseModel, Field

from kineme.studio.server.records import Change, ChannelOut, Name, Number, Sent, Text


class ChannelsAsked(Change):
    """Which table of a recording, and which of its columns; by default the first, and those that are found."""

    table: Text | None = None
    channels: list[Text] | None = Field(None, max_length=1000)


class Spotting(ChannelsAsked):
    """What to look for."""

    error_rate: Number = Field(0.05, gt=0, lt=1)


class Span(Sent):
    """A stretch of a recording, in seconds since its first sample, and what it shows."""

    begin: Number
    end: Number
    label: Name | None = None


class LearnSpans(ChannelsAsked):
    """Stretches of one table to be learned; without them all tables of the file, by the labels that it gives them."""

    spans: list[Span] | None = Field(None, min_length=1, max_length=100_000)


class ColumnOut(BaseModel):
    """Values of one column."""

    name: str
    values: list[float | None]


class PlotOut(BaseModel):
    """Columns over time, at most 1,000 samples of each."""

    times: list[float]
    columns: list[ColumnOut]


class TableOut(BaseModel):
    """One recording of a file."""

    name: str
    channels: list[ChannelOut]
    duration: float
    rate: float | None
    n_samples: int
    label: str | None = Field(description="What the file says that it shows.")


class UploadOut(BaseModel):
    """What a file holds."""

    recording: str
    tables: list[TableOut]
    problems: list[str]
    plots: list[PlotOut] = Field(description="One of each table.")


class SpannedOut(BaseModel):
    """A stretch of motion, and what it shows; null is unknown."""

    begin: float
    end: float
    label: str | None
    p: float | None


class RestOut(BaseModel):
    """A stretch without motion."""

    begin: float
    end: float


class SpottedOut(BaseModel):
    """What happens when."""

    spans: list[SpannedOut]
    rests: list[RestOut]


class SearchedOut(BaseModel):
    """How much of a recording is searched, from 0 to 1; null where nothing is searched."""

    share: float | None
