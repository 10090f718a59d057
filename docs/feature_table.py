"""The table of features of docs/beside-others.md, from docs/features.toml."""

from __future__ import annotations

import tomllib

from make_tables import DOCS

OURS = "kineme"
Features = dict[str, dict[str, list[str]]]


def features() -> tuple[dict[str, str], Features]:
    """The version of each library that was looked at; feature -> library -> [answer, names that give it]."""
    rows = tomllib.loads((DOCS / "features.toml").read_text(encoding="utf-8"))
    return rows.pop("looked_at"), rows


def table() -> str:
    """A line for each feature, a column for each library; ours with the names that give it."""
    versions, rows = features()
    lines = [f"| | {OURS} | {' | '.join(versions)} |", "|---" * (len(versions) + 2) + "|"]
    for feature, cells in rows.items():
        others = " | ".join(cells.get(library, ["no"])[0] for library in versions)
        lines.append(f"| {feature} | {_ours(*cells[OURS])} | {others} |")
    return "\n".join(lines)


def sources() -> str:
    """For each other library, its version and where each answer of the table was found."""
    versions, rows = features()
    lines = []
    for library, version in versions.items():
        found = [
            f"{feature}: {', '.join(f'`{name}`' for name in cells[library][1:])}"
            for feature, cells in rows.items()
            if len(cells.get(library, ())) > 1
        ]
        lines.append(f"- {library} {version}. {'; '.join(found)}.")
    return "\n".join(lines)


def _ours(answer: str, *names: str) -> str:
    shown = ", ".join(f"`{name}`" if " " in name else f"`{name.removeprefix('kineme.')}`" for name in names)
    return shown if answer == "yes" else f"{answer}: {shown}" if names else answer
