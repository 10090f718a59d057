"""Episodes of an arm at work, with truth: ways there and back, a gripper, and the noise of a hand that leads."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kineme.movements.episodes import Episode

NAMES = (*(f"joint_{k}.pos" for k in range(1, 7)), "gripper.pos")
PLACES = {
    "home": (0.0, -0.9, 1.2, 0.0, 0.7, 0.0),
    "cube": (0.7, 0.3, 0.5, 0.0, 1.1, 0.3),
    "bin": (-0.8, 0.1, 0.7, 0.4, 0.9, -0.5),
    "stain": (0.1, 0.6, 0.2, -0.4, 0.6, 1.0),
}  # [rad]
#: Task -> kind of movement, where it ends, how far the gripper is open then, seconds.
TASKS = {
    "pick the cube": (
        ("reach", "cube", 1.0, 1.6), ("grasp", "cube", 0.2, 0.6), ("carry", "bin", 0.2, 1.8),
        ("release", "bin", 1.0, 0.6), ("return", "home", 1.0, 1.5),
    ),
    "fetch from the bin": (
        ("reach the bin", "bin", 1.0, 1.5), ("grasp at the bin", "bin", 0.2, 0.6), ("carry back", "cube", 0.2, 1.8),
        ("release at the start", "cube", 1.0, 0.6), ("leave", "home", 1.0, 1.6),
    ),
}  # fmt: skip


def work_episode(number, task, seed=0, fps=30, noise=0.001, jitter=0.03):
    """An episode, and its truth: (start, end, kind) of each movement [s]."""
    rng = np.random.default_rng([seed, number])
    at, grip, t0 = np.array(PLACES["home"]), 1.0, 0.0
    points, openings, spans = [], [], []
    for kind, place, opening, seconds in TASKS[task]:
        still = "grasp" in kind or "release" in kind
        goal = at if still else np.array(PLACES[place]) + jitter * rng.normal(size=6)
        lasting = seconds * rng.uniform(0.8, 1.25)
        u = np.arange(round(lasting * fps)) / round(lasting * fps)
        s = (u**3 * (10 - 15 * u + 6 * u**2))[:, None]
        points.append(at + s * (goal - at))
        openings.append(grip + np.clip(1.15 * u - 0.1, 0.0, 1.0) * (opening - grip))
        spans.append((t0, t0 + len(u) / fps, kind))
        at, grip, t0 = goal, opening, t0 + len(u) / fps
    joints = np.concatenate(points)
    tremor = gaussian_filter1d(rng.normal(size=joints.shape), 4, axis=0) * 6 * noise
    state = np.column_stack((joints + tremor + noise * rng.normal(size=joints.shape), np.concatenate(openings)))
    times = np.arange(len(state)) / fps
    signals = {"observation.state": state, "action": np.roll(state, -2, axis=0)}
    names = dict.fromkeys(signals, NAMES)
    return Episode(number, times, signals, names, task, float(fps), (), f"episode {number}"), tuple(spans)


def work_episodes(n, seed=0, tasks=tuple(TASKS), **how):
    """Episodes of the tasks in turn, and the truth of each."""
    pairs = [work_episode(k, tasks[k % len(tasks)], seed, **how) for k in range(n)]
    return [episode for episode, _ in pairs], [spans for _, spans in pairs]
