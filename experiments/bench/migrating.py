"""The pages of docs/migrating: the peers' code on them is executed beside ours, and the results are compared."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bench.rows import Row

DOCS = Path(__file__).parents[2] / "docs"
PAGES = DOCS / "migrating"


#: Both peers' rollouts are one step ahead of their stamps.
AHEAD = 1


def _paths(names: dict[str, Any]) -> tuple[float, list[Any]]:
    """Largest distance of two paths, in % of the extent; the peer's path at 20 times, each with our index."""
    ours, theirs = names["ours"], names["theirs"]
    n = min(len(ours) - AHEAD, len(theirs))
    apart = np.linalg.norm(ours[AHEAD : AHEAD + n] - theirs[:n], axis=1).max()
    picked = np.linspace(0, n - 1, 20).astype(int)
    return 100 * float(apart / np.ptp(ours, axis=0).max()), [[int(k) + AHEAD, *theirs[k].tolist()] for k in picked]


def _names(names: dict[str, Any]) -> tuple[float, list[Any]]:
    """Share of movements that both call the same, in %; what the peer calls them."""
    same = [one == other for one, other in zip(names["ours"], names["theirs"], strict=True)]
    return 100 * float(np.mean(same)), [str(name) for name in names["theirs"]]


_DISTANCE = ("largest distance of the paths", "% of the extent", ("<=", 1.0))
#: Page -> module of the peer, how the two are compared, what is measured, its unit and target.
COMPARED: dict[str, tuple[str, Callable[[dict[str, Any]], tuple[float, list[Any]]], str, str, tuple[str, float]]] = {
    "movement_primitives": ("movement_primitives", _paths, *_DISTANCE),
    "pydmps": ("pydmps", _paths, *_DISTANCE),
    "mp_pytorch": ("mp_pytorch", _paths, *_DISTANCE),
    "dollar": ("dollarpy", _names, "movements that are called the same", "%", (">=", 100.0)),
}


def measure(_quick: bool) -> list[Row]:
    """A row for each page whose peer is installed."""
    rows = []
    for page, (module, compare, what, unit, target) in COMPARED.items():
        if find_spec(module) is None:
            print(f"{module} is not installed: docs/migrating/{page}.md is left out", file=sys.stderr)
            continue
        value, theirs = compare(executed(page))
        rows.append(Row(f"{page}: {what}", unit, value, target=target, details={"page": page, "theirs": theirs}))
    return rows


def executed(page: str) -> dict[str, Any]:
    """What the Python of a page defines, the peer's code included; every number shown must be what is printed."""
    sys.path.insert(0, str(DOCS))
    from walk_through import otherwise, walk

    names: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / f"{page}.md"
        text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
        whole.write_text(text.replace("```{code-block} python\n", "```python\n"), encoding="utf-8")
        for step in walk(whole, Path(folder), names):
            if (answer := otherwise(step)) is not None:
                raise SystemExit(f"{page}.md shows {step.shown}, and this prints {answer!r}:\n{step.source}")
    return names
