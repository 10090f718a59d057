"""Changes of symbols and movements; each is one version, which `undo` takes back."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import Field

from kineme.errors import SpecificationError
from kineme.library.storage import changes
from kineme.studio.server.records import (
    VERSION,
    Change,
    Description,
    Ids,
    Learned,
    Name,
    Point,
    SymbolKey,
    Text,
    Times,
    Version,
    trajectory,
)
from kineme.studio.server.refusals import ConflictError
from kineme.studio.server.studio import Writes

router = APIRouter(prefix="/api/library", tags=["changes"])


@router.post("/movements", response_model=Learned, summary="Store a movement, with or without a name")
def learn(studio: Writes, asked: NewMovement) -> dict[str, Any]:
    """One drawing is enough for a new symbol; a movement that is stored already gets the symbol if it has none."""
    one = trajectory(asked.times, asked.positions)
    report = studio.library.learn([one], [asked.label], groups=[asked.group])
    return {"ids": report.ids.tolist(), "version": report.version}


@router.post("/movements/assign", response_model=Version, summary="Say which symbol movements belong to")
def assign(studio: Writes, asked: Assign) -> dict[str, Any]:
    """They leave the one that they belonged to."""
    studio.check_movements(asked.ids, asked.version)
    store = studio.library.store
    if asked.symbol is None:
        return {"version": changes.release(store, asked.ids)}
    return {"version": changes.assign(store, asked.ids, asked.symbol, "label")}


@router.post("/movements/delete", response_model=Version, summary="Delete movements")
def delete_movements(studio: Writes, asked: Chosen) -> dict[str, Any]:
    """Earlier versions still hold them."""
    studio.check_movements(asked.ids, asked.version)
    return {"version": changes.delete_movements(studio.library.store, asked.ids)}


@router.post("/symbols/merge", response_model=Version, summary="Merge symbols into one")
def merge(studio: Writes, asked: Merge) -> dict[str, Any]:
    """`into` names one of them, another one, or a new one."""
    keys = [studio.symbol(key, asked.version).id for key in asked.ids]  # a name may be another symbol's meanwhile
    return {"version": changes.merge(studio.library.store, keys, asked.into)}


@router.post("/symbols/{key}/rename", response_model=Version, summary="Rename a symbol")
def rename(studio: Writes, key: SymbolKey, asked: Rename) -> dict[str, Any]:
    """Its id stays."""
    studio.symbol(key, asked.version)
    return {"version": changes.rename(studio.library.store, key, asked.name)}


@router.post("/symbols/{key}/describe", response_model=Version, summary="Describe a symbol")
def describe(studio: Writes, key: SymbolKey, asked: Describe) -> dict[str, Any]:
    """In words of your own."""
    studio.symbol(key, asked.version)
    return {"version": changes.annotate(studio.library.store, key, description=asked.text)}


@router.post("/symbols/{key}/split", response_model=Version, summary="Make a new symbol of some members")
def split(studio: Writes, key: SymbolKey, asked: Split) -> dict[str, Any]:
    """The others stay."""
    studio.check_movements(asked.ids, asked.version)
    studio.symbol(key, asked.version)
    return {"version": changes.split(studio.library.store, key, asked.ids, asked.name)}


@router.delete("/symbols/{key}", response_model=Version, summary="Delete a symbol; its movements stay")
def delete_symbol(
    studio: Writes, key: SymbolKey, version: Annotated[int | None, Query(description=VERSION)] = None
) -> dict[str, Any]:
    """They belong to none then."""
    return {"version": changes.delete_symbol(studio.library.store, studio.symbol(key, version).id)}


@router.post("/undo", response_model=Version, summary="Take back the last change, or restore a version")
def undo(studio: Writes, asked: Back | None = None) -> dict[str, Any]:
    """As a new version; again, the change before. 409 if another change came since the version that is named."""
    expected, to = (None, None) if asked is None else (asked.version, asked.to)
    try:
        return {"version": studio.library.undo(expected, to).version}
    except SpecificationError as error:
        if expected is not None and studio.library.version != expected:
            raise ConflictError(str(error)) from None
        raise


class NewMovement(Change):
    """A movement to be stored."""

    times: Times
    positions: list[Point]
    label: Name | None = Field(None, description="Name of its symbol, which is made if needed.")
    group: Name | None = Field(None, description="Who showed it.")


class Back(Change):
    """Which version's state is wanted again; by default that before the last change."""

    to: int | None = Field(None, ge=0)


class Rename(Change):
    """A new name of a symbol."""

    name: Name


class Describe(Change):
    """A description of a symbol."""

    text: Description


class Split(Change):
    """Members of a symbol that become a new one."""

    ids: Ids
    name: Name


class Merge(Change):
    """Symbols that become one."""

    ids: list[Text] = Field(min_length=1, max_length=10_000)
    into: Name


class Assign(Change):
    """Movements, and the symbol that they belong to from now on; none if null."""

    ids: Ids
    symbol: Name | None


class Chosen(Change):
    """Movements."""

    ids: Ids
