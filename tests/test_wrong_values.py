"""Every parameter of the public specifications and options, with values that cannot be: a result or a KinemeError.

No other exception, no warning, no number that is not finite, and no wait. What is passed is drawn from one table, so
that a parameter that is added here is tried with all of it.
"""

from __future__ import annotations

import inspect
import math
import warnings
from functools import cache

import numpy as np
import pytest

import kineme
from kineme import (
    DMP,
    ActionLibrary,
    Demonstrations,
    DMPFeatures,
    Recognizer,
    Resample,
    RhythmicDMP,
    RhythmicFeatures,
    Smooth,
    Trajectory,
    TrimRest,
    kernels,
)
from kineme.dmp import Contextual
from kineme.dmp.control.plan import ObstacleAvoidance
from kineme.errors import KinemeError
from kineme.kernels.random_binning import RandomBinning
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition.early.hypotheses import Early
from kineme.similarity.specification import Representation
from kineme.styles import AveragePrimitive, average
from soaking import SOAK

WRONG = (
    None, math.nan, math.inf, -math.inf, -1, 0, 10**9, 10**30, 10**400, 1e-320, 1e-200, 1e160, 1e300, 1e308, -1e308,
    0.5, True, False, "x", "", b"x", 1j, object(), [], (), {}, [1.0], [math.nan], [[1, 2], [3]], ["a", "b"],
    [None, None], np.zeros((2, 2)), np.zeros((3, 2)), np.zeros(0), np.array("a"), np.array([1, 2], dtype=object),
    np.int32(3), np.float32(3), np.datetime64("2020-01-01"), [1e308, -1e308], [1e160, 1.0], [1e-320, 1.0],
)  # fmt: skip


@cache
def _demos():
    paths = [np.cumsum(np.cumsum(np.random.default_rng(i).normal(size=(40, 2)), 0), 0) for i in range(6)]
    return Demonstrations.from_arrays(paths, list("aabbcc"), [np.linspace(0.0, 1.0, 40)] * 6)


@cache
def _wave():
    t = np.linspace(0.0, 3.0, 150)
    return [Trajectory(t, np.column_stack((np.sin(7 * t), np.cos(7 * t))))]


@cache
def _primitive(formulation="bio-inspired"):
    return DMP(formulation, n_basis=8, n_points=40).learn(_demos())[0]


@cache
def _rhythm():
    return RhythmicDMP().learn(_wave())


@cache
def _recognizer():
    return Recognizer().fit(_demos())


@cache
def _long():
    t = np.linspace(0.0, 5.0, 200)
    return Trajectory(t, np.clip(t - 2.0, 0.0, 1.0)[:, None] * [1.0, 2.0])


def _finite(*arrays):
    assert all(np.isfinite(array).all() for array in arrays)


def _roll(primitive):
    def use(**wish):
        made = primitive().rollout(**wish)
        _finite(made.times, made.positions, made.velocities, made.accelerations)

    return use


def _control(formulation, told):
    def use(**wish):
        options = (
            {"goal_filter": 0.1, "velocity_limit": 1.0, "acceleration_limit": 1.0} if told else {"dt": 0.01} | wish
        )
        controller = _primitive(formulation).controller(**({"dt": 0.01} | options))
        controller.step(**(wish if told else {"obstacles": [[0.1, 0.2]]}))
        state = controller.step()
        _finite(state.position, state.velocity, state.acceleration, state.time)

    return use


def _avoid(**wish):
    _control("bio-inspired", told=False)(avoidance=ObstacleAvoidance(**wish))


def _recognize(**wish):
    recognizer = Recognizer(**wish).fit(_demos())
    _finite(recognizer.decision_function(_demos()), recognizer.p_values(_demos()))


def _look(**wish):
    _recognize(representations=(Representation(**({"quantity": "forcing", "arc_share": 0.5} | wish)),))


def _gram(kernel):
    def use(**wish):
        _finite(kernel(**wish)(np.random.default_rng(0).normal(size=(6, 8))))

    return use


def _averaged(**wish):
    return kernels.averaged(**({"kernel": kernels.RBF(1.0), "n_dims": 2} | wish))


def _rhythmic_controller(**wish):
    controller = _rhythm().controller(**({"dt": 0.01} | wish))
    state = controller.step()
    _finite(state.position, state.velocity, state.acceleration, state.time)


@cache
def _average():
    return average(DMP(n_basis=8, n_points=40).learn(_demos()))


def _condition(**wish):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kineme.errors.ExtrapolationWarning)
        made = _average().condition(**({"t": 0.5, "position": [1.0, 2.0]} | wish))
    _finite(made.primitive.rollout().positions, made.factor, made.deviation())


def _task(**wish):
    model = Contextual(DMP(n_basis=8, n_points=40)).fit(_demos(), [1, 2, 3, 4, 5, 7])
    _finite(model.primitive(**wish).rollout().positions)


def _improve(**wish):
    def cost(rollout):
        return np.abs(rollout.positions[:, 1]).sum(axis=1)

    found = kineme.improve(**({"primitive": _primitive(), "cost": cost, "updates": 2, "rollouts": 6} | wish))
    _finite(found.primitive.scaled_weights, found.costs)


def _names(function):
    return [
        one.name
        for one in inspect.signature(function).parameters.values()
        if one.name != "self" and one.kind != one.VAR_KEYWORD
    ]


_ROLLOUT = ["start", "goal", "duration", "velocity", "rate", "n_samples", "settle"]
_STEP = ["position", "velocity", "goal", "tempo", "coupling", "obstacles", "obstacle_velocities", "dt"]
_CONTROLLER = [
    "dt", "start", "goal", "duration", "velocity", "feedback", "phase_stopping", "goal_filter", "velocity_limit",
    "acceleration_limit", "avoidance", "settle",
]  # fmt: skip
USES = {
    "DMP": (lambda **wish: _roll(lambda: DMP(**wish).learn(_demos())[0])(), _names(DMP)),
    "RhythmicDMP": (
        lambda **wish: _finite(RhythmicDMP(**wish).learn(_wave()).rollout().positions),
        _names(RhythmicDMP),
    ),
    "Smooth": (lambda **wish: kineme.preprocess(_demos(), [Smooth(**wish)]), ["cutoff"]),
    "TrimRest": (lambda **wish: kineme.preprocess(_demos(), [TrimRest(**wish)]), ["tolerance"]),
    "Resample": (lambda **wish: kineme.preprocess(_demos()[:1], [Resample(**wish)]), ["n_points"]),
    "preprocess": (lambda **wish: kineme.preprocess(_demos(), **wish), ["steps"]),
    "rollout": (_roll(_primitive), _ROLLOUT),
    "original rollout": (_roll(lambda: _primitive("original")), _ROLLOUT),
    "rhythmic rollout": (
        lambda **wish: _finite(_rhythm().rollout(**wish).positions),
        ["n_periods", "baseline", "start", "velocity", "period", "amplitude", "phase", "rate", "n_samples"],
    ),
    "forcing": (lambda **wish: _finite(_primitive().forcing(**wish)), ["n_samples"]),
    "shape_attractor": (lambda **wish: _finite(_primitive().shape_attractor(**wish)), ["n_samples"]),
    "controller": (_control("bio-inspired", told=False), _CONTROLLER),
    "original controller": (_control("original", told=False), _CONTROLLER),
    "rhythmic controller": (
        _rhythmic_controller,
        ["dt", "phase", "period", "amplitude", "baseline", "start", "velocity", *_CONTROLLER[5:-1]],
    ),
    "phase stopping": (
        lambda **wish: _control("bio-inspired", told=False)(feedback="phase", **wish),
        ["phase_stopping"],
    ),
    "step": (_control("bio-inspired", told=True), _STEP),
    "original step": (_control("original", told=True), _STEP),
    "ObstacleAvoidance": (_avoid, ["gamma", "beta", "reach"]),
    "Recognizer": (_recognize, _names(Recognizer)),
    "Representation": (_look, _names(Representation)),
    "recognize": (lambda **wish: _recognizer().recognize(_demos(), **wish), ["error_rate"]),
    "predict": (lambda **wish: _recognizer().predict(**wish), ["X"]),
    "spot": (lambda **wish: _recognizer().spot(_long(), **wish), ["error_rate", "max_pieces"]),
    "stream": (lambda **wish: _recognizer().stream(**wish), ["confidence", "patience", "early"]),
    "update": (lambda **wish: _recognizer().stream().update(**({"t": 0.0, "x": [0, 0]} | wish)), ["t", "x"]),
    "predict_partial": (lambda **wish: _recognizer().predict_partial(_demos(), **wish), ["early"]),
    "Early": (lambda **wish: _recognizer().predict_partial(_demos(), Early(**wish)), _names(Early)),
    "Perturbation": (lambda **wish: _finite(Perturbation(**wish).apply(_demos(), 0).positions), _names(Perturbation)),
    "seed": (lambda **wish: Perturbation(noise=0.1).apply(_demos(), **wish), ["seed"]),
    "rest": (lambda **wish: kineme.segment(_long(), "rest", **wish), ["speed", "min_rest", "min_movement", "cover"]),
    "speed": (lambda **wish: kineme.segment(_long(), "speed", **wish), ["depth", "turn", "span", "min_movement"]),
    "change-points": (
        lambda **wish: kineme.segment(_long(), "change-points", **wish),
        ["penalty", "n_pieces", "n_points"],
    ),
    "segment": (lambda **wish: kineme.segment(**({"recording": _long()} | wish)), ["recording", "by"]),
    "from_arrays": (
        lambda **wish: Demonstrations.from_arrays(**({"arrays": [np.eye(5)] * 2} | wish)),
        ["arrays", "labels", "times", "names"],
    ),
    "Trajectory": (
        lambda **wish: repr(Trajectory(**({"times": np.arange(5), "positions": np.eye(5)} | wish))),
        ["times", "positions", "name"],
    ),
    "choose": (lambda **wish: _finite(DMP().choose(**({"movements": _demos()} | wish)).error), _names(DMP.choose)),
    "condition": (_condition, _names(AveragePrimitive.condition)),
    "condition velocity": (
        lambda **wish: _condition(**({"position": None, "velocity": [1, 0]} | wish)),
        ["velocity", "velocity_std", "t"],
    ),
    "log_likelihood": (
        lambda **wish: _finite(_average().log_likelihood(**({"movements": _demos()} | wish))),
        ["movements", "noise"],
    ),
    "blend": (
        lambda **wish: _average().blend(**({"other": _average(), "activation": 0.5} | wish)),
        ["other", "activation"],
    ),
    "Contextual": (lambda **wish: Contextual(**wish).fit(_demos(), [1, 2, 3, 4, 5, 7]), _names(Contextual)),
    "fit Contextual": (
        lambda **wish: Contextual().fit(**({"movements": _demos(), "parameters": [1, 2, 3, 4, 5, 7]} | wish)),
        ["movements", "parameters"],
    ),
    "of a task": (_task, ["parameters"]),
    "improve": (_improve, sorted(set(_names(kineme.improve)) - {"updates", "progress"})),
    "ActionLibrary": (ActionLibrary, ["folder"]),
    "RBF": (_gram(kernels.RBF), ["sigma"]),
    "TruncatedEuclidean": (_gram(kernels.TruncatedEuclidean), ["m", "sigma"]),
    "averaged": (_gram(_averaged), ["kernel", "n_dims", "mean"]),
    "RandomBinning": (
        lambda **wish: RandomBinning(**wish).fit_transform(np.random.default_rng(0).normal(size=(6, 8))),
        ["m", "sigma", "n_shifts", "seed"],
    ),
    "DMPFeatures": (lambda **wish: DMPFeatures(**wish).fit_transform(_demos()), _names(DMPFeatures)),
    "RhythmicFeatures": (lambda **wish: RhythmicFeatures(**wish).fit_transform(_wave()), _names(RhythmicFeatures)),
}


@pytest.mark.parametrize(
    ("k", "use", "name"),
    [(k, *both) for k, both in enumerate((use, name) for use, (_, names) in USES.items() for name in names)],
)
def test_what_cannot_be_is_refused_with_a_reason(k, use, name):
    """Each parameter with a third of the values, each value with a third of the parameters; `make soak` tries all."""
    for value in WRONG if SOAK else WRONG[k % 3 :: 3]:
        try:
            USES[use][0](**{name: value})
        except KinemeError:
            continue
        except Exception as error:
            raise AssertionError(f"{use}({name}={value!r})") from error


@pytest.mark.parametrize("folder", ["", " ", "\n", "a\0b", None, 3])
def test_a_library_without_a_name_is_refused(folder):
    """An empty text would be the current folder."""
    with pytest.raises(KinemeError, match=r"expected the folder of a library, got .*; the current one is"):
        ActionLibrary(folder, create=True)


@pytest.mark.parametrize("power", [16, 19, 40, 90, -19, -30])
def test_movements_that_keep_a_size_of_which_single_precision_makes_nothing_are_refused(power):
    demos = [one.positions * 10.0**power for one in _demos()]
    assert Recognizer().fit(demos, list("aabbcc")).predict(demos).tolist() == list("aabbcc")
    with pytest.raises(KinemeError, match=r'expected movements of 1e-15 to 1e\+15 in their unit with scale="none"'):
        Recognizer(scale="none").fit(demos, list("aabbcc"))
