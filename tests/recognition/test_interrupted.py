"""A pause somewhere in a drawing, with samples or without, changes hardly any answer."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import Recognizer
from kineme.similarity.describe import recorded_values
from kineme_experiments.evaluation.data import load_data
from movement_samples import draw_shapes, interrupted

any_pause = pytest.mark.parametrize("at_rest", [True, False], ids=["at rest", "without samples"])
LEAST = 0.99


@any_pause
@pytest.mark.parametrize("seconds", [1.0, 30.0])
def test_handwriting(seconds, at_rest):
    demos = kineme.load_lasa()
    asked = kineme.Demonstrations([kineme.Trajectory(one.times[::10], one.positions[::10]) for one in demos[3::7]])
    recognizer = Recognizer().fit(demos[::7])
    paused = interrupted(asked, seconds, at_rest, 0.002)
    assert np.mean(recognizer.predict(paused) == demos.labels[3::7]) >= LEAST


@any_pause
@pytest.mark.parametrize("d", [2, 3])
def test_shapes(d, at_rest):
    demos = draw_shapes([4] * 8, d, seed=1, spread=0.2)
    recognizer = Recognizer().fit(demos[::4])
    plain = recognizer.predict(demos)
    for seconds in (0.5, 3.0, 30.0):
        assert np.mean(recognizer.predict(interrupted(demos, seconds, at_rest)) == plain) >= LEAST


@any_pause
def test_demonstrations_may_have_them_too(at_rest):
    demos = draw_shapes([4] * 8, seed=1, spread=0.2)
    assert Recognizer().fit(interrupted(demos[::4], 5.0, at_rest)).score(demos, demos.labels) >= LEAST


@any_pause
def test_while_a_movement_is_under_way(at_rest):
    demos = kineme.load_lasa(["CShape", "Sine", "WShape", "Zshape"])
    recognizer = Recognizer().fit(demos[::7])
    for one, label in zip(demos[3::7], demos.labels[3::7], strict=True):
        every = kineme.Demonstrations([kineme.Trajectory(one.times[::20], one.positions[::20])])
        paused, live = interrupted(every, 20.0, at_rest)[0], recognizer.stream()
        half = len(paused.times) - 10
        live.update(paused.times[:half], paused.positions[:half])
        state = live.update(paused.times[half:], paused.positions[half:])
        assert state.ranked[0].label == label
        assert recognizer.predict_partial([paused])[0] == label


@pytest.mark.parametrize("name", ["letters2d", "strokes2d", "multistrokes2d"])
def test_drawings_by_other_people(name, development_data):
    """One template of each kind by somebody else; paired, so that chance hardly counts."""
    data = load_data(str(development_data / f"{name}.npz"))
    demos, labels = data.demonstrations, np.asarray(data.demonstrations.labels).astype(str)
    people = np.asarray(data.people) if data.people is not None else np.zeros(len(demos))
    differences = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        other = people != rng.choice(np.unique(people)) if len(set(people.tolist())) > 1 else np.ones(len(demos), bool)
        shown = [rng.choice(np.flatnonzero(other & (labels == one))) for one in np.unique(labels)]
        asked = rng.permutation(np.setdiff1d(np.arange(len(demos)), shown))[:150]
        recognizer = Recognizer().fit(demos[shown])
        plain = np.mean(recognizer.predict(demos[asked]) == labels[asked])
        for seconds, at_rest in ((1.0, False), (30.0, False), (10.0, True)):
            paused = interrupted(demos[asked], seconds, at_rest, 0.002, seed)
            differences.append(np.mean(recognizer.predict(paused) == labels[asked]) - plain)
    assert np.mean(differences) > -0.01


@pytest.mark.parametrize("length", [1, 3, 60])
def test_what_a_tracker_lost_changes_no_answer(length):
    """Zeros in place of samples that were not seen: one of them was most of the path, and nothing was recognized."""
    demos = kineme.load_lasa()
    recognizer, lost = Recognizer().fit(demos[::7]), []
    for movement in demos[3::7]:
        x = movement.positions + np.array([400.0, 300.0])
        x[500 : 500 + length] = 0.0
        lost.append(kineme.Trajectory(movement.times, x))
    assert np.mean(recognizer.predict(lost) == demos.labels[3::7]) >= LEAST
    beginnings = [kineme.Trajectory(one.times[:800], one.positions[:800]) for one in lost]
    assert np.mean(recognizer.predict_partial(beginnings) == demos.labels[3::7]) >= 0.9


def test_a_spike_of_a_sensor_changes_no_values():
    """Of sensors the values as they were recorded count, too."""
    demos = draw_shapes([4] * 4, 5, seed=1, spread=0.2)
    spiked = []
    for movement in demos:
        x = movement.positions.copy()
        x[40] += 20 * np.ptp(x, axis=0)
        spiked.append(kineme.Trajectory(movement.times, x))
    spiked = kineme.Demonstrations(spiked)
    values = [recorded_values(movements, 1, len(demos)) for movements in (demos, spiked)]
    np.testing.assert_allclose(*values, rtol=0, atol=0.01 * np.abs(values[0]).max())
    recognizer = Recognizer().fit(demos[::2])
    np.testing.assert_allclose(recognizer.predict_proba(spiked), recognizer.predict_proba(demos), rtol=0, atol=0.02)
