"""Table and sentences of docs/guide/modulation.md, from the files of results."""

from __future__ import annotations

from result_tables.measured import DOCS, figures, rows

PAGE = DOCS / "guide" / "modulation.md"
#: What is likely, in the rows of the results -> how the page says it.
PRIORS = {
    "smooth": "smooth in acceleration",
    "small weights": 'small weights, the ridge of `fit="forcing"`',
    "weights without curvature": 'weights without curvature, the ridge of `fit="trajectory"`',
    "cost of the fit": "what costs the fit least",
}
COLUMNS = ("1", "3", "5", "3, gated")


def tables() -> dict[str, str]:
    """Name of each table or sentence -> its text."""
    return {
        "noisy stretch": _noisy_stretch(),
        "through points": _through_points(),
        "priors": _priors(),
        "joined": _joined(),
        "coupled": _coupled(),
    }


def _noisy_stretch() -> str:
    found = figures("via_points")
    closely, ours = (
        found[f"led away by a noisy stretch, {how}"] for how in ("met as closely as possible", "as rollout does")
    )
    return (
        "Through 20 points with noise of 1 % of the extent, met as closely as possible, a path swings out by\n"
        f"{closely:.0f} times its extent; `rollout` leads it away by {100 * ours:.0f} % of it. Both are medians over\n"
        "the shapes of LASA (`python -m bench --only via_points`)."
    )


def _through_points() -> str:
    plain = rows("via_points")[0]
    shapes, pairs = (plain["details"][name] for name in ("shapes", "pairs"))
    return (
        f"Measured on the {shapes} sets of LASA, four of which mix several shapes: a demonstration goes to the start\n"
        "and the goal of another one of its set, through one, three or five points of it at even times,\n"
        f"in {pairs:,} pairs. The table holds the mean distance to the other in % of its extent; without points it is\n"
        f"{plain['ours']:.1f} % (`python -m bench --only via_points`)."
    )


def _priors() -> str:
    found = figures("via_points")
    lines = [
        '| change that is likely | 1 point | 3 points | 5 points | 3 points, `gating="phase"` |',
        "|---|---|---|---|---|",
    ]
    for prior, text in PRIORS.items():
        values = (f"{found[f'{prior}, {column}']:.1f}" for column in COLUMNS)
        lines.append(f"| {text} | {' | '.join(values)} |")
    return "\n".join(lines)


def _joined() -> str:
    found = figures("joining")

    def of(what: str) -> str:
        return f"{found[f'{what}, median']:.1f} % (median) to {found[f'{what}, largest']:.0f} % of their extent"

    return (
        "Three movements in a row, of three shapes of LASA each time, are met within\n"
        f"{of('joined')}, start, goal and the velocities there exactly. To change the parts instead,\n"
        "as little as possible, until neighbors meet with a common velocity and acceleration bends them by\n"
        f"{of('common velocity and acceleration')} (`python -m bench --only joining`)."
    )


def _coupled() -> str:
    largest = figures("joining")["coupled, largest"]
    return (
        f"The difference is kept to at most {largest:.1g} % of the extent, for 30 pairs of shapes of LASA\n"
        "(`python -m bench --only joining`)."
    )
