"""What an exported primitive takes, in its page, from the file of results."""

from __future__ import annotations

from typing import Any

from result_tables.measured import DOCS, rows

PAGE = DOCS / "how-to" / "microcontroller.md"


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    return {"header": _header(), "model": _model()}


def _header() -> str:
    lines = ["| processor, compiler | numbers | code and tables | state | a step of 1 ms |", "|---|---|---|---|---|"]
    targets: dict[str, dict[str, Any]] = {}
    for row in rows("exported"):
        target, _, what = row["what"].partition(": ")
        targets.setdefault(target, {})[what] = row
    for target, measured in targets.items():
        if "state" in measured:
            processor, flag, numbers = target.split(", ")
            size, state = measured["code and tables"], measured["state"]
            step = f"{measured['a step']['ours'] / 1000:.2f} µs" if "a step" in measured else "not measured"
            compiler = f"{processor}, {size['details']['compiler']} `{flag}`"
            lines.append(f"| {compiler} | {numbers} | {size['ours']:.1f} kB | {state['ours']} bytes | {step} |")
    return "\n".join(lines)


def _model() -> str:
    size, time = (row["ours"] for row in rows("exported") if row["what"].startswith("ONNX"))
    return f"Three dimensions of 40 functions and 200 samples take {size:.0f} kB, and a movement {time:.0f} µs."
