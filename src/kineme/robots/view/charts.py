"""Joints over time beside their limits, as drawings inside the page."""

from __future__ import annotations

import numpy as np

from kineme.output.text import in_markup
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.sampling import evenly_spaced
from kineme.validation import Array

WIDTH, HEIGHT = 320.0, 84.0  # of a drawing, in its own units
_EDGE = 4.0  # above the upper limit and below the lower one
_POINTS = 400


def charts(made: RobotMovement) -> str:
    """A figure for each joint, from its lower limit to its upper one, and for each discrete channel."""
    trajectory, robot = made.trajectory, made.robot
    columns = zip(trajectory.joints, trajectory.positions.T, robot.lower, robot.upper, robot.units, strict=True)
    figures = [_chart(made, name, values, (low, high), unit) for name, values, low, high, unit in columns]
    return "\n".join(figures + [_chart(made, name, values, None, "") for name, values in trajectory.steps.items()])


def _chart(made: RobotMovement, name: str, values: Array, limits: tuple[float, float] | None, unit: str) -> str:
    times = made.trajectory.times
    kept = evenly_spaced(len(times), _POINTS)
    low, high = (float(values.min()), float(values.max()))
    if limits is not None:
        low, high = min(low, limits[0]), max(high, limits[1])
    scale = (HEIGHT - 2 * _EDGE) / max(high - low, 1e-9)
    across = WIDTH / max(float(times[-1]), 1e-9)

    def y(value: Array) -> Array:
        return np.asarray(HEIGHT - _EDGE - scale * (value - low))

    x, drawn = times[kept] * across, y(values[kept])
    if limits is None:  # a value holds until the next one
        x, drawn = np.repeat(x, 2)[1:], np.repeat(drawn, 2)[:-1]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, drawn, strict=True))
    lines = "" if limits is None else "".join(_level(float(y(np.asarray(limit)))) for limit in limits)
    shown = "" if limits is None else f"limits {limits[0]:.3g} to {limits[1]:.3g} {unit}"
    extent = f"from {values.min():.3g} to {values.max():.3g} {unit}".strip()
    words = in_markup(f"{name} over time: {extent}{'; ' + shown if shown else ''}")
    return (
        f'<figure class="chart"><figcaption><span class="name">{in_markup(name)}</span> '
        f'<output data-unit="{unit}"></output></figcaption>'
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none" role="img" aria-label="{words}">'
        f'<rect class="approach" width="{made.begins * across:.1f}" height="{HEIGHT:g}"/>{lines}'
        f'<polyline class="joint" points="{line}"/><line class="cursor" y2="{HEIGHT:g}"/></svg>'
        f'<p class="limits">{shown or "a discrete channel"}</p></figure>'
    )


def _level(y: float) -> str:
    return f'<line class="limit" x2="{WIDTH:g}" y1="{y:.1f}" y2="{y:.1f}"/>'
