"""
Through points, and on at the goal
==================================

Where to pass and when is a linear equation for the weights, so it is met exactly; so is a velocity at the goal.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

primitive = kineme.DMP().learn(kineme.load_lasa(["GShape"])[:1])
points = np.array([[-25.0, -5.0], [8.0, -10.0]])
via = list(zip((0.4, 0.7), points, strict=True))  # when, as a share of the duration, and where

paths = {
    "as demonstrated": primitive.rollout(),
    "through two points": primitive.rollout(via=via),
    "and on at the goal": primitive.rollout(via=via, end_velocity=[-25.0, 0.0]),
}

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
for (name, path), style, width in zip(paths.items(), ("-", "-", "--"), (6, 1.5, 1.5), strict=True):
    color = "0.8" if width > 2 else None
    (line,) = left.plot(*path.positions[0].T, style, color=color, linewidth=width, label=name)
    speed = np.linalg.norm(path.velocities[0], axis=1)
    right.plot(path.times[0], speed, style, color=line.get_color(), linewidth=width)
left.plot(*points.T, "o", color="black")
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
right.set(xlabel="time [s]", ylabel="speed [mm/s]", ylim=(0, None))
figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()
