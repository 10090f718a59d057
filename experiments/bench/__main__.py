"""Measure, print a table, save the figures in experiments/results: ``python -m bench [--only NAME ...] [--quick]``."""

from __future__ import annotations

import argparse
import importlib
import os

from bench.rows import save, table

SUBJECTS = (
    "learn_even",
    "learn_ragged",
    "gram",
    "startup",
    "reconstruction",
    "dmp_defaults",
    "adapting",
    "rhythm",
    "control",
    "arms",
    "arm_timing",
    "execution",
    "modulation",
    "via_points",
    "joining",
    "recognize",
    "answers",
    "recognize_files",
    "stream",
    "sensors",
    "early",
    "monitor",
    "spotting",
    "by_others",
    "one_shot",
    "pauses",
    "open_set",
    "certainty",
    "outliers",
    "defaults",
    "library",
    "postgres",
    "million",
    "shards",
    "skills",
    "lerobot",
    "bags",
    "binning",
    "anchoring",
    "annotate",
    "motion_layer",
    "pieces",
    "operators",
    "tensors",
    "gpu",
    "exported",
    "page",
    "migrating",
    "studio",
    "studio_in_browser",
    "by_person",
    "strangers",
    "nested",
)


def main() -> int:
    """Run the subjects; the exit status says whether every target is met."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=SUBJECTS, default=SUBJECTS, metavar="NAME", help=str(SUBJECTS))
    parser.add_argument("--quick", action="store_true", help="small data, few repeats, saves nothing")
    arguments = parser.parse_args()
    missed = 0
    for name in arguments.only:
        load = os.getloadavg()[0]  # how busy others keep the machine; above half its cores, measure again later
        rows = importlib.import_module(f"bench.{name}").measure(arguments.quick)
        missed += sum(row.met is False for row in rows)
        print(f"\n{name}\n{table(rows)}", flush=True)
        if rows and not arguments.quick:
            save(name, rows, load)
    print(f"\n{missed} targets missed" if missed else "\nall targets met")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
