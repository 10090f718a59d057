"""Reaches in space are nearly straight: a limited rotation must not be spent on turning them about themselves."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kineme import Demonstrations, Recognizer
from kineme.kernels.procrustes import Procrustes

U = np.linspace(0, 1, 60)
REACH = 10 * U**3 - 15 * U**4 + 6 * U**5


def _reaches(counts, turn, seed):
    """Five kinds: straight; bent up, down, to the side; in waves. Noise of 0.3 percent, turned by up to `turn`."""
    rng = np.random.default_rng(seed)
    arc, wave = np.sin(np.pi * REACH), np.sin(2 * np.pi * REACH)
    bends = [(0 * arc, 0 * arc), (arc, 0 * arc), (-arc, 0 * arc), (0 * arc, arc), (wave, 0 * arc)]
    paths, labels = [], []
    for kind, (up, side) in enumerate(bends):
        for _ in range(counts):
            size = rng.uniform(0.1, 0.15)
            x = np.stack((REACH, size * side, size * up), axis=1) + 0.003 * rng.normal(size=(60, 3))
            axis = rng.normal(size=3)
            vector = np.radians(turn) * rng.uniform() * axis / np.linalg.norm(axis)
            paths.append(x @ Rotation.from_rotvec(vector).as_matrix().T)
            labels.append(kind)
    return Demonstrations.from_arrays(paths, labels)


def test_five_kinds_of_reach_turned_by_up_to_55_degrees():
    right = []
    for seed in range(4):
        recognizer = Recognizer().fit(_reaches(1, 0.0, seed))
        asked = _reaches(30, 55.0, 100 + seed)
        right.append(np.mean(recognizer.predict(asked) == asked.labels))
    assert np.mean(right) > 0.965  # with the best free rotation turned back to the limit 0.952


def test_a_straight_reach_that_was_turned_within_the_limit_is_as_near_as_one_that_was_not():
    rng = np.random.default_rng(0)
    directions = Rotation.from_rotvec(np.radians(55) * np.eye(3)).as_matrix()[:, :, 0]
    straight = (REACH[:, None, None] * directions + 0.002 * rng.normal(size=(60, 3, 3))).transpose(1, 2, 0)
    rows = (straight - straight.mean(axis=2, keepdims=True)).reshape(3, -1)
    procrustes = Procrustes(3)
    squares = procrustes.squared_distances(procrustes.prepare(rows), procrustes.prepare(rows[:1]))[:, 0]
    assert np.sqrt(squares / 60).max() < 0.002 * np.sqrt(2 * 3)  # the noise of both
