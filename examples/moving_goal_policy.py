"""
Hit a moving goal with a policy that learns through rollouts
============================================================

A goal flies past with a velocity of its own. A small network sees where goal and hand are and how they move, and says
the weights and the goal of a movement; half-way it looks again and replans. Nobody shows it a movement: the distance at
the end, the effort and the gradients of both through all that was planned are what it learns from. Needs the extra
``torch``: ``python examples/moving_goal_policy.py out.png``.
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import torch
from matplotlib.figure import Figure

import kineme.torch

DURATION, LOOK_AGAIN, N = 1.0, 0.5, 8
EFFORT = 1e-5  # weight of the mean squared acceleration
NOISE = 0.15  # of the goal's velocity, as it is seen at first

mp = kineme.torch.Primitive(dims=2, n_weights=N, rate=50, duration=DURATION)


class Policy(torch.nn.Module):
    """From time, hand and goal, with their velocities, to weights and goal of a movement."""

    def __init__(self) -> None:
        super().__init__()
        hidden = (torch.nn.Linear(9, 64), torch.nn.Tanh(), torch.nn.Linear(64, 64), torch.nn.Tanh())
        self.layers = torch.nn.Sequential(*hidden, torch.nn.Linear(64, 2 * N + 2))

    def forward(self, at: float, *seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Weights (n, 2, N) and goals (n, 2)."""
        numbers = self.layers(torch.cat((*seen, torch.full_like(seen[0][:, :1], at)), dim=-1))
        return numbers[:, 2:].unflatten(-1, (2, N)), seen[2] + numbers[:, :2]


def targets(n: int, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Where n goals are at first, to the right of the hand, and their velocities."""
    uniform = torch.rand((n, 4), generator=generator)
    return uniform[:, :2] * torch.tensor([0.5, 1.0]) + torch.tensor([0.5, -0.5]), 1.6 * (uniform[:, 2:] - 0.5)


def execute(policy: Policy, place: torch.Tensor, motion: torch.Tensor, seen: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Movements (n, T, 2), their accelerations, and the first plan, of a policy that looks twice."""
    rest = torch.zeros_like(place)
    weights, goal = policy(0.0, rest, rest, place, seen)
    first = mp(weights, rest, goal)
    x, v = mp.state(LOOK_AGAIN, weights, rest, goal)
    again, goal_again = policy(LOOK_AGAIN, x, v, place + LOOK_AGAIN * motion, motion)  # seen well from near by
    state = {"at": LOOK_AGAIN, "position": x, "velocity": v, "goal": goal_again, "start": rest}
    before = mp.times[:, None] < LOOK_AGAIN
    path = torch.where(before, first, mp.replan(again, **state))
    early, late = mp(weights, rest, goal, derivative=2), mp.replan(again, **state, derivative=2)
    return path, torch.where(before, early, late), first


def train(steps: int, n: int = 128, seed: int = 0) -> tuple[Policy, list[float]]:
    """Learn for some steps of n goals each; the policy and the mean distance at the end in each step."""
    torch.manual_seed(seed)
    policy, generator = Policy(), torch.Generator().manual_seed(seed)
    optimizer = torch.optim.Adam(policy.parameters(), lr=3e-3)
    misses = []
    for _ in range(steps):
        place, motion = targets(n, generator)
        seen = motion + NOISE * torch.randn(motion.shape, generator=generator)
        path, acceleration, _ = execute(policy, place, motion, seen)
        distance = (path[:, -1] - place - DURATION * motion).square().sum(-1)
        optimizer.zero_grad()
        (distance.mean() + EFFORT * acceleration.square().sum(-1).mean()).backward()
        optimizer.step()
        misses.append(float(distance.detach().sqrt().mean()))
    return policy, misses


def draw(policy: Policy, misses: list[float]) -> Figure:
    """Draw six movements with what was planned at first, and how the policy learned."""
    generator = torch.Generator().manual_seed(1)
    place, motion = targets(6, generator)
    seen = motion + NOISE * torch.randn(motion.shape, generator=generator)
    with torch.no_grad():
        path, _, first = execute(policy, place, motion, seen)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for k in range(len(path)):
        color, end = f"C{k}", place[k] + DURATION * motion[k]
        left.plot(*path[k].T, color=color)
        left.plot(*first[k].T, color=color, linestyle=":", linewidth=1)
        left.annotate("", end, place[k], arrowprops={"arrowstyle": "->", "color": color, "alpha": 0.4})
        left.plot(*end, "x", color=color)
    left.plot([], [], "k-", label="executed")
    left.plot([], [], "k:", label="planned at first")
    left.legend()
    left.set_aspect("equal")
    left.set_title("goals move along the arrows")
    right.semilogy(misses)
    right.set_xlabel("step")
    right.set_ylabel("mean distance at the end")
    return figure


if __name__ == "__main__":
    torch.set_num_threads(1)  # the work is small
    trained = train(200)
    print(f"mean distance at the end: {trained[1][0]:.2f} before, {sum(trained[1][-20:]) / 20:.3f} after")
    draw(*trained).savefig(sys.argv[1] if len(sys.argv) > 1 else "moving_goal_policy.png")
