"""Changes of symbols and movements; each is one version, which `undo` takes back."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from kineme.errors import SpecificationError
from kineme.studio.server.change_records import Assign, Chosen, Describe, Merge, NewMovement, Rename, Split
from kineme.studio.server.plain import trajectory
from kineme.studio.server.records import AsOf, Learned, Version
from kineme.studio.server.refusals import ConflictError
from kineme.studio.server.studio import Studio, Writes

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
    if asked.symbol is None:
        studio.library.release(asked.ids)
    else:
        studio.library.assign(asked.ids, asked.symbol, "label")
    return _version(studio)


@router.post("/movements/delete", response_model=Version, summary="Delete movements")
def delete_movements(studio: Writes, asked: Chosen) -> dict[str, Any]:
    """Earlier versions still hold them."""
    studio.check_movements(asked.ids, asked.version)
    studio.library.delete(asked.ids)
    return _version(studio)


@router.post("/symbols/merge", response_model=Version, summary="Merge symbols into one")
def merge(studio: Writes, asked: Merge) -> dict[str, Any]:
    """`into` names one of them, another one, or a new one."""
    names = [studio.symbol(key, asked.version).name for key in asked.ids]
    studio.library.merge(names, asked.into)
    return _version(studio)


@router.post("/symbols/{key}/rename", response_model=Version, summary="Rename a symbol")
def rename(studio: Writes, key: str, asked: Rename) -> dict[str, Any]:
    """Its id stays."""
    studio.library.rename(studio.symbol(key, asked.version).name, asked.name)
    return _version(studio)


@router.post("/symbols/{key}/describe", response_model=Version, summary="Describe a symbol")
def describe(studio: Writes, key: str, asked: Describe) -> dict[str, Any]:
    """In words of your own."""
    studio.library.annotate(studio.symbol(key, asked.version).name, asked.text)
    return _version(studio)


@router.post("/symbols/{key}/split", response_model=Version, summary="Make a new symbol of some members")
def split(studio: Writes, key: str, asked: Split) -> dict[str, Any]:
    """The others stay."""
    studio.check_movements(asked.ids, asked.version)
    studio.library.split(studio.symbol(key, asked.version).name, asked.ids, asked.name)
    return _version(studio)


@router.delete("/symbols/{key}", response_model=Version, summary="Delete a symbol; its movements stay")
def delete_symbol(studio: Writes, key: str, version: int | None = None) -> dict[str, Any]:
    """They belong to none then."""
    studio.library.delete(studio.symbol(key, version).name)
    return _version(studio)


@router.post("/undo", response_model=Version, summary="Take back the last change")
def undo(studio: Writes, asked: AsOf | None = None) -> dict[str, Any]:
    """As a new version; again, the one before. 409 if another change came since the version that is named."""
    expected = None if asked is None else asked.version
    try:
        return {"version": studio.library.undo(expected).version}
    except SpecificationError as error:
        if expected is not None and studio.library.version != expected:
            raise ConflictError(str(error)) from None
        raise


def _version(studio: Studio) -> dict[str, Any]:
    return {"version": studio.library.version}
