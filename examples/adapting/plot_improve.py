"""
A movement that gets better by trying
=====================================

What "better" means is a function of yours: here the depth inside of a wall, and a little for acceleration. Variants
are tried in batches, all as one product.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

import kineme

u = np.linspace(0, 1, 100)
demo = np.column_stack((u, 0.1 * np.sin(np.pi * u) ** 2))


def cost(rollout: kineme.dmp.Rollout) -> np.ndarray:
    """Depth inside of the wall [m], and a little for acceleration, for each variant."""
    x, y = rollout.positions[:, :, 0], rollout.positions[:, :, 1]
    inside = np.where(np.abs(x - 0.5) < 0.08, np.maximum(0.33 - y, 0.0), 0.0)
    return inside.max(axis=1) + 1e-5 * np.mean(rollout.accelerations**2, axis=(1, 2))


primitive = kineme.DMP().learn([demo])
better = kineme.improve(primitive, cost, rollouts=20, updates=30)
print(f"cost {better.costs[0, 0]:.3f} at first, {better.cost:.3f} after {better.costs.size} variants")

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), width_ratios=(1.6, 1))
left.add_patch(Rectangle((0.45, 0), 0.1, 0.3, color="C6", alpha=0.5, linewidth=0))
left.plot(*demo.T, color="0.8", linewidth=6, label="demonstrated")
for updates, style in ((3, ":"), (8, "--"), (30, "-")):
    one = kineme.improve(primitive, cost, rollouts=20, updates=updates).primitive
    left.plot(*one.rollout().positions[0].T, style, label=f"after {20 * updates} variants")
left.set(xlabel="x [m]", ylabel="y [m]", ylim=(-0.02, 0.5))
left.legend(loc="upper right")
right.semilogy(better.costs, ".", color="0.7", markersize=3)
right.semilogy(better.costs.min(axis=1), label="best of each batch")
right.set(xlabel="batch of 20 variants", ylabel="cost")
right.legend()
plt.show()
