"""The table of features of docs/beside-others.md, from docs/features.toml."""

from __future__ import annotations

import tomllib

from kineme_experiments.evaluation.methods import OURS
from result_tables.measured import DOCS

Features = dict[str, dict[str, list[str]]]


def features() -> tuple[dict[str, str], Features]:
    """The version of each other library that was looked at; feature -> library -> [answer, names that give it]."""
    rows = tomllib.loads((DOCS / "features.toml").read_text(encoding="utf-8"))
    return rows.pop("looked_at"), rows


def table() -> str:
    """A line for each feature, a column for each library."""
    versions, rows = features()
    libraries = [OURS, *versions]
    lines = [f"| | {' | '.join(libraries)} |", "|---" * (len(libraries) + 1) + "|"]
    for feature, cells in rows.items():
        answers = " | ".join(cells.get(library, ["no"])[0] for library in libraries)
        lines.append(f"| {feature} | {answers} |")
    return "\n".join(lines)


def sources() -> str:
    """For each library, the names that give what the table says."""
    versions, rows = features()
    lines = []
    for library, version in {OURS: "", **versions}.items():
        found = [
            f"{feature}: {', '.join(f'`{name}`' for name in cells[library][1:])}"
            for feature, cells in rows.items()
            if len(cells.get(library, ())) > 1
        ]
        lines.append(f"- **{f'{library} {version}'.strip()}.** {'; '.join(found)}.")
    return "\n".join(lines)
