"""On a GPU everything is what it is on the processor, and nothing waits for the processor meanwhile."""

from __future__ import annotations

from functools import partial

import pytest

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from tensor_movements import FORMULATIONS, module, tensors  # noqa: E402 - after the package that may be missing

from kineme.kernels import TruncatedEuclidean, averaged  # noqa: E402
from kineme.torch import ActionChunk, gram, similarity  # noqa: E402

KERNEL = averaged(TruncatedEuclidean(m=1.0, sigma=1.0), n_dims=2, mean="geometric")


@pytest.fixture(params=["cpu", "cuda"])
def device(request):
    return request.getfixturevalue("gpu") if request.param == "cuda" else "cpu"


@pytest.fixture
def gpu():
    if not torch.cuda.is_available():
        pytest.skip("no GPU for PyTorch")
    return "cuda"


def everything(mp, weights, other, start, goal, velocity, at, factor):
    """Results of all functions, each of a batch of movements."""
    chol = 0.1 * factor.tril(-1) + torch.diag_embed(0.5 + factor.diagonal(dim1=-2, dim2=-1).abs())
    path, speed, acceleration = mp(weights, start, goal, velocity=velocity, derivative=(0, 1, 2))
    again = mp.replan(other, at=at, position=start, velocity=velocity, goal=goal)
    expected, covariance = mp.distribution(weights, chol, start, goal)
    return {
        "path": path,
        "velocity": speed,
        "acceleration": acceleration,
        "slower": mp(weights, start, goal, duration=1.5 * mp.duration),
        "state": torch.cat(mp.state(0.2, weights, start, goal)),
        "replanned": again,
        "goes on": mp.replan(weights, at=at, position=start, velocity=velocity, goal=goal, start=start, derivative=1),
        "learned": torch.cat([part.flatten() for part in mp.encode(again)]),
        "initial velocity": mp.initial_velocity(again),
        "expected": expected,
        "covariance": covariance,
        "density": mp.log_prob(path + 0.1, weights, chol, noise=0.3),
        "similarity": similarity(path, again),
        "gram": gram(KERNEL, weights.flatten(1), other.flatten(1)),
    }


def actions(chunk, weights, other, start, goal, velocity, at, factor):
    """The same of a layer of actions."""
    outputs = torch.cat((weights.flatten(1), goal), dim=-1)
    return {"actions": chunk(outputs, start, velocity), "encoded": chunk.encode(chunk(outputs, start))}


def _numbers(n=5, d=2):
    numbers = tensors((n, d, 6), (n, d, 6), (n, d), (n, d), (n, d), (n,), (n, d * 6, d * 6))
    return [*numbers[:5], 0.1 + 0.4 * numbers[5].sigmoid(), numbers[6]]


def _results(what="original", **options):
    """A function of the numbers, of a formulation or of a layer of actions."""
    chosen = (actions, ActionChunk(module(**options))) if what == "actions" else (everything, module(what, **options))
    return partial(*chosen)


def assert_close(results, expected, tolerance):
    """Each result is the expected one within `tolerance` of its largest number."""
    assert results.keys() == expected.keys()
    for name, part in expected.items():
        assert torch.allclose(results[name], part, atol=tolerance * float(part.abs().max()), rtol=0), name


def _moved(numbers, device, dtype):
    return [part.to(device, dtype).requires_grad_() for part in numbers]


@pytest.mark.parametrize(
    ("device", "dtype", "tolerance"),
    [("cpu", torch.float32, 2e-3), ("cuda", torch.float32, 2e-3), ("cuda", torch.float64, 1e-9)],
    indirect=["device"],
    ids=repr,
)
@pytest.mark.parametrize("what", [*FORMULATIONS, "actions"])
def test_results_and_gradients_are_those_of_the_processor(device, what, dtype, tolerance):
    numbers = _numbers()
    found, slopes = [], []
    for where, precision in (("cpu", torch.float64), (device, dtype)):
        leaves = _moved(numbers, where, precision)
        results = _results(what, device=where, dtype=precision)(*leaves)
        assert {part.device.type for part in results.values()} == {where}
        found.append({name: part.detach().cpu().double() for name, part in results.items()})
        sizes = {name: float(part.abs().max()) for name, part in found[0].items()}
        loss = sum((part / sizes[name]).square().sum() for name, part in results.items())
        gradients = torch.autograd.grad(loss, leaves, allow_unused=what == "actions")
        slopes.append([slope.cpu().double() for slope in gradients if slope is not None])
    assert_close(found[1], found[0], tolerance)
    assert_close(*(dict(enumerate(parts)) for parts in reversed(slopes)), 5 * tolerance)


def test_samples_are_drawn_there(device):
    mp = module(device=device)
    mean, _, start, goal, *_ = (part.to(device) for part in _numbers())
    chol = 0.1 * torch.eye(12, dtype=mean.dtype, device=device).expand(5, 12, 12)
    generator = torch.Generator(device).manual_seed(0)
    drawn, expected = mp.sample(4000, mean, chol, start, goal, generator=generator), mp(mean, start, goal)
    assert drawn.device.type == device
    spread = float(drawn.std(dim=0).max())
    assert torch.allclose(drawn.mean(dim=0), expected, atol=5 * spread / 4000**0.5)


@pytest.mark.parametrize("what", [*FORMULATIONS, "actions"])
def test_the_processor_waits_for_nothing_and_a_graph_repeats_it(gpu, what):
    """What is captured as a CUDA graph neither looks at values nor copies any to the device."""
    work, numbers = _results(what, device=gpu), [part.to(gpu) for part in _numbers()]
    with torch.no_grad():
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                work(*numbers)  # what is made once is made now
        torch.cuda.current_stream().wait_stream(stream)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            results = work(*numbers)
        for part, other in zip(numbers, _numbers(), strict=True):
            part.copy_(0.7 * other)
        graph.replay()
        expected = work(*numbers)
    assert_close(results, expected, 1e-9)


@pytest.mark.filterwarnings("ignore")  # the compiler is warned by PyTorch itself
@pytest.mark.parametrize("what", ["bio-inspired", "original", "actions"])
def test_what_is_compiled_for_it_is_the_same(gpu, what):
    work, numbers = _results(what, device=gpu), [part.to(gpu) for part in _numbers()]
    assert_close(torch.compile(work, fullgraph=True)(*numbers), work(*numbers), 1e-9)
