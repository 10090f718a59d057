"""Changes of symbols and movements; each is one version, which `undo` takes back."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from kineme.anchoring.proposals import Proposal
from kineme.datasets.examples import load_example
from kineme.errors import SpecificationError
from kineme.library import proposals as stored
from kineme.library.storage import changes, read
from kineme.studio.server import records
from kineme.studio.server.refusals import ConflictError
from kineme.studio.server.studio import Reads, Studio, Writes

proposal_router = APIRouter(prefix="/api/proposals", tags=["proposals"])

router = APIRouter(prefix="/api/library", tags=["changes"])


@router.post("/movements", response_model=records.LearnedOut, summary="Store a movement, with or without a name")
def learn(studio: Writes, body: NewMovement) -> dict[str, Any]:
    """One drawing is enough for a new symbol; a movement that is stored already gets the symbol if it has none."""
    recording = records.trajectory(body.times, body.positions)
    report = studio.library.learn([recording], [body.label], groups=[body.group])
    return {"ids": report.ids.tolist(), "version": report.version}


@router.post("/example", response_model=records.LearnedOut, summary="Learn an example: letters, gestures or arm")
def learn_example(studio: Writes, body: ExampleRequest) -> dict[str, Any]:
    """Into a library that never held movements, or held those of as many dimensions, also if an undo took them back."""
    report = studio.library.learn(load_example(body.name))
    return {"ids": report.ids.tolist(), "version": report.version}


@router.post("/movements/assign", response_model=records.ChangedOut, summary="Say which symbol movements belong to")
def assign(studio: Writes, body: AssignRequest) -> dict[str, Any]:
    """They leave the one that they belonged to."""
    studio.check_movements(body.ids, body.version)
    store = studio.library.store
    if body.symbol is None:
        return {"version": changes.release(store, body.ids)}
    return {"version": changes.assign(store, body.ids, body.symbol, "label")}


@router.post("/movements/delete", response_model=records.ChangedOut, summary="Delete movements")
def delete_movements(studio: Writes, body: MovementsRequest) -> dict[str, Any]:
    """Earlier versions still hold them."""
    studio.check_movements(body.ids, body.version)
    return {"version": changes.delete_movements(studio.library.store, body.ids)}


@router.post("/symbols/merge", response_model=records.ChangedOut, summary="Merge symbols into one")
def merge(studio: Writes, body: MergeRequest) -> dict[str, Any]:
    """`into` names one of them, another one, or a new one."""
    keys = [studio.symbol(key, body.version).id for key in body.ids]  # a name may be another symbol's meanwhile
    return {"version": changes.merge(studio.library.store, keys, body.into)}


@router.post("/symbols/{key}/rename", response_model=records.ChangedOut, summary="Rename a symbol")
def rename(studio: Writes, key: records.SymbolKey, body: RenameRequest) -> dict[str, Any]:
    """Its id stays."""
    studio.symbol(key, body.version)
    return {"version": changes.rename(studio.library.store, key, body.name)}


@router.post("/symbols/{key}/describe", response_model=records.ChangedOut, summary="Describe a symbol")
def describe(studio: Writes, key: records.SymbolKey, body: DescribeRequest) -> dict[str, Any]:
    """In words of your own."""
    studio.symbol(key, body.version)
    return {"version": changes.annotate(studio.library.store, key, description=body.text)}


@router.post("/symbols/{key}/split", response_model=records.ChangedOut, summary="Make a new symbol of some members")
def split(studio: Writes, key: records.SymbolKey, body: SplitRequest) -> dict[str, Any]:
    """The others stay."""
    studio.check_movements(body.ids, body.version)
    studio.symbol(key, body.version)
    return {"version": changes.split(studio.library.store, key, body.ids, body.name)}


@router.delete("/symbols/{key}", response_model=records.ChangedOut, summary="Delete a symbol; its movements stay")
def delete_symbol(
    studio: Writes, key: records.SymbolKey, version: Annotated[int | None, Query(description=records.VERSION)] = None
) -> dict[str, Any]:
    """They belong to none then."""
    return {"version": changes.delete_symbol(studio.library.store, studio.symbol(key, version).id)}


@router.post("/undo", response_model=records.ChangedOut, summary="Take back the last change, or restore a version")
def undo(studio: Writes, body: UndoRequest | None = None) -> dict[str, Any]:
    """Make a new version; again, the change before. 409 if another change came since the version that is named."""
    expected, to = (None, None) if body is None else (body.version, body.to)
    try:
        return {"version": studio.library.undo(expected, to).version}
    except SpecificationError as error:
        if expected is not None and studio.library.version != expected:
            raise ConflictError(str(error)) from None
        raise


class NewMovement(records.Change):
    """A movement to be stored."""

    times: records.Times
    positions: list[records.Point]
    label: records.Name | None = Field(None, description="Name of its symbol, which is made if needed.")
    group: records.Name | None = Field(None, description="Who showed it.")


class ExampleRequest(records.RequestBody):
    """An example by its name, see `kineme.datasets.load_example`."""

    name: records.Name


class UndoRequest(records.Change):
    """The version whose state is wanted again; by default that before the last change."""

    to: int | None = Field(None, ge=0)


class RenameRequest(records.Change):
    """A new name of a symbol."""

    name: records.Name


class DescribeRequest(records.Change):
    """A description of a symbol."""

    text: records.Description


class MergeRequest(records.Change):
    """Symbols that become one."""

    ids: list[records.Text] = Field(min_length=1, max_length=10_000)
    into: records.Name


class MovementsRequest(records.Change):
    """Movements."""

    ids: records.Ids


class AssignRequest(MovementsRequest):
    """Movements, and the symbol that they belong to from now on; none if null."""

    symbol: records.Name | None


class SplitRequest(MovementsRequest):
    """Members of a symbol that become a new one."""

    name: records.Name


class AcceptRequest(RenameRequest):
    """A name for a proposal."""

    description: records.Description | None = None


class ProposalOut(BaseModel):
    """Alike movements without a name."""

    id: str
    members: list[int]
    medoid: int
    cohesion: float
    stability: float | None
    name: str | None = Field(None, description="A name that is proposed for it.")
    path: records.Points


class ProposalsOut(BaseModel):
    """The largest first."""

    proposals: list[ProposalOut]
    left_over: int


@proposal_router.get("", response_model=ProposalsOut, summary="Movements without a name that could be symbols")
async def proposals(studio: Reads) -> dict[str, Any]:
    """The largest group first; where there are symbols, their members say how alike movements of one are."""
    return await studio.cached_in_background("listed proposals", lambda: _listed_proposals(studio))


@proposal_router.post("/{key}/accept", response_model=records.ChangedOut, summary="Name a proposal")
def accept(studio: Writes, key: records.ProposalKey, body: AcceptRequest) -> dict[str, Any]:
    """Its movements belong to that symbol from now on, which is made if needed; its medoid is the prototype."""
    return {"version": stored.accept(studio.library.store, _proposal(studio, key), body.name, body.description)}


@proposal_router.post("/{key}/reject", response_model=records.ChangedOut, summary="Propose it no more")
def reject(studio: Writes, key: records.ProposalKey, body: records.Change | None = None) -> dict[str, Any]:
    """Its movements stay without a name."""
    return {"version": stored.reject(studio.library.store, _proposal(studio, key))}


def _listed_proposals(studio: Studio) -> dict[str, Any]:
    by_key, left_over = studio.cached("proposals", lambda: _propose(studio))
    store = studio.library.store
    return {
        "proposals": [
            {
                "id": key,
                "members": proposal.members.tolist(),
                "medoid": proposal.medoid,
                "cohesion": proposal.cohesion,
                "stability": records.numbers(proposal.stability),
                "name": proposal.name,
                "path": records.thumbnail(read.movements(store, np.array([proposal.medoid]))[0].positions),
            }
            for key, proposal in by_key.items()
        ],
        "left_over": left_over,
    }


def _propose(studio: Studio) -> tuple[dict[str, Proposal], int]:
    """Return proposals by keys that are the same for the same movements, and how many movements are left over."""
    proposals = studio.library.propose()
    every = [proposals[k] for k in range(len(proposals))]
    keys = [hashlib.sha256(proposal.members.astype("int64").tobytes()).hexdigest()[:16] for proposal in every]
    return dict(zip(keys, every, strict=True)), len(proposals.left_over)


def _proposal(studio: Studio, key: str) -> Proposal:
    """Return the proposal of these movements, if it is one still."""
    by_key, _ = studio.cached("proposals", lambda: _propose(studio))
    if key not in by_key:
        raise ConflictError("the proposal is gone: its movements were named or deleted meanwhile; look at them again")
    return by_key[key]
