"""An audit in words, as data, and as what a training script takes: the episodes that are kept."""

from __future__ import annotations

import csv
import io
import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kineme.audit.checks import CHECKS
from kineme.audit.run import KINDS, Audit, Finding, Reason
from kineme.reporting.atomic import whole_file
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import as_cell, counted, printable

_SAID = 2  # reasons in the table
_SHOWN = 40  # episodes of the table; the rest is counted
_LONGEST_ARGUMENT = 2000  # letters of a list of episodes that is printed
_WHOLE = 0.98  # of an episode: a stretch that is longer is not said
#: Share of good episodes that are as unusual, below which there are none in sets of some hundred; and how many such
#: episodes, not flagged, say that the set hides them. Of clean simulated sets of 40 none had a share below 5e-4; with
#: a third of the episodes bad, 4 to 7 had.
_RARE, _HIDDEN = 1e-4, 2


def verdict(audit: Audit) -> str:
    """Return what to think of the set, in a few sentences."""
    n, kinds = len(audit.numbers), Counter(finding.kind for finding in audit.findings)
    hours = f"{counted(n, 'episode')} of {counted(audit.tasks, 'task')}, {audit.seconds / 3600:,.2f} hours"
    said = {
        "contradiction": ("contradicts what the set declares", "contradict what the set declares"),
        "outlying": ("lies far beyond the others", "lie far beyond the others"),
        "unusual": ("is the most unusual of the others", "are the most unusual of the others"),
    }
    parts = [counted(kinds[kind], *words) for kind, words in said.items() if kinds[kind]]
    if not audit.calibrated:
        needed = math.ceil(1 / audit.error_rate)
        listed = f": {parts[0]}" if parts else ""
        return (
            f"{hours}. {counted(int(audit.flagged.sum()), 'episode')} flagged{listed}. Uncalibrated: it takes "
            f"{needed} episodes without contradictions to state that {100 * audit.error_rate:.2g} % of the good ones "
            "are flagged; the others are ranked only."
        )
    stand_out = kinds["contradiction"] + kinds["outlying"]
    hidden = int(((np.exp(-audit.evidence) < _RARE) & ~audit.flagged).sum())
    advice = "See those first that contradict or lie beyond." if stand_out else "Nothing stands out."
    if hidden >= _HIDDEN:
        advice = (
            f"{hidden:,} more are as unusual as no good ones are, and are not flagged: more than a fifth of the set "
            "may be bad, so that its episodes vouch for each other. The picture of the page shows them."
        )
    return (
        f"{hours}. {audit.flagged.sum():,} flagged: {', '.join(parts) or 'none'}. At most "
        f"{100 * audit.error_rate:.2g} % of the good episodes are flagged by chance, here about {audit.by_chance:,}: a "
        f"set without any fault has them, too. {advice}"
    )


def stretch_of(reason: Reason, seconds: float) -> str:
    """Return the stretch of a reason in words; empty of a whole episode."""
    if reason.end - reason.start >= _WHOLE * seconds:
        return ""
    if reason.end - reason.start < 0.1:
        return f" at {reason.start:.2f} s"
    return f" from {reason.start:.2f} to {reason.end:.2f} s"


def reasons_of(finding: Finding) -> list[str]:
    """Return the reasons of a finding, each with its check and its stretch of time."""
    return [f"{reason.check}: {reason.words}{stretch_of(reason, finding.seconds)}" for reason in finding.reasons] or [
        "nothing by itself, but taken together"
    ]


def checks_table(audit: Audit) -> Table:
    """Return the checks that something is listed for: name, how many episodes, what it means, what to do."""
    counts = Counter(reason.check for finding in audit.findings for reason in finding.reasons[:1])
    rows = [
        (check.name, f"{counts[check.name]:,}", check.meaning, check.remedy) for check in CHECKS if counts[check.name]
    ]
    return Table("", ("first because of", "episodes", "what that means", "what to do"), rows)


def findings_table(findings: Sequence[Finding], n_reasons: int) -> Table:
    """Return a row for each finding, with the first ones of its reasons."""
    rows = [
        (
            f"{finding.episode}", finding.task or "", finding.kind, f"{finding.p_value:.2g}",
            "; ".join(reasons_of(finding)[:n_reasons]),
        )
        for finding in findings
    ]  # fmt: skip
    return Table("", ("episode", "task", "kind", "p-value", "because"), rows)


def audit_as_words(audit: Audit) -> str:
    """Return the verdict, the findings as a table, and what to do about them."""
    parts = [verdict(audit), *(f"of the whole set: {note}" for note in audit.of_the_set)]
    if audit.findings:
        table = to_text(findings_table(audit.findings[:_SHOWN], _SAID))
        more = len(audit.findings) - _SHOWN
        parts.append(f"{table}\nand {more:,} more" if more > 0 else table)
        parts.append(to_text(checks_table(audit)))
    return "\n\n".join(parts)


def audit_as_data(audit: Audit) -> dict[str, Any]:
    """Return nested lists and dictionaries, for JSON."""
    return {
        "episodes": len(audit.numbers), "tasks": audit.tasks, "seconds": audit.seconds,
        "error_rate": audit.error_rate, "calibrated": audit.calibrated, "by_chance": audit.by_chance,
        "flagged": int(audit.flagged.sum()), "verdict": verdict(audit), "of_the_set": list(audit.of_the_set),
        "kinds": KINDS,
        "checks": [{"name": check.name, "meaning": check.meaning, "remedy": check.remedy} for check in CHECKS],
        "findings": [
            _plain(finding)
            | {"reasons": [_plain(reason) | {"channel": reason.channel or None} for reason in finding.reasons]}
            for finding in audit.findings
        ],
    }  # fmt: skip


def _plain(record: Finding | Reason) -> dict[str, Any]:
    return record._asdict() | {"evidence": record.evidence if math.isfinite(record.evidence) else None}


def kept_episodes(audit: Audit) -> list[int]:
    """Return the numbers of the episodes that are not flagged, in rising order; of doubled ones, if neither is."""
    return np.setdiff1d(audit.numbers, audit.numbers[audit.flagged]).tolist()


def write_kept(path: Path, audit: Audit, *, replace: bool = False) -> Path:
    """Write which episodes to train on: as .json their numbers alone, else a CSV table with a row for each episode.

    Its columns are ``episode_index``, ``keep`` (1 or 0), ``p`` and ``reason``.
    """
    if path.suffix.lower() == ".json":
        text = json.dumps(kept_episodes(audit)) + "\n"
    else:
        reasons = {finding.episode: "; ".join(reasons_of(finding)) for finding in audit.findings}
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(("episode_index", "keep", "p", "reason"))
        for number, p_value, flagged in zip(audit.numbers, audit.p_values, audit.flagged, strict=True):
            reason = as_cell(printable(reasons.get(int(number), ""))) if flagged else ""
            writer.writerow((int(number), int(not flagged), f"{p_value:.6g}", reason))
        text = buffer.getvalue()
    with whole_file(path, replace=replace) as beside:
        beside.write_text(text, encoding="utf-8")
    return path


def lerobot_arguments(audit: Audit, path: Path | None = None) -> list[str]:
    """Return lines that say how LeRobot trains on the kept episodes alone."""
    numbers = json.dumps(kept_episodes(audit), separators=(",", ":"))
    if len(numbers) <= _LONGEST_ARGUMENT:
        return [
            f'lerobot-train --dataset.episodes "{numbers}" ...', f"LeRobotDataset(repo_id, episodes={numbers})",
        ]  # fmt: skip
    name = path if path is not None and path.suffix.lower() == ".json" else Path("keep.json")
    return [f'LeRobotDataset(repo_id, episodes=json.load(open("{name}")))', f"with --train-mask {name}"]
