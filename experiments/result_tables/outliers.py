"""Table and sentences on wrong labels of docs/guide/outliers.md, from the file of results."""

from __future__ import annotations

import math

from result_tables.measured import DOCS, rows

PAGE = DOCS / "guide" / "outliers.md"
_SETS = ("20 labels of 50", "10 labels of 50", "2 labels of 50", "10 labels of 10", "3 labels of 10")


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    return {"wrong labels": _wrong_labels(), "foreign movements": _foreign_movements()}


def _measured() -> dict[str, float]:
    """What was measured -> its value; indented rows belong to the one above them."""
    found: dict[str, float] = {}
    above = ""
    for row in rows("outliers"):
        if row["what"].startswith("  "):
            found[f"{above}: {row['what'].strip()}"] = row["ours"]
        else:
            above = row["what"].partition(": ")[0]
            found[row["what"]] = row["ours"]
    return found


def _wrong_labels() -> str:
    found = _measured()
    lines = [
        "| movements | wrong labels found: 2 % wrong | 10 % wrong | false among those listed "
        "| a set without wrong labels lists any |",
        "|---|---|---|---|---|",
    ]
    for name in _SETS:
        right = [found[f"{name}, {share} % wrong: found"] for share in (2, 10)]
        false = max(found[f"{name}, {share} % wrong: false among what is found"] for share in (2, 10))
        none = found[f"{name}, 0 % wrong: false among what is found"]
        lines.append(f"| {name} | {' | '.join(map(_percent, (*right, false, none)))} |")
    return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{math.floor(100 * share + 0.5)} %"


def _foreign_movements() -> str:
    found = _measured()

    def of(what: str) -> str:
        right, false = (_percent(found[f"{what}: {part}"]) for part in ("found", "false among what is found"))
        return f"{right} are found ({false} false)"

    seconds = found["1,000,000 frames, 14 channels"]
    return (
        f"Of movements of an action that has no label, {of('10 labels of 50, 20 movements of none of them')}\n"
        "among 10 labels of 50; of two foreign movements among 50 of the only label,\n"
        f"{of('1 label of 50, 2 movements of another class')}. A million frames of 14 channels take\n"
        f"{seconds:.0f} s of processor time (`python -m bench --only outliers`)."
    )
