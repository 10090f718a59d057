"""The picture of a movement on an arm: every joint can be told from the others and from its limits."""

from __future__ import annotations

import numpy as np

import kineme
from kineme.robots import draw_robot_movement, load, move


def charts(figure):
    return [axes for axes in figure.axes if axes.name == "rectilinear"]


def test_a_joint_that_stands_is_drawn_as_a_straight_line():
    robot = load("ur5e")
    u = np.linspace(0, 1, 60)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    q = robot.rest + s * [0.3, 0, 0, 0, 0, 0] + u * [0, 0, 0, 0, 1e-9, 0]
    rows = charts(draw_robot_movement(move(kineme.Trajectory(2 * u[:, 0], q), robot, space="joints")))
    assert [row.get_title(loc="left") for row in rows] == [f"{name} [rad]" for name in robot.joints]
    for row, lower, upper in zip(rows, robot.lower, robot.upper, strict=True):
        low, high = row.get_ylim()
        assert high - low >= 0.05 * (upper - lower) - 1e-9


def test_names_of_the_axes_of_a_flat_path_lie_beside_their_numbers():
    (sine,) = kineme.load_lasa(["Sine"])[:1]
    flat = kineme.Trajectory(sine.times[::5], sine.positions[::5] / 100 + [0.5, 0.0])
    figure = draw_robot_movement(move(flat, load("panda"), timing="slowed"))
    figure.draw_without_rendering()
    (box,) = [axes for axes in figure.axes if axes.name == "3d"]
    name = box.xaxis.label.get_window_extent()
    numbers = [tick.label1 for tick in box.xaxis.majorTicks]
    assert len(numbers) > 2
    assert not [label.get_text() for label in numbers if label.get_window_extent().overlaps(name)]
