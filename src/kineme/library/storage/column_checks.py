"""Valid values of every column: one SQL condition per column, which SQLite evaluates with the row.

A checksum detects changes of a row, but anybody can compute it: a file from elsewhere may contain anything under right
checksums. Therefore types and ranges are checked too, when rows are read, on import and by `verify`.
"""

from __future__ import annotations

from typing import NamedTuple

from kineme.library.storage.schema import COUNTED, LARGEST_ID, MAX_DOCUMENT, MAX_TEXT
from kineme.validation import MIN_SAMPLES

_LARGEST_REAL = "1.7976931348623157e308"


class Check(NamedTuple):
    """A SQL condition that is TRUE for valid values, its text for messages, and a cheaper part of it."""

    condition: str
    words: str
    quick: str = ""


def _whole(name: str, least: int = 1, most: int = LARGEST_ID) -> Check:
    limits = f"a whole number from {least}" if most == LARGEST_ID else f"a whole number from {least} to {most}"
    return Check(f"typeof({name}) = 'integer' AND {name} BETWEEN {least} AND {most}", limits)


def _real(name: str) -> Check:
    return Check(f"typeof({name}) = 'real' AND {name} BETWEEN -{_LARGEST_REAL} AND {_LARGEST_REAL}", "a finite number")


def _text(name: str, least: int = 0, most: int = MAX_TEXT) -> Check:
    size = f"length(CAST({name} AS BLOB))"
    kind = f"typeof({name}) = 'text'"
    return Check(f"{kind} AND {size} BETWEEN {least} AND {most}", f"text of {least} to {most} bytes", kind)


def _name(name: str) -> Check:
    text = _text(name, 1)
    return Check(f"{text.condition} AND instr({name}, char(0)) = 0", f"{text.words} without U+0000", text.quick)


def _bytes(name: str) -> Check:
    return Check(f"typeof({name}) = 'blob'", "bytes")


def _or_none(name: str, check: Check) -> Check:
    quick = f"({name} IS NULL OR {check.quick})" if check.quick else ""
    return Check(f"({name} IS NULL OR ({check.condition}))", f"{check.words}, or nothing", quick)


#: The versions from which and until which a row is alive.
_ADDED = {"added": _whole("added")}
_ALIVE = _ADDED | {
    "removed": Check(
        "(removed IS NULL OR (typeof(removed) = 'integer' AND removed >= added))", "no version before `added`"
    )
}

#: Table -> column -> the condition on its values.
CHECKS: dict[str, dict[str, Check]] = {
    "meta": {"key": _text("key", 1), "value": _text("value", 1, MAX_DOCUMENT)},
    "version": {
        "id": _whole("id"),
        "at": Check(
            "typeof(at) = 'text' AND at GLOB '[0-9][0-9][0-9][0-9]-[0-9]*' AND length(CAST(at AS BLOB)) < 40", "a time"
        ),
        "action": _text("action", 1, 64),
        "detail": _text("detail", 2, MAX_DOCUMENT),
        **{count: _whole(count, 0) for count in COUNTED.values()},
    },
    "source": {
        "id": _whole("id"),
        "path": _text("path"),
        "sha256": _text("sha256"),
        "size": _whole("size", 0),
        "read_at": _text("read_at"),
        "kind": _text("kind"),
        "options": _text("options", 2, MAX_DOCUMENT),
        **_ADDED,
    },
    "movement": {
        "id": _whole("id"),
        "source": _or_none("source", _whole("source")),
        "place": _or_none("place", _text("place")),
        "digest": Check("typeof(digest) = 'integer'", "a whole number"),
        "name": _or_none("name", _text("name")),
        "label": _or_none("label", _name("label")),
        "n_samples": _whole("n_samples", MIN_SAMPLES, 1 << 40),
        "t0": _real("t0"),
        "duration": Check(
            f"{_real('duration').condition} AND duration > 0 AND t0 + duration / (n_samples - 1) > t0 "
            f"AND t0 + duration - duration / (n_samples - 1) < t0 + duration AND t0 + duration <= {_LARGEST_REAL}",
            "a finite number above 0, in which its samples have time stamps of their own",
        ),
        **_ALIVE,
    },
    "raw": {
        "movement": _whole("movement"),
        "start": _bytes("start"),
        "positions": _bytes("positions"),
        "times": _or_none("times", _bytes("times")),
    },
    "primitive": {"movement": _whole("movement"), "boundary": _bytes("boundary"), "weights": _bytes("weights")},
    "feature": {"movement": _whole("movement"), "rows": _bytes("rows")},
    "symbol": {
        "key": _whole("key"),
        "id": Check(
            f"typeof(id) = 'text' AND length(CAST(id AS BLOB)) = 16 AND id GLOB 'sym-{'[0-9a-f]' * 12}'",
            "'sym-' and twelve hexadecimal digits",
        ),
        "created": _whole("created"),
    },
    "symbol_state": {
        "id": _whole("id"),
        "symbol": _whole("symbol"),
        "name": _name("name"),
        "description": _text("description", most=MAX_DOCUMENT),
        "prototype": _or_none("prototype", _whole("prototype")),
        "threshold": _or_none("threshold", _real("threshold")),
        "parents": _text("parents", 2, MAX_DOCUMENT),
        **_ALIVE,
    },
    "member": {
        "id": _whole("id"),
        "movement": _whole("movement"),
        "symbol": _whole("symbol"),
        "how": Check("how IN ('label', 'anchored', 'recognized')", "how a movement came to its symbol"),
        **_ALIVE,
    },
    "recorded": {"movement": _whole("movement"), "columns": _bytes("columns")},
    "shown_by": {"movement": _whole("movement"), "person": _name("person"), **_ADDED},
}

#: Table -> the condition that is checked whenever a row is read, and the one of import and `verify`.
GOOD = {
    table: f"({' AND '.join(one.quick or one.condition for one in checks.values())}) IS TRUE"
    for table, checks in CHECKS.items()
}
ALL_GOOD = {
    table: f"({' AND '.join(one.condition for one in checks.values())}) IS TRUE" for table, checks in CHECKS.items()
}
