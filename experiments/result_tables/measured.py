"""What was measured, for the pages: files of results, tables of them, and the places of these in pages."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from kineme_experiments.evaluation.methods import METHODS

RESULTS = Path(__file__).parents[1] / "results"
DOCS = Path(__file__).parents[2] / "docs"
#: $P is left out: $P+ is ahead of it, or level with it, in every row that is shown.
SHOWN = [name for name in METHODS if name != "point-cloud"]
#: What a row says, then protocol, condition and measure of its values.
Asked = list[tuple[str, str, str, str]]


def content(name: str) -> dict[str, Any]:
    """All that a file of results holds."""
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return found


def rows(name: str) -> list[dict[str, Any]]:
    """What a subject of the benchmark measured."""
    found: list[dict[str, Any]] = content(name)["rows"]
    return found


def figures(name: str) -> dict[str, float]:
    """What a subject of the benchmark measured -> our figure."""
    return {row["what"]: row["ours"] for row in rows(name)}


def protocols(name: str) -> dict[str, Any]:
    """What an evaluation measured: protocol -> method -> condition -> measure -> statistics."""
    found: dict[str, Any] = content(f"evaluation-{name}")["protocols"]
    return found


def means(evaluated: dict[str, Any], protocol: str, condition: str, measure: str) -> dict[str, float]:
    """Method -> its mean to three digits, of the methods that the pages show."""
    found = {name: by.get(condition, {}).get(measure, {}).get("mean") for name, by in evaluated[protocol].items()}
    return {name: round(value, 3) for name, value in found.items() if value is not None and name in SHOWN}


def table(head: str, evaluated: dict[str, Any], asked: Asked) -> str:
    """A line for each of `asked`, a column for each method; the best of a line in bold."""
    methods = [name for name in SHOWN if any(name in by_method for by_method in evaluated.values())]
    lines = [f"| {head} | {' | '.join(METHODS[name].title for name in methods)} |", "|---" * (len(methods) + 1) + "|"]
    for text, *what in asked:
        values = means(evaluated, *what)
        best = max(values.values())
        cells = [_cell(values[name], best) if name in values else "-" for name in methods]
        lines.append(f"| {text} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(value: float, best: float) -> str:
    return f"**{value:.3f}**" if value == best else f"{value:.3f}"


def filled(page: str, texts: dict[str, str]) -> str:
    """The page with every text between its marks; `KeyError` names one that the page has no place for."""
    for name, text in texts.items():
        marks = re.compile(rf"(<!-- table: {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not marks.search(page):
            raise KeyError(name)
        page = marks.sub(lambda found, text=text: f"{found[1]}{text}\n{found[2]}", page)
    return page


def fill(page: Path, texts: dict[str, str]) -> None:
    """Write the texts into the page."""
    page.write_text(filled(page.read_text(encoding="utf-8"), texts), encoding="utf-8")
    print(page)
