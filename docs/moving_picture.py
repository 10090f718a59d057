"""Moving pictures: a letter is drawn, recognized and moved; a movement follows its goal around an obstacle.

Each is one SVG file, animated by its style sheet: no script, sharp at every size, by light and in the dark, still for
readers who ask for less motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import kineme
from kineme.control import ObstacleAvoidance
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE

_WIDTH, _HEIGHT, _PANEL = 760, 270, 240
_SECONDS = 9.0
_WHOLE = 7.6  # seconds after which all is to be seen: the picture begins there, and stays there without motion
_TIME = f"{_SECONDS}s linear -{_WHOLE}s infinite"
_DRAWN = 0.4  # share of the time in which the letter is drawn
_GOALS = 6
_AFTER = "84%,96%{opacity:.55}99%,100%{opacity:0}"  # the last goal has come
_STEPS = 20  # answers of the recognizer that are shown
#: By light and in the dark, where paper is transparent: the picture lies on the page.
_COLORS = (
    f":root{{--paper:#fff;--text:#222;--empty:#eee;--soft:{GRAY};--pen:{BLUE};--moved:{GREEN};--tip:{ORANGE}}}"
    "@media (prefers-color-scheme:dark)"
    "{:root{--paper:none;--text:#eee;--empty:#333a42;--soft:#9aa4ae;--pen:#56b4e9;--moved:#2fc79a;--tip:#f08a3c}}"
)
_LETTER, _OTHERS = "GShape", ("CShape", "Sshape")


class _Frame(NamedTuple):
    """Where the unit of the recording comes to lie in the picture."""

    left: float
    middle: np.ndarray
    scale: float

    def points(self, x: np.ndarray) -> np.ndarray:
        center = np.array([self.left + _PANEL / 2, 150.0])
        return center + self.scale * (x - self.middle) * (1, -1)


def moving_picture() -> str:
    """The picture as SVG."""
    demos = kineme.load_lasa()
    shown = demos[[i for i, label in enumerate(demos.labels) if label == _LETTER][3]]
    path = shown.positions[::10]
    left, right = (_Frame(x, (path.min(0) + path.max(0)) / 2, 3.1) for x in (10.0, 510.0))
    lines = [*_letter(left.points(path)), *_answers(demos, shown), *_goals(right, shown)]
    titles = ("Drawn once", "Recognized on the way", "Moved to new goals")
    heads = [f'<text x="{130 + 250 * k}" y="30" class="head">{title}</text>' for k, title in enumerate(titles)]
    return "\n".join([_HEAD.format(style=_style()), *heads, *lines, "</svg>", ""])


_HEAD = f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" \
aria-label="A handwritten G is drawn, recognized on the way, and moved to new goals">
<style>{{style}}</style>
<rect class="paper" width="{_WIDTH}" height="{_HEIGHT}" rx="10"/>"""


def _letter(points: np.ndarray) -> Iterator[str]:
    yield f'<path class="pen" pathLength="1" d="{_d(points)}"/>'
    yield _dot(points[0], "from")
    steps = [f"{_percent(k / _STEPS)}{_at(point)}" for k, point in _along(points)]
    yield f"<style>@keyframes tip{{{''.join(steps)}100%{_at(points[-1])}}}</style>"
    yield '<circle class="tip" r="6"/>'


def _at(point: np.ndarray) -> str:
    return f"{{transform:translate({point[0]:.1f}px,{point[1]:.1f}px)}}"


def _along(points: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Even steps of the length, as the line itself is drawn."""
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    for k in range(_STEPS + 1):
        yield k, np.array([np.interp(k / _STEPS * length[-1], length, column) for column in points.T])


def _answers(demos: kineme.Demonstrations, shown: kineme.Trajectory) -> Iterator[str]:
    """Bars of what the recognizer says at each step, of one demonstration of each of the 26 shapes."""
    stream = kineme.Recognizer().fit(demos[::7]).stream()
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(shown.positions, axis=0), axis=1)))
    confidence = {name: np.zeros(_STEPS + 1) for name in (_LETTER, *_OTHERS)}
    for t, x, share in zip(shown.times, shown.positions, length / length[-1], strict=True):
        update = stream.update(t, x)
        for guess in update.ranked:
            if guess.label in confidence:
                confidence[guess.label][int(np.ceil(share * _STEPS)) :] = guess.confidence
    for row, (name, values) in enumerate(confidence.items()):
        y = 95 + 48 * row
        steps = "".join(f"{_percent(k / _STEPS)}{{transform:scaleX({value:.3f})}}" for k, value in enumerate(values))
        yield f"<style>@keyframes bar{row}{{{steps}100%{{transform:scaleX({values[-1]:.3f})}}}}</style>"
        yield f'<text x="295" y="{y + 17}" class="name">{name[0].upper()}</text>'
        yield f'<rect x="320" y="{y}" width="150" height="22" rx="4" class="empty"/>'
        yield f'<rect class="bar bar{row}" x="320" y="{y}" width="150" height="22" rx="4"/>'


def _goals(frame: _Frame, shown: kineme.Trajectory) -> Iterator[str]:
    """The demonstration, and the primitive of it to goals on an arc."""
    primitive = kineme.DMP().learn([shown])
    yield f'<path class="gray" d="{_d(frame.points(shown.positions[::10]))}"/>'
    angles = np.linspace(-0.9, 1.9, _GOALS)
    goals = primitive.goals + 17 * np.column_stack((np.cos(angles), np.sin(angles)))
    for k, path in enumerate(primitive.rollout(goal=goals).positions):
        points = frame.points(path[:: max(1, len(path) // 80)])
        end = frame.points(goals[k])
        first = 46 + 5 * k
        steps = f"0%,{first}%{{opacity:0}}{first + 2}%,{first + 6}%{{opacity:1}}{_AFTER}"
        yield f"<style>@keyframes goal{k}{{{steps}}}</style>"
        yield f'<g style="animation:goal{k} {_TIME}">'
        yield f'<path class="moved" d="{_d(points)}"/>{_dot(end, "goal")}</g>'


_FRAMES = 60  # of a movement that is controlled


def moving_goal() -> str:
    """Return SVG of a G that is under control: the goal moves while it is made, and an obstacle stands on its path."""
    shown = kineme.load_lasa(["GShape"])[3]
    primitive, obstacle = kineme.DMP().learn([shown]), np.array([[-27.0, 0.0]])
    control = primitive.controller(
        dt=0.005, avoidance=ObstacleAvoidance(gamma=4500, reach=10.0), end_velocity=[0.0, 0.0]
    )
    steps = 5 * round(1.8 * float(primitive.durations[0]) / 0.005 / 5)
    turned = np.clip((np.arange(steps) / steps - 0.15) / 0.4, 0, 1)
    goals = primitive.goals[0] + np.column_stack((24 * turned, -14 * np.sin(np.pi * turned)))
    drifts = np.gradient(goals, 0.005, axis=0)
    path = np.array(
        [
            control.step(goal=goal, goal_velocity=drift, obstacles=obstacle).position
            for goal, drift in zip(goals, drifts, strict=True)
        ]
    )
    frame = _Frame(110.0, (shown.positions.min(0) + shown.positions.max(0)) / 2, 3.1)
    points, ends = frame.points(path), frame.points(goals)
    frames = np.linspace(0, steps - 1, _FRAMES + 1).round().astype(int)
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    share = [f"{78 * k / _FRAMES:.3g}%" for k in range(_FRAMES + 1)]
    rules = {
        "pen": [f"{{stroke-dashoffset:{1 - length[k] / length[-1]:.3f}}}" for k in frames],
        "tip": [_at(points[k]) for k in frames],
        "goal": [_at(ends[k]) for k in frames],
    }
    moves = [
        f"@keyframes {name}{{{''.join(map(str.__add__, share, steps))}100%{steps[-1]}}}"
        f".{name}{{animation:{name} {_SECONDS}s linear -{0.9 * _SECONDS:.2g}s infinite}}"
        for name, steps in rules.items()
    ]
    x, y = frame.points(obstacle)[0]
    label = "A G is made again: it bends around an obstacle, and follows its goal, which moves meanwhile"
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 {_HEIGHT}" role="img" aria-label="{label}">',
            f"<style>{_COLORS}.paper{{fill:var(--paper)}}path{{fill:none;stroke-linecap:round;stroke-linejoin:round}}"
            ".gray{stroke:var(--soft);stroke-width:7;opacity:.35}.pen{stroke:var(--pen);stroke-width:4;"
            "stroke-dasharray:1}.tip{fill:var(--tip)}.goal{fill:var(--moved)}.obstacle{fill:var(--soft)}"
            f"{''.join(moves)}{_STILL}</style>",
            f'<rect class="paper" width="520" height="{_HEIGHT}" rx="10"/>',
            f'<path class="gray" d="{_d(frame.points(shown.positions[::10]))}"/>',
            f'<circle class="obstacle" cx="{x:.1f}" cy="{y:.1f}" r="9"/>',
            f'<path class="pen" pathLength="1" d="{_d(points[::5])}"/>',
            '<circle class="goal" r="8"/><circle class="tip" r="6"/>',
            "</svg>\n",
        ]
    )


_STILL = "@media (prefers-reduced-motion:reduce){*{animation-play-state:paused!important}}"


def _style() -> str:
    return (
        _COLORS + ".head{font:600 17px system-ui,sans-serif;text-anchor:middle;fill:var(--text)}"
        ".name{font:600 17px system-ui,sans-serif;text-anchor:end;fill:var(--text)}"
        ".paper{fill:var(--paper)}.empty{fill:var(--empty)}.goal{fill:var(--moved)}.from{fill:var(--soft)}"
        "path{fill:none;stroke-linecap:round;stroke-linejoin:round}"
        ".gray{stroke:var(--soft);stroke-width:7;opacity:.35}"
        f".pen{{stroke:var(--pen);stroke-width:5;stroke-dasharray:1;animation:draw {_TIME}}}"
        ".moved{stroke:var(--moved);stroke-width:2.5;opacity:.85}"
        f".tip{{fill:var(--tip);animation:tip {_TIME}}}"
        ".bar{transform-box:fill-box;transform-origin:left;fill:var(--soft)}"
        + "".join(f".bar{k}{{animation:bar{k} {_TIME}}}" for k in range(3))
        + ".bar0{fill:var(--pen)}"
        f"@keyframes draw{{0%{{stroke-dashoffset:1}}{_percent(1)}{{stroke-dashoffset:0}}100%{{stroke-dashoffset:0}}}}"
        + _STILL
    )


def _percent(share: float) -> str:
    """Of the whole time, where the letter is drawn."""
    return f"{100 * _DRAWN * share:.4g}%"


def _d(points: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _dot(point: np.ndarray, what: str) -> str:
    x, y = np.ravel(point)
    return f'<circle class="{what}" cx="{x:.1f}" cy="{y:.1f}" r="5"/>'
