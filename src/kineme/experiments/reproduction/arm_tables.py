"""The paper's tables on movements of an arm, beside those of the same movements in the plane."""

from __future__ import annotations

from typing import Any

from kineme.datasets.lasa import LASA_26
from kineme.experiments.reproduction import paper
from kineme.experiments.reproduction.arm_letter import letter_table
from kineme.experiments.reproduction.columns import COLUMNS, DEFAULT, KERNELS, Draws, columns_of, over
from kineme.experiments.reproduction.conclusions import read_ahead, read_left_out, read_order
from kineme.experiments.reproduction.representations import READINGS
from kineme.output.table import Table, mean_and_range

_PLANE, _ARM = "the plane", "the arm"


def arm_tables(arm: dict[str, Any], draws: dict[str, Draws]) -> list[Table]:
    """Figure 7 as numbers, and the tables on joint positions; where the extra is missing, a table that says so.

    Parameters
    ----------
    arm : dict
        See `arm.run_arm`.
    draws : dict
        The draws of the recordings in the plane, for comparison.
    """
    if "missing" in arm:
        return [missing_table(arm["missing"])]
    shapes = f"all {len(LASA_26)} single shapes of LASA"
    return [
        letter_table(arm["letter"]),
        _nearest(arm["paper"], draws["paper"], "nine letters", _executed(arm)),
        _svm(arm["paper"], draws["paper"]),
        _nearest(arm["lasa-26"], draws["lasa-26"], shapes, read_left_out(arm["lasa-26"][0]["left_out"])),
    ]


def missing_table(reason: str) -> Table:
    """The place of these tables where no arm can be moved."""
    return Table("Figure 7 b, c and the tables on movements of an arm", ("", "left out"), [("reason", reason)])


def _executed(arm: dict[str, Any]) -> str:
    return (
        f"The {arm['movements']} recordings that have weights, as the 7 joint positions of the WAM that writes them, "
        f"{1e3 * arm['error']:.2g} mm from them at most."
    )


def _nearest(on_arm: Draws, in_plane: Draws, what: str, more: str) -> Table:
    rows = []
    for reading in READINGS:
        for where, draws in ((_ARM, on_arm), (_PLANE, in_plane)):
            cells = map(mean_and_range, columns_of(draws, "nearest", reading).values())
            rows.append((f"{reading}, {where}", *cells))
    correlation = [mean_and_range(over(on_arm, "correlation", key)) for key in ("original-w", "bio-w")]
    rows.append((f"correlation of w, {_ARM}", *correlation, "-", "-"))
    title = f"Table 2 on movements of the arm, 7 joints. 1-NN, leave one out, {what}"
    return Table(
        f"{title} ({len(on_arm)} draws: mean, range)", ("", *COLUMNS), rows, read_nearest(on_arm, in_plane, more)
    )


def read_nearest(on_arm: Draws, in_plane: Draws, more: str = "") -> str:
    """Whether the shape-attractor is ahead of weights on the arm, and whether the arm is ahead of the plane."""
    sentences = [more]
    ours = columns_of(on_arm, "nearest", DEFAULT)
    for formulation in ("original", "bio-inspired"):
        pair = (ours[f"{quantity}, {formulation}"] for quantity in ("f(t)", "weights"))
        sentences.append(read_order(f"On the arm, {DEFAULT}, {formulation}", ("f(t)", "weights"), *pair))
    sentences += [
        read_ahead(f"On the same draws, {reading}", (_ARM, _PLANE), *both)
        for reading in READINGS
        if (both := [columns_of(draws, "nearest", reading) for draws in (on_arm, in_plane)])
    ]
    return " ".join(filter(None, sentences))


def _svm(on_arm: Draws, in_plane: Draws) -> Table:
    both = {_ARM: [one for one in on_arm if "svm" in one]}
    both[_PLANE] = [plane for plane, arm in zip(in_plane, on_arm, strict=True) if "svm" in arm]
    rows = [
        (
            f"{kernel}: {reading}, {where}",
            *map(mean_and_range, columns_of(draws, "svm", reading, f"/{name}/median").values()),
        )
        for name, kernel in KERNELS.items()
        for reading in READINGS
        for where, draws in both.items()
    ]
    title = "Table 4 on movements of the arm, 7 joints. SVM, leave one out, nine letters, median widths"
    return Table(
        f"{title} ({len(both[_ARM])} draws: mean, range; C = {paper.PENALTY:g})",
        ("", *COLUMNS),
        rows,
        read_svm(both[_ARM]),
    )


def read_svm(on_arm: Draws) -> str:
    """The kernel that is ahead on the arm, under each reading."""
    sentences = []
    for reading in READINGS:
        tre, rbf = (columns_of(on_arm, "svm", reading, f"/{name}/median") for name in ("tre", "rbf"))
        sentences.append(read_ahead(f"On the arm, {reading}", ("TrE", "RBF"), tre, rbf))
    return " ".join(sentences)
