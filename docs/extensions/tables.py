"""Tables in Markdown, and what a JSON schema says of one value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

_BOUNDS = {
    "minimum": "at least {}", "maximum": "at most {}", "exclusiveMinimum": "above {}", "exclusiveMaximum": "below {}",
    "minItems": "{} or more", "maxItems": "at most {}", "maxLength": "at most {} characters",
}  # fmt: skip


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    """The lines of a table; a column without anything is left out."""
    filled = [k for k in range(len(head)) if any(row[k] for row in rows)]
    head, rows = tuple(head[k] for k in filled), [tuple(row[k] for k in filled) for row in rows]
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def kind(one: dict[str, Any], link: str = "{}") -> str:
    """What a value must be; `link` is how the name of another schema is written."""
    if "const" in one:
        return f"`{json.dumps(one['const'])}`"
    if "enum" in one:
        return " or ".join(f"`{json.dumps(value)}`" for value in one["enum"])
    if "$ref" in one:
        return link.format(one["$ref"].rpartition("/")[2])
    kinds = one.get("type") or " or ".join(kind(each, link) for each in one.get("oneOf", one.get("anyOf", [])))
    if kinds == "array" and isinstance(items := one.get("items"), dict):
        kinds = f"array of {_grouped(kind(items, link))}"
    elif kinds == "object" and isinstance(values := one.get("additionalProperties"), dict):
        kinds = f"object of {_grouped(kind(values, link))}"
    return " or ".join(kinds) if isinstance(kinds, list) else str(kinds)


def _grouped(kinds: str) -> str:
    return f"({kinds})" if " or " in kinds else kinds


def bounds(one: dict[str, Any]) -> str:
    """Limits of a value and what it is where nothing is said, as ``above 0; default 0.05``."""
    of = next((each for each in one.get("anyOf", []) if each.get("type") != "null"), one)
    said = [text.format(f"{of[key]:g}") for key, text in _BOUNDS.items() if key in of]
    if one.get("default") is not None:
        said.append(f"default `{json.dumps(one['default'])}`")
    return "; ".join(said)
