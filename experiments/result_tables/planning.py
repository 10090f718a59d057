"""Tables and sentences on operators, executions and monitors in their pages, from the files of results."""

from __future__ import annotations

from typing import Any

from result_tables.measured import DOCS, figures, rows

MONITOR, PLANNER, ROBOTS = (
    DOCS / f"{name}.md" for name in ("how-to/monitor", "how-to/planner", "guide/robots-simulated")
)
#: Set and movements of the benchmark -> what they are called on the page.
_MOVEMENTS = {
    "letters2d, same person": "letters, others by the same hand",
    "letters2d, robot": "letters, by a robot at another goal",
    "strokes2d, same person": "strokes, others by the same person",
    "strokes2d, robot": "strokes, by a robot at another goal",
    "digits, same person": "digits in the air, others by the same person",
    "digits, robot": "digits in the air, by a robot at another goal",
    "strokes2d, others": "strokes, by other people",
    "digits, others": "digits in the air, by other people",
    "solids, others": "solids in the air, by other people",
    "signs2d, others": "signs, demonstrations left out",
    "multistrokes2d, others": "symbols of several strokes, by other people",
}
_DISTURBED = ("false alarms", "pushed", "another goal", "another symbol", "stopped")


def tables() -> dict[Any, dict[str, str]]:
    """Page -> name of each table or sentence -> its text."""
    return {
        MONITOR: {"noticed": _noticed(), "monitor said": _monitor_said()},
        PLANNER: {"operators": _operators()},
        ROBOTS: {"executions": _executions()},
    }


def _noticed() -> str:
    measured = {row["what"]: row for row in rows("monitor")}
    lines = [
        "| movements | false alarms | pushed | another goal | another symbol | stopped, noticed at the end |",
        "|---|---|---|---|---|---|",
    ]
    for what, name in _MOVEMENTS.items():
        cells = [measured[f"{what}, {each}"] for each in _DISTURBED]
        mark = "*" if any(cell["details"].get("role") == "chosen on" for cell in cells) else ""
        shares = " | ".join(f"{cell['ours']:.2f}" for cell in cells)
        lines.append(f"| {name}{mark} | {shares} |")
    return "\n".join([*lines, "", "\\* What the method has to choose was chosen on these: they are no proof."])


def _monitor_said() -> str:
    measured = figures("monitor")
    alarms = measured["all sets, others, false alarms"]
    updates = sorted(measured[f"an update in space, {n} samples a movement, mean"] for n in (100, 1000))
    return (
        f"At a stated rate of 5 %, {100 * alarms:.1f} % of the movements of other people are false alarms, over all "
        f"sets, not in each. An update in space takes {updates[0]:.0f} to {updates[1]:.0f} µs."
    )


def _operators() -> str:
    solved = [
        (row["what"].partition(" sessions")[0], row["ours"])
        for row in rows("operators")
        if row["what"].endswith("problems solved")
    ]
    counts, shares = (" / ".join(texts) for texts in zip(*((n, f"{ours:.2f}") for n, ours in solved), strict=True))
    outside = max(row["ours"] for row in rows("operators") if row["what"].endswith("outside what was shown"))
    return (
        f"In 100 generated worlds with known operators, {shares} of the problems that were not shown are solved after "
        f"{counts} sessions of twelve movements, with noise in positions and 1 % of the flags misread; "
        f"{100 * outside:.0f} % of the plans leave what was shown (`python -m bench --only operators`). "
        "More is shown, more is solved."
    )


def _executions() -> str:
    measured = {row["what"]: row for row in rows("execution")}
    tenth = measured["runs that reach their goal, or say what is gone; a tenth of the steps disturbed"]["details"]
    noticed = measured["movements that stop before they are half over, disturbed in their first third"]["ours"]
    reached, said = tenth["reached"], tenth.get("gone, and said", 0)
    runs = reached + said + tenth.get("not reached", 0)
    return (
        f"With a tenth of the movements disturbed, {reached} of {runs} runs reach their goal, and {said} say which "
        f"object is gone; {100 * noticed:.0f} % of the movements that are disturbed in their first "
        "third stop before they are half over (`python -m bench --only execution`)."
    )
