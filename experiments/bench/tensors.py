"""Primitives as modules of PyTorch beside ProDMPs of MP_PyTorch: rollouts, gradients, learning, replanning.

Both have seven dimensions, 25 weights each and 201 samples, in single precision. A rollout is positions and velocities;
gradients are those of their squares in all weights. Both run on one thread: on a busy machine, a second one that has to
be woken takes longer than most of this work. Where a package is missing, nothing is measured, and it says so.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import kineme
from bench.rows import Row
from bench.timing import medians

DIMS, N, RATE, DURATION, BATCH = 7, 25, 100.0, 2.0, 1024
PRODMP = {
    "num_basis": N, "basis_bandwidth_factor": 3, "num_basis_outside": 0, "alpha_phase": 3, "alpha": 25, "dt": 0.01
}  # fmt: skip
PEER = "MP_PyTorch ProDMP"


def measure(quick: bool) -> list[Row]:
    """Rows of one movement and of a batch; targets are how many times faster ours is."""
    missing = [name for name in ("torch", "mp_pytorch") if not find_spec(name)]
    if missing:
        print(f"not measured: {' and '.join(missing)} not installed", file=sys.stderr)
        return []
    import torch

    torch.set_num_threads(1)
    batch = 64 if quick else BATCH
    rows = [*_rows(1, 5 if quick else 15, (20.0, 20.0, 20.0)), *_rows(batch, 2 if quick else 7, (20.0, 10.0, 500.0))]
    return [*rows, *_arrays_row(batch, 5 if quick else 20)]


def _rows(n: int, repeats: int, targets: tuple[float, float, float]) -> list[Row]:
    works, theirs = ours(n), _theirs(n)
    rows = []
    for (name, work), target in zip(works.items(), targets, strict=True):
        few = name == "learning" and n > 1  # a peer's takes half a minute
        calls = 20 if n == 1 else 1  # of a tenth of a millisecond: what a cold start costs is not what is asked
        rivals = {who: _repeated(one, calls) for who, one in (("ours", work), (PEER, theirs[name]))}
        seconds = medians(rivals, 1 if few else repeats, warm_up=0 if few else 2)
        if few:
            seconds["ours"] = medians({"ours": work}, repeats)["ours"]
        ms, peer_ms = 1e3 * seconds["ours"] / calls, 1e3 * seconds[PEER] / calls
        rows.append(Row(f"{name}, {n} at once", "ms", ms, peer_ms, PEER, peer_ms / ms, (">=", target)))
    return rows


def _repeated(work: Callable[[], object], calls: int) -> Callable[[], object]:
    def several() -> None:
        for _ in range(calls):
            work()

    return several


def numbers(n: int, device: str = "cpu") -> tuple[Any, ...]:
    """Weights, starts and goals."""
    import torch

    generator = torch.Generator().manual_seed(0)
    shapes = ((n, DIMS, N), (n, DIMS), (n, DIMS))
    return tuple(torch.randn(shape, generator=generator).to(device) for shape in shapes)


def ours(n: int, device: str = "cpu") -> dict[str, Callable[[], object]]:
    """What the module does, by name."""
    mp = kineme.torch.Primitive(DIMS, N, rate=RATE, duration=DURATION, device=device)
    weights, start, goal = numbers(n, device)
    leaf, paths = weights.clone().requires_grad_(), mp(weights, start, goal).contiguous()

    def rollout(w: Any = weights) -> tuple[Any, ...]:
        return mp(w, start, goal, derivative=(0, 1))

    def gradients() -> None:
        leaf.grad = None
        sum(part.square().sum() for part in rollout(leaf)).backward()

    return {"rollout": rollout, "rollout and gradients": gradients, "learning": lambda: mp.encode(paths)}


def _theirs(n: int) -> dict[str, Callable[[], object]]:
    import torch
    from mp_pytorch.mp import MPFactory

    mp = MPFactory.init_mp("prodmp", PRODMP, num_dof=DIMS, tau=DURATION)
    weights, start, goal = numbers(n)
    params = torch.cat((weights, goal[..., None]), dim=-1).flatten(1)
    leaf, times = params.clone().requires_grad_(), torch.linspace(0.0, DURATION, 201).expand(n, 201)

    def rollout(given: Any = params) -> tuple[Any, ...]:
        state = {"init_time": torch.zeros(n), "init_pos": start, "init_vel": torch.zeros(n, DIMS)}
        mp.update_inputs(times=times, params=given, **state)
        return mp.get_traj_pos(), mp.get_traj_vel()

    paths = rollout()[0].contiguous()

    def gradients() -> None:
        leaf.grad = None
        sum(part.square().sum() for part in rollout(leaf)).backward()

    def learning() -> object:
        return mp.learn_mp_params_from_trajs(times, paths)

    return {"rollout": rollout, "rollout and gradients": gradients, "learning": learning}


def _arrays_row(n: int, repeats: int) -> list[Row]:
    """The same rollout by NumPy, which has no gradients: how much the module adds."""
    primitives = kineme.DMP(n_basis=N).learn(numbers(n)[0].numpy().transpose(0, 2, 1))

    def rollout() -> tuple[Any, ...]:
        movement = primitives.rollout(n_samples=201)
        return movement.positions, movement.velocities

    seconds = medians({"tensors": ours(n)["rollout"], "arrays": rollout}, repeats)
    tensors, arrays = (1e3 * seconds[name] for name in ("tensors", "arrays"))
    return [Row(f"rollout, {n} at once, beside arrays in double precision", "ms", tensors, arrays, "kineme.DMP")]
