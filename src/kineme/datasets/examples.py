"""Movements to begin with: letters that people wrote, and gestures and a tool at work, both made by formulas."""

from __future__ import annotations

import numpy as np

from kineme.datasets.lasa import load_lasa
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array, check_choice

#: Names of the examples.
EXAMPLES = ("letters", "gestures", "arm")

_SHOWN = 5  # movements of each kind that is made
_SAMPLES = 100
_TURN, _STRETCH, _BEND = 0.06, 0.12, 0.03  # spread of angles [rad], sizes, and of points as a share of the size

_LETTERS = ("CShape", "GShape", "JShape", "LShape", "NShape", "PShape", "RShape", "Sshape", "WShape", "Zshape")
_ROUND = np.linspace(0.0, 2.0 * np.pi, 60)
#: Corners, or many points of what is round, in the plane: y is up.
_GESTURES = {
    "check mark": ((0.0, 0.5), (0.35, 0.0), (1.0, 1.0)),
    "circle": np.column_stack((-np.sin(_ROUND), np.cos(_ROUND))),
    "infinity": np.column_stack((np.sin(_ROUND), 0.8 * np.sin(_ROUND) * np.cos(_ROUND))),
    "spiral": np.column_stack((np.cos(2.5 * _ROUND), np.sin(2.5 * _ROUND))) * _ROUND[:, None],
    "star": ((0.2, 0.0), (0.5, 1.0), (0.8, 0.0), (0.05, 0.62), (0.95, 0.62), (0.2, 0.0)),
    "triangle": ((0.5, 1.0), (0.0, 0.0), (1.0, 0.0), (0.5, 1.0)),
    "wave": np.column_stack((_ROUND, np.sin(2.0 * _ROUND))),
    "zigzag": ((0.0, 1.0), (1.0, 1.0), (0.0, 0.5), (1.0, 0.5), (0.0, 0.0), (1.0, 0.0)),
}
#: Positions of a tool [m] in front of an arm: x away from it, z up.
_ARM = {
    "insert": ((0.45, -0.1, 0.3), (0.5, 0.05, 0.28), (0.5, 0.05, 0.1)),
    "pick": ((0.4, -0.2, 0.35), (0.5, -0.1, 0.05), (0.5, -0.1, 0.3)),
    "place": ((0.5, -0.1, 0.3), (0.5, 0.2, 0.3), (0.5, 0.2, 0.05)),
    "stir": np.column_stack((0.5 + 0.08 * np.cos(2 * _ROUND), 0.08 * np.sin(2 * _ROUND), np.full(60, 0.15))),
    "wipe": ((0.4, -0.2, 0.05), (0.4, 0.2, 0.05), (0.48, -0.2, 0.05), (0.48, 0.2, 0.05), (0.56, -0.2, 0.05)),
}


def load_example(name: str) -> Demonstrations:
    """Load movements to begin with, labeled; always the same ones, without a network.

    Parameters
    ----------
    name : {"letters", "gestures", "arm"}
        Ten capital letters of LASA, seven of each [mm]; or eight gestures in the plane, or five paths in space of a
        tool [m], five of each, which are no recordings: they are made by formulas, and vary as by a hand.

    Raises
    ------
    SpecificationError
        Another name.
    """
    check_choice("example", name, EXAMPLES)
    if name == "letters":
        letters = load_lasa(_LETTERS)
        labels = [str(movement.label)[0] for movement in letters]
        arrays, times = [movement.positions for movement in letters], [movement.times for movement in letters]
        return Demonstrations.from_arrays(arrays, labels, times, letters.names)
    chance = np.random.default_rng(31)
    kinds = _GESTURES if name == "gestures" else _ARM
    labels = [label for label in kinds for _ in range(_SHOWN)]
    arrays = [_varied(np.array(kinds[label]), chance) for label in labels]
    times = [np.linspace(0.0, chance.uniform(1.2, 2.0), _SAMPLES) for _ in labels]
    return Demonstrations.from_arrays(arrays, labels, times)


def _varied(points: Array, chance: np.random.Generator) -> Array:
    """Move through points (n, d) from rest to rest: turned, stretched and bent a little.

    The share of the path follows ``10 u^3 - 15 u^4 + 6 u^5`` (Flash and Hogan 1985).
    """
    n, d = points.shape
    center, angle = points.mean(axis=0), _TURN * chance.normal()
    bends = _BEND * points.std(axis=0).max() * chance.normal(size=(min(n, 8), d))
    at, phase = np.linspace(0.0, 1.0, len(bends)), np.linspace(0.0, 1.0, n)
    bent = points - center + np.column_stack([np.interp(phase, at, bend) for bend in bends.T])
    turn = np.eye(d)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    bent = bent * (1.0 + _STRETCH * chance.uniform(-1.0, 1.0, d)) @ turn.T + center
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(bent, axis=0), axis=1))))
    u = np.linspace(0.0, 1.0, _SAMPLES)
    along = lengths[-1] * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return np.column_stack([np.interp(along, lengths, column) for column in bent.T])
