"""What archives of 10^4 to 10^9 movements cost, for the page of the guide: measured where it was, by a line beyond."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from result_tables.measured import DOCS, rows

PAGE, NEAREST = DOCS / "guide" / "large-archives.md", DOCS / "guide" / "nearest.md"
_COUNTS = tuple(10**k for k in range(4, 10))
_DAY = 86_400.0  # s
_OF_A_DAY = ("inspect [core-s]", "learn [core-s]", "nearest of all, one [core-s]")


class Law(NamedTuple):
    """A line through what was measured."""

    measured: dict[int, float]
    offset: float
    slope: float  # for each movement

    @classmethod
    def through(cls, measured: dict[int, float]) -> Law:
        """Fit a line whose relative errors are smallest in the sum of their squares."""
        counts, values = (np.array([*each], dtype=float) for each in (measured, measured.values()))
        design = np.column_stack((np.ones_like(counts), counts)) / values[:, None]
        offset, slope = np.linalg.lstsq(design, np.ones_like(values))[0]
        return cls(measured, float(offset), float(slope))

    def at(self, count: int) -> float:
        """Return what was measured, or the line."""
        return self.measured.get(count, self.offset + self.slope * count)

    @property
    def residual(self) -> float:
        """The largest deviation of what was measured, as a share of the line."""
        return max(abs(value / (self.offset + self.slope * count) - 1.0) for count, value in self.measured.items())


def tables() -> dict[Path, dict[str, str]]:
    """Page -> name of each of its tables and sentences -> its text."""
    laws = _laws()
    heads = ["movements", *laws, "cores for a day of inspecting and learning"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for count in _COUNTS:
        cells = [_cell(law, count, name) for name, law in laws.items()]
        seconds = sum(laws[name].at(count) for name in _OF_A_DAY)
        lines.append(f"| {count:,} | {' | '.join(cells)} | {max(1, round(seconds / _DAY + 0.5)):,} |")
    largest = max(laws.values(), key=lambda law: law.residual)
    name = next(name for name, law in laws.items() if law is largest)
    sentence = (
        "*In italics: by the line through what was measured, not measured.* The largest deviation from a line is "
        f"{100 * largest.residual:.0f} % ({name}). Times are of processors (`python -m bench --only pieces million "
        "shards`)."
    )
    memory = max(row["ours"] for row in rows("pieces") if row["unit"] == "MB")
    more = next(row["ours"] for row in rows("pieces") if row["what"].startswith("  of all"))
    of_workers = (
        f"No process took more than {memory:.0f} MB, whatever the archive; two workers took {more:.2f} times the "
        "processor time of one, their start included."
    )
    costs = "\n".join([*lines, "", sentence, of_workers])
    return {PAGE: {"costs": costs}, NEAREST: {"search": _search()}}


#: Row of the table of searches -> what was measured, and whether it is a time.
_SEARCHES = {
    "one movement: processor": ("one, processor", True),
    "of it the first stage": ("one, of it the first stage, processor", True),
    "one movement: median until the answer": ("one, median, wall", True),
    "a stranger, the first stage: processor": ("one stranger, processor", True),
    "100 movements at once: processor": ("100 at once, processor", True),
    "until the answers": ("100 at once, wall", True),
    "movements compared in the first stage": ("movements compared in the first stage, one", False),
    "for a stranger": ("the same, a stranger", False),
}


def _search() -> str:
    """Return the table of what a search among movements in shards takes."""
    counts = sorted(_of_shards("one, processor"))
    lines = [f"| | {' | '.join(f'{count:,}' for count in counts)} |", "|---" * (len(counts) + 1) + "|"]
    for title, (what, is_time) in _SEARCHES.items():
        measured = _of_shards(what)
        cells = [_time(measured[count]) if is_time else f"{100 * measured[count]:.2g} %" for count in counts]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _time(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1.0 else f"{1000 * seconds:.0f} ms"


def _laws() -> dict[str, Law]:
    parts = rows("million")
    learned = {row["details"]["movements"]: row["ours"] for row in parts if "Put them into a library" in row["what"]}
    library = {row["details"]["movements"]: row["ours"] / 1000 for row in parts if row["what"].endswith("actions/")}
    shards = _of_shards("files, a movement")
    asked = _of_shards("one, processor")
    described = {f"{command} in parts [core-s]": _of_pieces(command) for command in ("features", "learn")}
    return {
        "inspect [core-s]": Law.through(_of_pieces("inspect")),
        **{name: Law.through(measured) for name, measured in described.items() if measured},
        "learn [core-s]": Law.through(learned),
        "library on disk [GB]": Law.through(library),
        "shards on disk [GB]": Law.through({count: count * value / 1e9 for count, value in shards.items()}),
        "nearest of all, one [core-s]": Law.through(asked),
    }


def _of_pieces(command: str) -> dict[int, float]:
    """Number of movements -> seconds of processors that a command over pieces of them took; empty if not measured."""
    own = [row for row in rows("pieces") if row["what"].startswith(f"{command} ") and row["details"].get("movements")]
    return {row["details"]["movements"]: row["ours"] for row in own}


def _of_shards(what: str) -> dict[int, float]:
    """Number of movements -> what was measured of their shards."""
    measured = {}
    for row in rows("shards"):
        count, _, name = row["what"].partition(": ")
        if name == what:
            measured[int(count.replace(",", ""))] = row["ours"]
    return measured


def _cell(law: Law, count: int, name: str) -> str:
    value = law.at(count)
    text = f"{value:,.0f}" if value >= 100 else f"{value:.2g}"
    return text if count in law.measured else f"*{text}*"
