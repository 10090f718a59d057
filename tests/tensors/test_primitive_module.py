"""A primitive as a module of PyTorch has the numbers of NumPy's, gradients, and works where tensors have no values."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import kineme
from kineme.errors import DegenerateMovementError, SpecificationError, TrajectoryError

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from hypothesis import given, settings  # noqa: E402 - after the package that may be missing
from hypothesis import strategies as st  # noqa: E402
from tensor_movements import FORMULATIONS, learned, module, tensors  # noqa: E402
from torch.autograd import gradcheck  # noqa: E402
from torch.func import jacrev, vmap  # noqa: E402

ORDERS = ("positions", "velocities", "accelerations")


@pytest.mark.parametrize("gating", ["none", "phase"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_movements_are_those_of_numpy(formulation, gating):
    primitives = learned(formulation, gating=gating)
    goals, velocities = np.array([[1.5, 0.2], [0.4, 2.0], [-1.0, 1.0]]), np.array([0.3, -0.2])
    for dtype, tolerance in ((torch.float64, 1e-12), (torch.float32, 1e-5)):
        mp = kineme.torch.Primitive.of(primitives, dtype=dtype)
        for options in ({"duration": 0.5}, {"goal": goals}, {"goal": goals, "velocity": velocities, "duration": 0.5}):
            expected = primitives.rollout(**options)
            given_tensors = {name: torch.tensor(value) for name, value in options.items()}
            for name, path in zip(ORDERS, mp(**given_tensors, derivative=(0, 1, 2)), strict=True):
                assert path.dtype == dtype
                size = np.abs(getattr(expected, name)).max()
                assert np.abs(path.numpy() - getattr(expected, name)).max() <= tolerance * size
        assert torch.allclose(mp.times.double(), torch.tensor(primitives.rollout().times), atol=1e-6)


@pytest.mark.parametrize("fit", ["trajectory", "forcing"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_learning_is_that_of_numpy(formulation, fit):
    positions = learned(formulation).rollout(n_samples=90).positions
    times = [np.linspace(0.0, 1.7, 90)] * 3
    expected = kineme.DMP(formulation, n_basis=8, fit=fit).learn(
        kineme.Demonstrations.from_arrays(positions, times=times)
    )
    for dtype, tolerance in ((torch.float64, 1e-12), (torch.float32, 1e-5)):
        mp = kineme.torch.Primitive.of(expected, n_samples=90, dtype=dtype)
        weights, goals = mp.encode(torch.tensor(positions, dtype=dtype))
        w = expected.weights.transpose(0, 2, 1)
        if formulation == "amplitude-scaled":  # per distance
            w = w / np.linalg.norm(expected.goals - expected.starts, axis=1)[:, None, None]
        assert np.abs(weights.numpy() - w).max() <= tolerance * np.abs(w).max()
        assert np.allclose(goals.numpy(), expected.goals, atol=tolerance)
        v = mp.initial_velocity(torch.tensor(positions, dtype=dtype)).numpy()
        assert np.abs(v - expected.velocities).max() <= tolerance * np.abs(expected.velocities).max()


@given(
    st.sampled_from(FORMULATIONS),
    st.integers(1, 4),
    st.integers(3, 9),
    st.lists(st.integers(1, 3), max_size=2),
    st.sampled_from([15.0, 25.0, 400.0]),
)
@settings(max_examples=8, deadline=None)
def test_what_is_learned_moves_as_numpy_has_it_in_any_shape(formulation, d, n, batch, stiffness):
    mp = module(formulation, d, n_weights=n, stiffness=stiffness, rate=80.0, n_points=60)
    weights, start, goal, velocity = tensors((*batch, d, n), (*batch, d), (*batch, d), (*batch, d))
    goal = start + 0.5 + goal.abs()
    path = mp(weights, start, goal, velocity=velocity)
    assert path.shape == (*batch, 57, d)
    assert torch.allclose(path[..., 0, :], start)
    again, arrival = mp.encode(path)
    repeated = mp(again, start, arrival, velocity=mp.initial_velocity(path))
    demos = path.reshape(-1, 57, d).numpy()
    expected = mp.dmp.learn(demos).rollout(n_samples=57).positions
    assert np.abs(repeated.reshape(-1, 57, d).numpy() - expected).max() <= 1e-12 * np.abs(expected).max()


def test_one_primitive_has_many_goals_and_a_learned_state_is_saved():
    mp = kineme.torch.Primitive.of(learned(n=1), dtype=torch.float64)
    assert mp(goal=torch.ones(4, 5, 2)).shape == (4, 5, 50, 2)
    assert set(mp.state_dict()) == {"weights", "start", "goal", "velocity", "duration"}
    assert not module().state_dict()
    assert not list(mp.parameters())
    other = kineme.torch.Primitive.of(learned(n=1, d=2), dtype=torch.float64)
    other.load_state_dict({name: 2 * value for name, value in mp.state_dict().items()})
    assert torch.equal(other.weights, 2 * mp.weights)
    assert torch.equal(copy.deepcopy(mp)(), mp())


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_gradients(formulation):
    mp = module(formulation)
    weights, start, goal, velocity = tensors((2, 2, 6), (2, 2), (2, 2), (2, 2), grad=True)
    duration = torch.tensor([0.6, 0.9], dtype=torch.float64, requires_grad=True)

    def rates(w, x, g, v, tau):
        return mp(w, x, g, velocity=v, duration=tau, derivative=1)[:, ::9]

    assert gradcheck(rates, (weights, start, goal, velocity, duration), fast_mode=True)
    path = mp(weights, start, goal, velocity=velocity).detach().requires_grad_()
    assert gradcheck(lambda p: (*mp.encode(p), mp.initial_velocity(p)), (path,), fast_mode=True)


def test_functions_are_mapped_and_differentiated_by_torch_func():
    mp = module()
    weights, start, goal = tensors((4, 2, 6), (4, 2), (4, 2))
    assert torch.allclose(vmap(mp)(weights, start, goal), mp(weights, start, goal), atol=1e-14)
    assert torch.allclose(vmap(mp.encode)(mp(weights, start, goal))[0], mp.encode(mp(weights, start, goal))[0])
    jacobian = jacrev(mp)(weights[0], start[0], goal[0])
    assert jacobian.shape == (29, 2, 2, 6)
    assert torch.allclose(jacobian[:, 1, 1], mp.decode_matrix[0, :6].mT)
    assert not jacobian[:, 0, 1].any()


@pytest.mark.soak
def test_compiled_and_exported_modules_are_the_module():
    mp = module("original")
    weights, start, goal, velocity = tensors((4, 2, 6), (4, 2), (4, 2), (4, 2))

    def all_of_it(w, x, g, v):
        path = mp(w, x, g, velocity=v)
        return path, *mp(w, x, g, velocity=v, derivative=(1, 2)), *mp.encode(path)

    compiled = torch.compile(all_of_it, backend="aot_eager", fullgraph=True)
    numbers = (weights, start, goal, velocity)
    assert all(map(torch.equal, compiled(*numbers), all_of_it(*numbers)))
    batch = torch.export.Dim("batch")
    exported = torch.export.export(mp, (weights, start, goal), dynamic_shapes=[{0: batch}] * 3)
    assert torch.equal(exported.module()(weights[:3], start[:3], goal[:3]), mp(weights[:3], start[:3], goal[:3]))


@pytest.mark.filterwarnings("ignore")  # the exporter is warned by PyTorch itself
def test_a_module_is_exported_to_onnx(tmp_path):
    pytest.importorskip("onnxscript", reason="onnxscript, with which PyTorch writes ONNX, is not installed")
    onnxruntime = pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")
    mp, names = module("original", dtype=torch.float32), ("weights", "start", "goal")
    numbers = [part.float() for part in tensors((4, 2, 6), (4, 2), (4, 2))]
    shapes, path = ({0: "batch"},) * 3, tmp_path / "movements.onnx"
    torch.onnx.export(mp, tuple(numbers), path, dynamo=True, dynamic_shapes=shapes, input_names=names, verbose=False)
    some = {name: part[:3] for name, part in zip(names, numbers, strict=True)}
    exported = onnxruntime.InferenceSession(path).run(None, {name: part.numpy() for name, part in some.items()})[0]
    assert np.allclose(exported, mp(**some).numpy(), atol=1e-5)


def test_nothing_looks_at_values():
    """On the device meta there are none."""
    mp = module(device="meta", dtype=torch.float32)

    def empty(*shape):
        return torch.empty(shape, device="meta")

    numbers = empty(5, 2, 6), empty(5, 2), empty(5, 2)
    path = mp(*numbers, velocity=empty(5, 2), duration=empty(5), derivative=1)
    assert (path.shape, path.device.type) == ((5, 29, 2), "meta")
    assert mp.encode(path)[0].shape == (5, 2, 6)
    assert [part.shape for part in mp.state(0.2, *numbers)] == [(5, 2), (5, 2)]
    state = {"position": empty(5, 2), "velocity": empty(5, 2), "goal": empty(5, 2)}
    assert mp.replan(empty(5, 2, 6), at=empty(5), **state).shape == (5, 29, 2)
    chol = empty(5, 12, 12)
    assert [part.shape for part in mp.distribution(numbers[0], chol, *numbers[1:])] == [(5, 29, 2), (5, 29, 2, 2)]
    assert mp.log_prob(path, numbers[0], chol).shape == (5,)
    assert mp.sample(3, numbers[0], chol, *numbers[1:]).shape == (3, 5, 29, 2)


def test_matrices_are_exact_in_the_precision_that_a_module_is_converted_to():
    exact = module()
    for converted in (module(dtype=torch.float32).double(), module(device="meta").to_empty(device="cpu")):
        for name, matrix in exact.named_buffers():
            if name != "duration":
                assert torch.equal(converted.get_buffer(name), matrix), name
    assert exact.float().decode_matrix.dtype == torch.float32


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_weights_mean_the_same_at_another_rate(formulation):
    mp = module(formulation)
    weights, start, goal = tensors((4, 2, 6), (4, 2), (4, 2))
    fine = mp.at_rate(1000.0)
    assert torch.allclose(fine(weights, start, goal)[:, ::25], mp(weights, start, goal), atol=1e-11)
    primitives = learned(formulation)
    mp = kineme.torch.Primitive.of(primitives, dtype=torch.float64).at_rate(70.0, 1.3)
    expected = primitives.rollout(duration=1.3, rate=70.0)
    assert np.allclose(mp(derivative=1).numpy(), expected.velocities, atol=1e-11)
    assert torch.equal(mp(derivative=(0, 1))[1], mp(derivative=1))


def test_the_shapes_of_all_inputs_broadcast():
    primitive = module()
    w, x, g, v = tensors((2, 6), 2, 2, 2)
    tau, several = torch.linspace(1, 2, 5, dtype=torch.float64), torch.stack([x] * 5)
    paths = primitive(w, x, g, duration=tau, derivative=(0, 1, 2))
    for path, at_one in zip(paths, primitive(w, x, g, duration=2.0, derivative=(0, 1, 2)), strict=True):
        assert path.shape == (5, primitive.n_samples, 2)
        torch.testing.assert_close(path[4], at_one)
    again = primitive.replan(w, at=0.3, goal=g, position=x, velocity=v, duration=2.0)
    torch.testing.assert_close(primitive.replan(w, at=0.3, goal=g, position=x, velocity=v, duration=tau)[4], again)
    many = primitive.replan(w, at=0.3, goal=g, position=several, velocity=v, duration=2.0)
    torch.testing.assert_close(many[4], again)
    position, velocity = primitive.state(0.3, w, x, g, duration=tau)
    assert position.shape == velocity.shape == (5, 2)
    with pytest.raises(RuntimeError, match="size"):
        kineme.torch.Primitive.of(learned(n=7))(duration=tau)


def test_inputs_of_another_precision_are_converted():
    primitive = module(dtype=torch.float32)
    w, x, g, chol = tensors((2, 6), 2, 2, (12, 12))
    positions = primitive(w, x, g).double()
    assert {each.dtype for each in primitive.encode(positions)} == {torch.float32}
    assert primitive.log_prob(positions, w, chol.tril()).dtype == torch.float32


def test_what_cannot_be_used_is_refused():
    mp = module()
    weights, start, goal = tensors((4, 2, 6), (4, 2), (4, 2))
    with pytest.raises(SpecificationError, match="got RhythmicPrimitives"):
        kineme.torch.Primitive.of(kineme.RhythmicDMP().learn([np.sin(np.linspace(0, 20, 200))]))
    loop = np.stack([np.cos(np.linspace(0, 2 * np.pi, 50)), np.sin(np.linspace(0, 2 * np.pi, 50))], axis=-1)
    with pytest.raises(
        DegenerateMovementError, match="trajectory 0: expected a movement that does not end where it st"
    ):
        kineme.torch.Primitive.of(kineme.DMP("amplitude-scaled").learn([loop]))
    with pytest.raises(DegenerateMovementError, match="g != x0"):
        kineme.torch.Primitive.of(kineme.DMP("original").learn([np.sin(np.linspace(0, 2 * np.pi, 50))]))
    with pytest.raises(SpecificationError, match="two samples in each time constant"):
        module(rate=4.0)
    with pytest.raises(SpecificationError, match="expected duration"):
        module(duration=0.0)
    with pytest.raises(TrajectoryError, match=r"expected weights \(..., 2, 6\), got \(4, 6, 2\)"):
        mp(weights.mT, start, goal)
    with pytest.raises(SpecificationError, match=r"expected goal, got none; only Primitive.of"):
        mp(weights, start)
    with pytest.raises(SpecificationError, match="expected derivative to be 0, 1 or 2, got 3"):
        mp(weights, start, goal, derivative=3)
    with pytest.raises(SpecificationError, match="expected derivative to be 0, 1 or 2, got 3"):
        mp.replan(weights, at=0.2, position=start, velocity=start, goal=goal, derivative=3)
    with pytest.raises(TrajectoryError, match=r"expected positions \(..., 29, 2\), got \(30, 2\); kineme.Resample"):
        mp.encode(torch.zeros(30, 2))
    with pytest.raises(SpecificationError, match="expected no preprocessing"):
        module(preprocessing=(kineme.TrimRest(),)).encode(torch.zeros(29, 2))


def test_the_chapter_is_not_the_package():
    assert kineme.torch is not torch
    assert issubclass(kineme.torch.Primitive, torch.nn.Module)


def test_without_the_package_the_extra_is_named():
    import subprocess
    import sys

    code = (
        "import sys; sys.modules['torch'] = None\nimport kineme\ntry:\n    kineme.torch.Primitive\n"
        "except kineme.errors.DataError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "expected the package torch to compute with tensors; pip install 'kineme[torch]'"
