"""Groups of alike movements without a name, for a person to name."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel

from kineme.anchoring.proposals import Proposal
from kineme.library import proposals as stored
from kineme.library.storage import read
from kineme.studio.server.records import (
    AsOf,
    Change,
    Description,
    Name,
    Points,
    ProposalKey,
    Version,
    numbers,
    thumbnail,
)
from kineme.studio.server.refusals import ConflictError
from kineme.studio.server.studio import Reads, Studio, Writes


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


router = APIRouter(prefix="/api/proposals", tags=["proposals"])


@router.get("", response_model=ProposalsOut, summary="Movements without a name that could be symbols")
async def proposals(studio: Reads) -> dict[str, Any]:
    """The largest group first; where there are symbols, their members say how alike movements of one are."""
    return await studio.searched("listed proposals", lambda: _listed(studio))


@router.post("/{key}/accept", response_model=Version, summary="Name a proposal")
def accept(studio: Writes, key: ProposalKey, asked: Named) -> dict[str, Any]:
    """Its movements belong to that symbol from now on, which is made if needed; its medoid is the prototype."""
    made = _proposal(studio, key)
    return {"version": stored.accept(studio.library.store, made, asked.name, asked.description)}


@router.post("/{key}/reject", response_model=Version, summary="Propose it no more")
def reject(studio: Writes, key: ProposalKey, asked: AsOf | None = None) -> dict[str, Any]:
    """Its movements stay without a name."""
    return {"version": stored.reject(studio.library.store, _proposal(studio, key))}


def _listed(studio: Studio) -> dict[str, Any]:
    found, left_over = studio.kept("proposals", lambda: _propose(studio))
    return {"proposals": [_plain(studio, key, one) for key, one in found.items()], "left_over": left_over}


def _propose(studio: Studio) -> tuple[dict[str, Proposal], int]:
    made = studio.library.propose()
    every = [made[k] for k in range(len(made))]
    return {_key(one): one for one in every}, len(made.left_over)


def _proposal(studio: Studio, key: str) -> Proposal:
    """The proposal of these movements, if it is one still."""
    found, _ = studio.kept("proposals", lambda: _propose(studio))
    if key not in found:
        raise ConflictError("the proposal is gone: its movements were named or deleted meanwhile; look at them again")
    return found[key]


def _key(one: Proposal) -> str:
    """The same for the same movements."""
    return hashlib.sha256(one.members.astype("int64").tobytes()).hexdigest()[:16]


def _plain(studio: Studio, key: str, one: Proposal) -> dict[str, Any]:
    medoid = read.movements(studio.library.store, np.array([one.medoid]))[0]
    return {
        "id": key,
        "members": one.members.tolist(),
        "medoid": one.medoid,
        "cohesion": one.cohesion,
        "stability": numbers(one.stability),
        "path": thumbnail(medoid.positions),
    }
