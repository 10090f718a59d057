"""What proposals hold, and what names them."""

from __future__ import annotations

from pydantic import BaseModel

from kineme.studio.server.records import Change, Description, Name, Points


class Named(Change):
    """A name for a proposal."""

    name: Name
    description: Description | None = None


class ProposalOut(BaseModel):
    """Alike movements without a name."""

    id: str
    members: list[int]
    medoid: int
    cohesion: float
    stability: float | None
    path: Points


class ProposalsOut(BaseModel):
    """The largest first."""

    proposals: list[ProposalOut]
    left_over: int
