"""One measured comparison, its line in the table and its place in the result file."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import asdict, dataclass, field
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import kineme

RESULTS = Path(__file__).parents[1] / "results"
_PACKAGES = (
    "numpy", "scipy", "scikit-learn", "numba", "movement-primitives", "pydmps", "dtaidistance", "dollarpy", "torch",
    "mp-pytorch",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A figure of ours, beside a peer's where there is one.

    `ratio` says how many times better or larger ours is, whichever the target speaks of; `target` is a bound on
    the ratio, or on our own figure where there is no peer: ``(">=", 1000.0)``. Without a target the row informs.
    """

    what: str
    unit: str
    ours: float
    peer: float | None = None
    peer_name: str = ""
    ratio: float | None = None
    target: tuple[str, float] | None = None
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def met(self) -> bool | None:
        """Whether the target is reached; None without a target."""
        if self.target is None:
            return None
        sign, bound = self.target
        value = self.ours if self.ratio is None else self.ratio
        return value >= bound if sign == ">=" else value <= bound


def table(rows: list[Row]) -> str:
    """The rows as aligned text."""
    lines = [("what", "ours", "peer", "", "ratio", "target", "met")]
    for row in rows:
        target = "" if row.target is None else f"{row.target[0]} {row.target[1]:g}"
        met = {None: "", True: "yes", False: "NO"}[row.met]
        error = f" ± {row.details['standard_error']:.2g}" if "standard_error" in row.details else ""
        ours = f"{_short(row.ours)}{error} {row.unit}"
        lines.append((row.what, ours, _short(row.peer), row.peer_name, _short(row.ratio), target, met))
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip() for line in lines)


def save(name: str, rows: list[Row], load: float) -> Path:
    """Write a subject's rows with everything needed to judge them."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    content = {
        "subject": name,
        "date": date.today().isoformat(),
        "machine": _machine(),
        "load_before": load,
        "versions": _versions(),
        "rows": [{**asdict(row), "met": row.met} for row in rows],
    }
    path.write_text(json.dumps(content, indent=1, default=float) + "\n", encoding="utf-8")
    return path


def _short(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _machine() -> dict[str, Any]:
    from threadpoolctl import threadpool_info

    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    blas = [
        {key: library[key] for key in ("internal_api", "version", "architecture", "num_threads") if key in library}
        for library in threadpool_info()
        if library["user_api"] == "blas"
    ]
    return {"cpu": model, "cores": cores, "system": platform.system(), "blas": blas}


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "kineme": kineme.__version__}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
