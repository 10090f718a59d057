"""What each version changed, in a sentence, and which versions can be restored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from kineme.library.storage.rows import Row, among, listed, select
from kineme.library.storage.schema import COLUMNS, RETURNS, UNDO
from kineme.library.storage.store import Version
from kineme.reporting.text import counted, printable, shortened
from kineme.studio.server.studio import Studio

_VERSIONS = 200  # that are listed, the last ones
_NAMES = 8  # of a list; more are counted
_STATE = {name: k for k, name in enumerate(COLUMNS["symbol_state"])}


def listed_history(studio: Studio) -> dict[str, Any]:
    """The last versions, the last one first."""
    every = studio.library.history()
    last = every[: -_VERSIONS - 1 : -1]
    before = _annotated_before(studio, last)
    now = _same_as(every, len(every))
    return {
        "total": len(every),
        "versions": [
            {
                "number": one.id,
                "time": one.at,
                "what": one.action,
                "said": said(one, before.get(one.id), _undone(every, one)),
                "can_restore": not studio.read_only and _same_as(every, one.id) != now,
                "detail": _short(dict(one.detail)),
            }
            for one in last
        ],
    }


def said(version: Version, before: Row | None = None, undone: Sequence[Version] = ()) -> str:
    """A change in one sentence; `before` is how the annotated symbol was, `undone` what was taken back."""
    if undone:
        first, last = undone[0].id, undone[-1].id
        which = f"version {last}" if first == last else f"versions {first} to {last}"
        return f"Took back {which}: {said(_in_one(undone))}"
    detail = dict(version.detail)
    words = _SAID.get(version.action, lambda _: version.action)
    try:
        return words(detail if before is None else {**detail, "before": before})
    except (KeyError, TypeError):  # what another version of kineme wrote
        return version.action


def _in_one(versions: Sequence[Version]) -> Version:
    """The one change that they are; of several, all that one call learned."""
    details = [dict(one.detail) for one in versions]
    if len(versions) == 1 or not all("added" in one and "symbols" in one for one in details):
        return versions[-1]
    whole = {
        "added": sum(one["added"] for one in details),
        "symbols": [name for one in details for name in one["symbols"]],
    }
    return replace(versions[-1], detail=whole)


def _learned(detail: dict[str, Any]) -> str:
    added, made = detail["added"], detail["symbols"]
    what = f"Learned {_movements(added)}" if added else "Learned more of movements that were there"
    return f"{what}; new: {_names(made)}" if made else what


def _annotated(detail: dict[str, Any]) -> str:
    before = detail.get("before")
    parts = []
    for name in ("description", "prototype", "threshold"):
        if name in detail:
            was = "" if before is None else f" instead of {_value(before[_STATE[name]])}"
            parts.append(f"{name} {_value(detail[name])}{was}")
    return f"{_name(detail['symbol'])}: {', '.join(parts)}"


def _deleted(detail: dict[str, Any]) -> str:
    if "symbol" in detail:
        return f"Deleted {_name(detail['symbol'])}; its movements stayed"
    return f"Deleted {_movements(detail['movements'])}"


_SAID: dict[str, Any] = {
    "learn": _learned,
    "rename": lambda one: f"Renamed {_name(one['old'])} to {_name(one['new'])}",
    "annotate": _annotated,
    "delete": _deleted,
    "merge": lambda one: f"Merged {_names(one['names'])} into {_name(one['into'])}",
    "split": lambda one: f"Split {_movements(one['movements'])} off {_name(one['symbol'])} as {_name(one['new'])}",
    "assign": lambda one: f"Assigned {_movements(one['movements'])} to {_name(one['symbol'])}",
    "release": lambda one: f"Took the name off {_movements(one['movements'])}",
    "reject": lambda one: f"Rejected a proposal of {_movements(len(one['movements']))}",
    "restore": lambda one: f"Restored version {one['to']}",
}


def _movements(n: int) -> str:
    return counted(n, "movement")


def _name(name: str) -> str:
    return shortened(printable(name), 60)


def _names(names: list[str]) -> str:
    more = len(names) - _NAMES
    return ", ".join(map(_name, names[:_NAMES])) + (f" and {more} more" if more > 0 else "")


def _value(value: Any) -> str:
    if value is None or value == "":
        return "none"
    return f"\u201c{_name(value)}\u201d" if isinstance(value, str) else f"{value:g}"


def _annotated_before(studio: Studio, versions: Sequence[Version]) -> dict[int, Row]:
    """Version -> the row of the symbol's state that it replaced."""
    keys = {"keys": listed(one.id for one in versions if one.action == "annotate")}
    with studio.library.store.reading() as connection:
        rows = select(connection, "symbol_state", among("removed"), keys)
    return {row[_STATE["removed"]]: row for row in rows}


def _same_as(every: Sequence[Version], number: int, returns: Sequence[str] = RETURNS) -> int:
    """The first version that had the state of this one, as far as the history says so."""
    while number and (one := every[number - 1]).action in returns and _returned(one):
        number = one.detail["to"]
    return number


def _returned(one: Version) -> bool:
    """Whether it says the earlier version that it returned to, as all do but those of a damaged library."""
    to = one.detail.get("to")
    return isinstance(to, int) and 0 <= to < one.id


def _undone(every: Sequence[Version], one: Version) -> Sequence[Version]:
    """The versions that an undo took back: those up to the one before it, or to the one whose state that one had."""
    if one.action != UNDO or not _returned(one):
        return ()
    return every[one.detail["to"] : _same_as(every, one.id - 1, (UNDO,))]


def _short(detail: dict[str, Any]) -> dict[str, Any]:
    """What a change says of itself; long lists by their length."""
    return {
        name: len(value) if isinstance(value, list) and len(value) > 20 else value for name, value in detail.items()
    }
