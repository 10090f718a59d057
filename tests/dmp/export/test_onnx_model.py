"""The decode matrix as an ONNX model, run by onnxruntime beside the rollout."""

import json

import numpy as np
import pytest

import kineme
from kineme.dmp import onnx_model
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError

onnx = pytest.importorskip("onnx", reason="the extra onnx is not installed")
onnxruntime = pytest.importorskip("onnxruntime", reason="onnxruntime runs the models")


def session(model):
    return onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])


def run(model, double, **inputs):
    number = np.float64 if double else np.float32
    return session(model).run(None, {name: np.asarray(value, dtype=number) for name, value in inputs.items()})


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa(["GShape"])


@pytest.mark.parametrize(("double", "tolerance"), [(True, 1e-12), (False, 1e-6)], ids=["64 bits", "32 bits"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_movements_are_those_of_the_rollout(demos, formulation, double, tolerance):
    primitive = kineme.DMP(formulation).learn(demos)[0]
    shift = np.random.default_rng(3).normal(size=(2, 5, 2))
    extent = primitive.extents.max()
    start, goal = primitive.starts + 0.1 * extent * shift[0], primitive.goals + 0.2 * extent * shift[1]
    expected = primitive.rollout(start, goal)
    positions, velocities = run(onnx_model(primitive, double=double), double, start=start, goal=goal)
    assert positions.shape == (5, primitive.dmp.n_points, 2)
    assert np.abs(positions - expected.positions).max() <= tolerance * np.abs(expected.positions).max()
    per_duration = expected.velocities * primitive.durations[0]
    assert np.abs(velocities - per_duration).max() <= tolerance * np.abs(per_duration).max()


def test_weights_and_velocities_may_be_given(demos):
    """As a policy does that says weights: of as many movements as goals, or of one for all."""
    primitives = kineme.DMP("decoupled", n_basis=20).learn(demos)
    model = onnx_model(primitives[0], double=True)
    velocity = primitives.velocities * primitives.durations[:, None]
    batch = {"start": primitives.starts, "goal": primitives.goals, "weights": primitives.scaled_weights}
    positions, _ = run(model, True, **batch, velocity=velocity)
    np.testing.assert_allclose(positions, primitives.rollout().positions, rtol=0, atol=1e-12 * positions.max())
    twice, _ = run(model, True, start=primitives.starts[:1], goal=primitives.goals[:3], weights=batch["weights"][:1])
    expected = primitives[0].rollout(primitives.starts[0], primitives.goals[:3]).positions
    np.testing.assert_allclose(twice, expected, rtol=0, atol=1e-12 * positions.max())


def test_closed_movements_keep_their_size_where_amplitudes_scale():
    angle = np.linspace(0, 2 * np.pi, 60)
    circle = kineme.DMP("amplitude-scaled", n_basis=20).learn([np.column_stack((np.cos(angle), np.sin(angle)))])[0]
    positions, _ = run(onnx_model(circle, double=True), True, start=circle.starts, goal=circle.goals + 0.5)
    np.testing.assert_allclose(positions, circle.rollout(goal=circle.goals + 0.5).positions, rtol=0, atol=1e-12)


def test_what_the_model_says_of_itself(demos):
    primitive = kineme.DMP().learn(demos)[0]
    model = onnx.load_from_string(onnx_model(primitive))
    assert (model.ir_version, [(each.domain, each.version) for each in model.opset_import]) == (8, [("", 17)])
    metadata = {entry.key: json.loads(entry.value) for entry in model.metadata_props}
    assert metadata == {
        "start": primitive.starts[0].tolist(), "goal": primitive.goals[0].tolist(),
        "duration": primitive.durations[0], "columns": ["x", "y"],
    }  # fmt: skip


def test_the_original_formulation_needs_a_goal_elsewhere():
    u = np.linspace(0, 1, 60)
    flat = kineme.DMP("original", n_basis=10).learn([np.column_stack((u, np.zeros(60)))])[0]
    with pytest.raises(SpecificationError, match="bio-inspired"):
        onnx_model(flat)
