"""The table of docs/guide/modulation.md: what it says works does, and what it says does not is refused in words."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import kineme
from kineme.errors import KinemeError
from kineme.orientation import PoseDMP, exp
from kineme.styles import average

PAGE = Path(__file__).parents[3] / "docs" / "guide" / "modulation.md"


def table():
    """(row, column) -> cell, of the first table of the page."""
    lines = re.search(r"(?m)^\| \|.*\n\|[-|]+\n(?:\|.*\n)+", PAGE.read_text(encoding="utf-8"))[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if not line.startswith("|-")]
    return {(row[0], name): cell for row in cells[1:] for name, cell in zip(cells[0][1:], row[1:], strict=True)}


@cache
def primitives(name):
    u = np.linspace(0, 1, 80)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    paths = [np.column_stack((s, np.sin(2 * s + 0.1 * k), 0.2 * s**2 * (1 + 0.1 * k))) for k in range(4)]
    if name == "PosePrimitives":
        return PoseDMP().learn([np.hstack((path, exp(np.outer(s, [0.1, 0.2, 0.7])))) for path in paths])[0]
    if name == "RhythmicPrimitives":
        t = np.linspace(0, 3, 300)
        wave = np.column_stack((np.sin(6 * t), np.cos(6 * t), 0.3 * np.sin(12 * t)))
        return kineme.RhythmicDMP().learn([kineme.Trajectory(t, wave)])
    learned = kineme.DMP().learn(paths)
    return average(learned) if name == "AveragePrimitive" else learned[0]


def near(one, share):
    """A place on the way, which a via point may be at."""
    return one.rollout(n_samples=11).positions[0, round(10 * share)]


def rates(one):
    return np.full(one.rollout(n_samples=2).velocities.shape[2], 0.1)


def through(one):
    """When, and where: a share of the duration, or a phase."""
    return [(2 * np.pi * 0.4 if hasattr(one, "periods") else 0.4, near(one, 0.4))]


def controlled(one):
    if isinstance(one, kineme.styles.AveragePrimitive):
        return kineme.dmp.Primitives.from_rollout(one.rollout(via=through(one))).controller(0.01)
    return one.controller(0.01, via=through(one))


def stepped(one):
    controller = getattr(one, "primitive", one).controller(0.01)
    return controller.step(goal_velocity=rates(one)).status.rejected


def joined(one):
    part = getattr(one, "primitive", one)
    kineme.join([part, part], shift=True)


def blended(one):
    part = getattr(one, "primitive", one)
    kineme.blend(part, part, (0.4, 0.6))


def fastest(one):
    movement = one.rollout()
    return (movement.least_period if hasattr(movement, "least_period") else movement.least_duration)(velocity=1.0)


ASKED = {
    "`rollout(via=...)`": lambda one: one.rollout(via=through(one)),
    "`rollout(end_velocity=...)`": lambda one: one.rollout(end_velocity=rates(one)),
    "`rollout(goal_velocity=...)`": lambda one: one.rollout(goal_velocity=rates(one)),
    "`controller.step(goal_velocity=...)`": stepped,
    "`rollout(position_limits=...)`": lambda one: one.rollout(position_limits=(-9.0, 9.0)),
    "`controller(via=...)`": controlled,
    "`rollout().least_duration`": fastest,
    "`join`": joined,
    "`blend`": blended,
    "`couple`": lambda one: kineme.couple(one, one, during=(0.4, 0.6)),
}


def test_every_row_of_the_table_is_tried():
    assert {row for row, _ in table()} == set(ASKED)


@pytest.mark.parametrize(("row", "column"), table(), ids=lambda text: text.strip("`"))
def test_the_table_is_right(row, column):
    one = primitives(column.strip("`"))
    assert type(one).__name__ == column.strip("`")
    if table()[row, column] != "no":
        assert not np.any(ASKED[row](one) is True)
        return
    with pytest.raises(KinemeError, match=r"^(expected|part 0)"):
        ASKED[row](one)
