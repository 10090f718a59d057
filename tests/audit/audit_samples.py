"""Episodes of a simulated arm with a leader, and faults that are planted in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kineme.movements.episodes import Episode

FPS, STEP = 50.0, 1e-3
NAMES = ("pan.pos", "lift.pos", "elbow.pos", "wrist.pos", "gripper.pos")
PLACES = {
    "stack": np.array([[0, 0, 0, 0, 1], [1, 0.4, -0.5, 0.2, 1], [1, 0.8, -0.7, 0.2, 0], [-0.6, 0.3, 0, 0.9, 0]], float),
    "wipe": np.array([[0, 0, 0, 0, 1], [-1, 0.5, 0.6, -0.4, 0.3], [-0.2, 0.5, 0.6, -0.4, 0.3], [0.5, 0, 0, 0, 1.0]]),
}  # fmt: skip


def episode(number, seed=0, task="stack", n=None):
    """A clean episode: movements of least jerk between places that vary, rests, tremor, noise, a follower that lags."""
    rng = np.random.default_rng([seed, number])
    places = PLACES[task] + rng.normal(scale=0.05, size=PLACES[task].shape)
    parts = [np.repeat(places[:1], rng.integers(10, 30), axis=0)]
    for before, after in zip(places, [*places[1:], places[0]], strict=True):
        u = np.linspace(0, 1, rng.integers(50, 90))[:, None]
        parts += [before + (after - before) * u**3 * (10 - 15 * u + 6 * u**2)]
        parts += [np.repeat(after[None], rng.integers(3, 15), axis=0)]
    lead = np.concatenate(parts)
    lead = lead + _smooth(rng.normal(scale=0.004, size=lead.shape), 5)
    state = _smooth(np.concatenate([np.repeat(lead[:1], 4, axis=0), lead[:-4]]), 3) + 0.01
    state = np.round((state + rng.normal(scale=STEP / 3, size=state.shape)) / STEP) * STEP
    signals = {"observation.state": state, "action": lead}
    entries = dict.fromkeys(signals, NAMES)
    return Episode(number, np.arange(len(lead)) / FPS, signals, entries, task, FPS, (), f"episode {number}")


def episodes(n, seed=0, tasks=("stack",)):
    return [episode(k, seed, tasks[k % len(tasks)]) for k in range(n)]


def _smooth(values, width):
    padded = np.concatenate([values[:1]] * (width // 2) + [values] + [values[-1:]] * (width // 2))
    return np.mean([padded[k : k + len(values)] for k in range(width)], axis=0)


def with_state(clean, change):
    state = clean.signals["observation.state"].copy()
    change(state)
    return replace(clean, signals={**clean.signals, "observation.state": state})


def with_frames(clean, rows, times=None):
    signals = {name: values[rows] for name, values in clean.signals.items()}
    return replace(clean, signals=signals, times=clean.times[rows] if times is None else times)


def counted_on(clean, rows):
    return with_frames(clean, rows, np.arange(len(rows)) / FPS)


def spike(clean):
    def throw(state):
        state[200, 1] += 0.4

    return with_state(clean, throw)


def freeze(clean):
    def hold(state):
        state[100:220, 0] = state[100, 0]

    return with_state(clean, hold)


def shake(clean):
    shaking = 0.03 * np.sin(2 * np.pi * 6 * np.arange(100) / FPS)[:, None]
    signals = {name: values.copy() for name, values in clean.signals.items()}
    for values in signals.values():
        values[120:220] += shaking
    return replace(clean, signals=signals)


def rest(clean):
    return counted_on(clean, np.concatenate([np.arange(150), np.full(300, 150), np.arange(150, len(clean))]))


def shift(clean):
    def turn(state):
        state[:, 2] += 0.2

    return with_state(clean, turn)


def overreach(clean):
    """A joint with another zero or another scale, of both arms."""
    signals = {name: values.copy() for name, values in clean.signals.items()}
    for values in signals.values():
        values[:, 0] *= np.where(clean.number % 2, 1.6, -1.0)
    return replace(clean, signals=signals)


def delay(clean):
    def wait(state):
        state[10:] = state[:-10].copy()

    return with_state(clean, wait)


def hold(clean):
    """The follower is held for a second and a half while the leader goes on."""

    def block(state):
        state[100:175] = state[100] + np.random.default_rng(0).normal(scale=STEP, size=(75, state.shape[1]))

    return with_state(clean, block)


def never_grip(clean):
    signals = {name: values.copy() for name, values in clean.signals.items()}
    for values in signals.values():
        values[:, 4] = 1.0 + 0.001 * np.sin(np.arange(len(values)))
    return replace(clean, signals=signals)


def halt(clean):
    return with_frames(clean, np.arange(len(clean) // 3))


def hurry(clean):
    return counted_on(clean, np.arange(0, len(clean), 2))


def repeat(clean):
    rows = np.arange(len(clean))
    rows[1:300:2] = rows[0:300:2]
    return with_frames(clean, rows, clean.times)


def other_task(clean):
    return replace(episode(clean.number, 77, "wipe"), task=clean.task)


def lose(clean):
    return with_frames(clean, np.delete(np.arange(len(clean)), np.arange(100, 110)))


def lose_silently(clean):
    moving = np.abs(np.diff(clean.signals["observation.state"], axis=0)).sum(axis=1)[50:-50].argmax() + 45
    return counted_on(clean, np.delete(np.arange(len(clean)), np.arange(moving, moving + 10)))


def stamp_twice(clean):
    return replace(clean, times=np.repeat(clean.times[::2], 2)[: len(clean)])


def slow_clock(clean):
    return replace(clean, times=clean.times * 2)


def spoil(clean):
    def lose_value(state):
        state[50:55, 3] = np.nan

    return with_state(clean, lose_value)


#: Fault -> checks of which at least one says it.
FAULTS = {
    spike: {"spikes"},
    freeze: {"frozen"},
    shake: {"jerk"},
    rest: {"idle"},
    shift: {"offset"},
    delay: {"lag"},
    hold: {"following"},
    never_grip: {"still"},
    halt: {"cut", "duration"},
    hurry: {"speed"},
    repeat: {"repeats"},
    other_task: {"unlike", "place"},
    lose_silently: {"spikes"},
    overreach: {"above", "below"},
}
#: Fault that contradicts -> its check.
CONTRADICTIONS = {lose: "gaps", stamp_twice: "stamps", slow_clock: "rate", spoil: "values"}
