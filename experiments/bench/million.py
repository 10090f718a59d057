"""The tutorial of a million movements, run as it stands, with more and more of them: time and memory of each part.

``python -m bench.million COUNT`` runs it once and prints what it took as JSON.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

from bench.rows import Row

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorials" / "a-million-movements.md"
COUNTS = (20_000, 200_000, 1_000_000)
_COUNT = "MOVEMENTS = 20_000"


def measure(quick: bool) -> list[Row]:
    rows = []
    for count in COUNTS[:1] if quick else COUNTS:
        command = [sys.executable, "-m", "bench.million", str(count)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT)
        took = json.loads(done.stdout)
        rows += [
            Row(f"{count:,}: {part}", "s", one.pop("processor"), details={"movements": count, "part": part, **one})
            for part, one in took["parts"].items()
        ]
        rows += [
            Row(f"{count:,}: {folder}/", "MB", size, details={"movements": count, "folder": folder})
            for folder, size in took["folders"].items()
        ]
    return rows


def run(count: int) -> dict[str, Any]:
    """Each part of the page that has code: processor and wall time [s], and the peak of memory [MB] while it ran."""
    sys.path.insert(0, str(ROOT / "docs"))
    from walk_through import walk

    names: dict[str, Any] = {}
    took = {}
    with TemporaryDirectory() as place:
        folder, part = Path(place) / "page", Path(place) / "part.md"
        folder.mkdir()
        for heading, text in parts(count):
            part.write_text(text, encoding="utf-8")
            _forget_peak()
            begin, processor = perf_counter(), process_time()
            printed = [line for step in walk(part, folder, names) for line in step.answer]
            if "```python" in text:
                took[heading] = {
                    "processor": process_time() - processor,
                    "wall": perf_counter() - begin,
                    "megabytes": _peak(),
                    "printed": printed,
                }
        names["library"].close()
        folders = {one.name: sum(file.stat().st_size for file in one.iterdir()) / 1e6 for one in folder.iterdir()}
    return {"parts": took, "folders": folders}


def parts(count: int) -> list[tuple[str, str]]:
    """Heading and text of each part, with that many movements."""
    page = PAGE.read_text(encoding="utf-8")
    if page.count(_COUNT) != 1:
        raise ValueError(f"expected {_COUNT!r} once in {PAGE}")
    pieces = re.split(r"^## (.+)\n", page.replace(_COUNT, f"MOVEMENTS = {count}"), flags=re.MULTILINE)
    return list(zip(pieces[1::2], pieces[2::2], strict=True))


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> float:
    """Peak of resident memory since it was forgotten [MB]."""
    return float(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) / 1024


if __name__ == "__main__":
    print(json.dumps(run(int(sys.argv[1]))))
