"""The motion layer of robot data on simulated arms at work: names, boundaries, bad episodes, and what they cost.

Examples come from other operators than those who are tested. Sets with planted faults have one in seven episodes, one
fault each. The rivals of the audit are rules written anew from descriptions, see `bench.work_rivals`. The programs
themselves, run once on a hundred episodes with 28 faults (seed 100): robot-data-audit 0.11.0 excluded 2 of the 28 and
no good one, and its count of jumps has an AUROC of .63; lerobot-doctor 0.2.0 listed 5 of the 28, would drop 2 others by
its score, and no good one; the score has .55. The rules written anew list the same episodes of that set. Values are
chosen on seeds from 100 on; those that are reported begin at 200.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.rows import Row
from bench.work_faults import FAULTS, plant
from bench.work_rivals import RIVALS, Verdicts
from bench.work_scores import Segment, auroc, edges_within, rate, score_boundaries, score_names
from bench.work_sets import FPS, KINDS, examples, work_episodes, write_labels, write_set
from kineme.movements.episodes import Episode

_TAUGHT, _TESTED = (10, 11, 12), (0, 1, 2, 3)  # operators
_SHOTS, _STATED = 3, 0.05
_SHARE = 1.0 / 7.0  # of the episodes, that have a fault
_CHOOSING, _REPORTING = 100, 200  # first seeds
_THOUSAND = 1_000.0  # hours


class Cost(NamedTuple):
    """What a command took."""

    seconds: float  # of processors
    memory: float  # at most [MB]


def measure(quick: bool) -> list[Row]:
    seed, sets = (_CHOOSING, 1) if quick else (_REPORTING, 3)
    rows: list[Row] = []
    for arms in (1, 2):
        rows += _named(arms, seed, sets, 10 if quick else 20)
    rows += _named(1, seed, sets, 10 if quick else 20, steps=True)
    rows += _discovered(seed, sets, 10 if quick else 20)
    rows += _audited(seed, sets, 60 if quick else 200)
    return [*rows, *_costs(seed, (20, 40) if quick else (33, 132))]


def _named(arms: int, first_seed: int, sets: int, count: int, steps: bool = False) -> Iterator[Row]:
    """Names and boundaries of ``kineme annotate`` from three examples of each kind, and how sure these are."""
    truth: list[Sequence[Segment]] = []
    found: list[Sequence[Segment]] = []
    doubts: list[list[float]] = []
    for seed in range(first_seed, first_seed + sets):
        works = list(work_episodes(count, seed, _TESTED, arms, steps=steps))
        with tempfile.TemporaryDirectory() as name:
            library = _taught(Path(name), seed, arms, steps)
            write_set(Path(name) / "set", (work.episode for work in works))
            _run("annotate", Path(name) / "set", "--library", library, "-o", Path(name) / "labels.csv")
            found += annotated(Path(name) / "labels.csv", count)
            doubts += uncertainties(Path(name) / "labels.csv", count)
        truth += [work.truth for work in works]
    names, boundaries = score_names(truth, found), score_boundaries(truth, found)
    gripper = " whose gripper is 0 or 1" if steps else ""
    what = f"{arms} arm{'s' if arms == 2 else ''}{gripper}, {_SHOTS} examples of each of 6 kinds"
    details: dict[str, Any] = {
        "sets": sets, "episodes": len(truth), "movements": names.true, "first_seed": first_seed,
        "confused": {f"{true} -> {given}": n for (true, given), n in names.confused.most_common() if true != given},
        "half_of_the_union_shared": names.matched / names.true, "right_of_these": names.matched_right / names.matched,
    }  # fmt: skip
    yield Row(f"{what}: named right", "of 1", names.accuracy, target=(">=", 0.9), details=details)
    details = {"precision": boundaries.hits / boundaries.found, "recall": boundaries.hits / boundaries.true}
    yield Row(f"{what}: boundaries within 0.25 s", "F1", boundaries.f1, target=(">=", 0.85), details=details)
    share, low, high = rate(*edges_within(truth, found, doubts))
    seconds = np.quantile(np.concatenate(doubts), (0.05, 0.5, 0.95)).tolist()
    details = {"interval": (low, high), "uncertainty_5_50_95_percent": seconds, "stated": 0.95}
    yield Row(f"{what}: starts and ends within their uncertainty", "of 1", share, details=details)


def _taught(folder: Path, seed: int, arms: int, steps: bool = False) -> Path:
    """Learn examples by other operators into a library."""
    works = list(work_episodes(30, seed + 5000, _TAUGHT, arms, steps=steps))
    write_set(folder / "taught", (work.episode for work in works))
    write_labels(folder / "taught.csv", examples(works, _SHOTS, seed))
    _run("learn", folder / "taught", "--labels", folder / "taught.csv", "--library", folder / "library")
    return folder / "library"


def _discovered(first_seed: int, sets: int, count: int) -> Iterator[Row]:
    """Kinds that ``kineme discover`` finds without any example, beside the true ones."""
    from sklearn.metrics import adjusted_rand_score

    truth: list[Sequence[Segment]] = []
    found: list[Sequence[Segment]] = []
    agreement, kinds = [], []
    for seed in range(first_seed, first_seed + sets):
        works = list(work_episodes(count, seed, _TESTED))
        with tempfile.TemporaryDirectory() as name:
            write_set(Path(name) / "set", (work.episode for work in works))
            _run("discover", Path(name) / "set", "-o", Path(name) / "labels.csv")
            segments = annotated(Path(name) / "labels.csv", count)
        confused = score_names([work.truth for work in works], segments).confused
        pairs = list(confused.elements())
        agreement.append(adjusted_rand_score([true for true, _ in pairs], [given for _, given in pairs]))
        kinds.append(len({given for _, given in pairs} - {"unknown", "missed"}))
        found += segments
        truth += [work.truth for work in works]
    boundaries = score_boundaries(truth, found)
    details = {"precision": boundaries.hits / boundaries.found, "recall": boundaries.hits / boundaries.true}
    yield Row("no example, one arm: boundaries within 0.25 s", "F1", boundaries.f1, details=details)
    details = {"of_each_set": agreement, "kinds": kinds, "true_kinds": len(KINDS)}
    yield Row(
        "  agreement of kinds of true movements", "adjusted Rand index", float(np.mean(agreement)), details=details
    )


def annotated(table: Path, count: int) -> list[list[Segment]]:
    """Read what ``kineme annotate`` wrote: the segments of each episode."""
    segments: list[list[Segment]] = [[] for _ in range(count)]
    for row in _table(table):
        name = None if row["symbol"] in {"", "unknown"} else row["symbol"]
        segments[int(row["place"].split()[-1])].append((float(row["start"]), float(row["end"]), name))
    return segments


def uncertainties(table: Path, count: int) -> list[list[float]]:
    """Read the uncertainties [s] of the segments of each episode."""
    doubts: list[list[float]] = [[] for _ in range(count)]
    for row in _table(table):
        doubts[int(row["place"].split()[-1])].append(float(row["uncertainty"]))
    return doubts


def _table(table: Path) -> list[dict[str, str]]:
    with table.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _audited(first_seed: int, sets: int, count: int) -> Iterator[Row]:
    """Bad episodes found by the audit and by the rules of others, on the same sets: clean ones, and with faults."""
    from kineme.audit.run import audit_episodes

    def ours(episodes: Sequence[Episode]) -> Verdicts:
        audit = audit_episodes(iter(episodes), _STATED)
        return Verdicts(np.where(audit.p_values == 0.0, np.inf, audit.evidence), audit.flagged)

    verdicts: dict[str, list[Verdicts]] = {name: [] for name in ("kineme", *RIVALS)}
    faults: list[list[str | None]] = []
    for seed in range(first_seed, first_seed + sets):
        works = list(work_episodes(count, seed, _TESTED))
        for share in (0.0, _SHARE):
            planted = list(plant(works, share, seed))
            faults.append([row.fault for row in planted])
            for name, rule in {"kineme": ours, **RIVALS}.items():
                verdicts[name].append(rule([row.episode for row in planted]))
    for name, of_sets in verdicts.items():
        yield from _of_audit(name, of_sets, faults)


def _of_audit(name: str, verdicts: list[Verdicts], faults: list[list[str | None]]) -> Iterator[Row]:
    """Rows of one audit, over sets of episodes that have a fault or none."""
    ours, flagged = name == "kineme", np.concatenate([verdict.flagged for verdict in verdicts])
    planted = [fault for of_set in faults for fault in of_set]
    bad = np.array([fault is not None for fault in planted])
    areas = [
        auroc(verdict.scores, [fault is not None for fault in of_set])
        for verdict, of_set in zip(verdicts, faults, strict=True)
        if any(of_set)
    ]
    false, low, high = rate(int(flagged[~bad].sum()), int((~bad).sum()))
    found = Counter(fault for fault, flag in zip(planted, flagged, strict=True) if flag)
    each = {fault: f"{found[fault]} of {planted.count(fault)}" for fault in FAULTS}
    details = {"found": each, "bad": int(bad.sum()), "of_each_set": areas}
    target = (">=", 0.95) if ours else None
    yield Row(f"bad episodes, {name}", "AUROC", float(np.mean(areas)), target=target, details=details)
    yield Row("  found", "of 1", float(flagged[bad].mean()))
    details = {"interval": (low, high), "good": int((~bad).sum()), "stated": _STATED if ours else None}
    yield Row(
        "  false alarms among good ones", "of 1", false, target=("<=", _STATED) if ours else None, details=details
    )


def _costs(seed: int, sizes: tuple[int, int]) -> Iterator[Row]:
    """Processor time and memory for sets of two sizes, and what a thousand hours take by the line through both."""
    costs: dict[str, list[tuple[float, Cost]]] = {}
    for count in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            library, frames = _taught(folder, seed, 2), 0

            def counted() -> Iterator[Any]:
                nonlocal frames
                for work in work_episodes(count, seed, _TESTED, 2):  # noqa: B023 - used within this round
                    frames += len(work.episode)
                    yield work.episode

            write_set(folder / "set", counted())
            commands = {
                "annotate": ("annotate", folder / "set", "--library", library, "-o", folder / "labels.csv"),
                "audit": ("audit", folder / "set", "--json"),
                "discover": ("discover", folder / "set", "--library", folder / "found", "--json"),
            }
            hours = frames / FPS / 3600.0
            for command, words in commands.items():
                costs.setdefault(command, []).append((hours, _run(*words)))
    total = 0.0
    for command, ((few, small), (many, large)) in costs.items():
        slope = (large.seconds - small.seconds) / (many - few)
        law = {"hours": (few, many), "core_seconds": (small.seconds, large.seconds), "core_seconds_per_hour": slope}
        total += slope * _THOUSAND / 3600.0
        what = f"kineme {command}, 14 channels at 50 Hz, 1,000 hours by the line through {few:.2f} and {many:.2f} h"
        yield Row(what, "core-hours", slope * _THOUSAND / 3600.0, details=law)
        yield Row("  memory", "MB", large.memory, target=("<=", 2048.0), details={"of_the_smaller_set": small.memory})
    yield Row("all of these, 1,000 hours", "core-hours", total, target=("<=", 20.0))


def _run(*words: object) -> Cost:
    """Run a command of kineme in a process of its own."""
    process = subprocess.Popen([sys.executable, "-m", "kineme", *map(str, words)], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"expected kineme {words[0]} to answer, got exit status {process.returncode}")
    return Cost(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0)
