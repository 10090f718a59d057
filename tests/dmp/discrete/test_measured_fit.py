"""The default fit is what ``python -m bench --only dmp_defaults`` chooses; docs/guide/moving-again.md shows why."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import kineme

ROOT = Path(__file__).parents[3]
MEASURED = {
    row["what"]: row["ours"]
    for row in json.loads((ROOT / "experiments" / "results" / "dmp_defaults.json").read_text(encoding="utf-8"))["rows"]
}
SHOWN = {
    "forcing, 80": "forcing, 80, the paper's",
    "forcing by ridge, 80": "forcing, 80, by ridge",
    "trajectory, 20": "trajectory, 20",
    "trajectory, 30": "trajectory, 30",
    "trajectory, 40": "**trajectory, 40**",
    "trajectory, 60": "trajectory, 60",
    "trajectory, 80": "trajectory, 80",
}


@pytest.fixture(scope="module")
def bench():
    from bench import dmp_defaults

    return dmp_defaults


def _table(bench):
    lines = ["| fit, n_basis | as recorded | 0.3 % noise | 1 % noise, uneven | acceleration | 1-NN |", f"|{'---|' * 6}"]
    for candidate, name in SHOWN.items():
        at = {
            (sensor, what): MEASURED[f"reported on: {candidate}; {sensor}; {what}"]
            for sensor in bench.SENSORS
            for what in bench.UNITS
        }
        errors = [f"{at[one, 'error, mean']:.2f} / {at[one, 'error, worst']:.2f}" for one in bench.SENSORS]
        _, some, much = bench.SENSORS
        hardest = " / ".join(f"{at[one, 'acceleration to new goals']:.1f}" for one in (some, much))
        right = " / ".join(f"{at[one, '1-NN']:.3f}" for one in (some, much))
        lines.append(f"| {name} | {' | '.join([*errors, hardest, right])} |")
    return "\n".join(lines) + "\n"


def test_the_default_is_the_one_chosen(bench):
    assert bench.CANDIDATES[bench.chosen(MEASURED)] == kineme.DMP()


def test_the_page_shows_what_was_measured(bench):
    assert _table(bench) in (ROOT / "docs" / "guide" / "moving-again.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["trajectory, 40", "forcing, 80"])
def test_numbers_of_it_measured_again(bench, name):
    demos = bench.halves(kineme.load_lasa())["reported on"]
    for what, value in bench.figures(bench.CANDIDATES[name], demos, bench.SENSORS[bench.NOISY]).items():
        assert value == pytest.approx(MEASURED[f"reported on: {name}; {bench.NOISY}; {what}"], rel=0.01), what


def test_noise_does_less_to_the_default_than_to_the_papers_fit():
    for sensor in ("as recorded", "0.3 % noise", "1 % noise, uneven stamps"):
        for half in ("chosen on", "reported on"):
            ours, papers = (f"{half}: {name}; {sensor}; " for name in ("trajectory, 40", "forcing, 80"))
            for what in ("error, mean", "error, worst"):
                assert MEASURED[ours + what] < 0.6 * MEASURED[papers + what]
            if sensor != "as recorded":
                assert (
                    MEASURED[ours + "acceleration to new goals"] < MEASURED[papers + "acceleration to new goals"] / 1.6
                )
                assert MEASURED[ours + "1-NN"] >= MEASURED[papers + "1-NN"]
