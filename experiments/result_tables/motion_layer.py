"""Tables and sentences on sets of robot data in three pages of the guide, from the file of results."""

from __future__ import annotations

from typing import Any

from result_tables.measured import DOCS, rows

_COMMAND = "`python -m bench --only motion_layer`"
_FALSE, _SIGNALS = "false alarms among good ones", ", 14 channels at 50 Hz"  # parts of what was measured
AUDIT, LEROBOT, DISCOVER = (DOCS / "guide" / f"{name}.md" for name in ("audit", "lerobot", "discover"))


def tables() -> dict[Any, dict[str, str]]:
    """Page -> name of each table or sentence -> its text."""
    measured = _measured()
    return {
        AUDIT: {"bad episodes": _bad_episodes(measured)},
        LEROBOT: {"named episodes": _named(measured)},
        DISCOVER: {"discovered": _discovered(measured)},
    }


def _measured() -> dict[str, dict[str, Any]]:
    """What was measured -> its row; indented rows belong to the one above them."""
    measured: dict[str, dict[str, Any]] = {}
    above = ""
    for row in rows("motion_layer"):
        if row["what"].startswith("  "):
            measured[f"{above}: {row['what'].strip()}"] = row
        else:
            above = row["what"].partition(", 1,000 hours")[0]
            measured[above] = row
    return measured


def _share(row: dict[str, Any]) -> str:
    return f"{100 * row['ours']:.1f} %"


def _bad_episodes(measured: dict[str, dict[str, Any]]) -> str:
    lines = ["| | AUROC | found | good ones flagged |", "|---|---|---|---|"]
    for what in [what for what in measured if what.startswith("bad episodes, ") and ":" not in what]:
        title, found, false = what.partition(", ")[2], measured[f"{what}: found"], measured[f"{what}: {_FALSE}"]
        chance = _share(false)
        if stated := false["details"]["stated"]:
            low, high = false["details"]["interval"]
            title, chance = f"{title}, {100 * stated:g} % stated", f"{chance} ({100 * low:.1f} to {100 * high:.1f})"
        lines.append(f"| {title} | {measured[what]['ours']:.3f} | {_share(found)} | {chance} |")
    details = measured["bad episodes, kineme"]["details"]
    good = measured[f"bad episodes, kineme: {_FALSE}"]["details"]["good"]
    missed = [
        f"{fault.replace('_', ' ')}, {count}"
        for fault, count in details["found"].items()
        if len({*count.split(" of ")}) > 1
    ]
    part = "; ".join(missed) or "none"
    sentence = f"{good:,} episodes are good and {details['bad']} bad. Found in part: {part} ({_COMMAND})."
    return "\n".join([*lines, "", sentence])


def _named(measured: dict[str, dict[str, Any]]) -> str:
    (one_arm, two_arms), (one_boundary, two_boundaries) = (
        [measured[f"{arms}, 3 examples of each of 6 kinds: {what}"]["ours"] for arms in ("1 arm", "2 arms")]
        for what in ("named right", "boundaries within 0.25 s")
    )
    edges = [
        measured[f"{arms}, 3 examples of each of 6 kinds: starts and ends within their uncertainty"]
        for arms in ("1 arm", "2 arms")
    ]
    one_edge, two_edges = (edge["ours"] for edge in edges)
    cost = measured[f"kineme annotate{_SIGNALS}"]["ours"]
    memory = measured[f"kineme annotate{_SIGNALS}: memory"]["ours"]
    return (
        "Of simulated arms at work, three examples of each of six kinds, shown by other people, name\n"
        f"{100 * one_arm:.0f} of 100 movements of one arm right, of two arms {100 * two_arms:.0f}; boundaries are\n"
        f"found within 0.25 s with an F1 of {one_boundary:.3f} and {two_boundaries:.3f}; {100 * one_edge:.0f} and\n"
        f"{100 * two_edges:.0f} of 100 starts and ends are within their uncertainty. A thousand hours of\n"
        f"14 channels at 50 Hz take {cost:.1f} core-hours and {memory:.0f} MB ({_COMMAND})."
    )


def _discovered(measured: dict[str, dict[str, Any]]) -> str:
    what = "no example, one arm: boundaries within 0.25 s"
    row, agreement = measured[what], measured[f"{what}: agreement of kinds of true movements"]
    precision, recall = (row["details"][name] for name in ("precision", "recall"))
    kinds, names = agreement["details"]["kinds"], agreement["details"]["true_kinds"]
    cost = measured[f"kineme discover{_SIGNALS}"]["ours"]
    return (
        f"Boundaries are found within 0.25 s with an F1 of {row['ours']:.2f} (precision {precision:.2f}, recall\n"
        f"{recall:.2f}). Movements of {names} names are of {', '.join(map(str, kinds))} kinds in {len(kinds)} sets;\n"
        f"the adjusted Rand index of kinds with names is {agreement['ours']:.2f}. A thousand hours of 14 channels at\n"
        f"50 Hz take {cost:.1f} core-hours ({_COMMAND})."
    )
