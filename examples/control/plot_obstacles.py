"""
Around obstacles
================

People walk around things by turning away from what lies ahead. The same term bends a primitive around points, and the
goal is still reached.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.control import ObstacleAvoidance, Status

primitive = kineme.DMP().learn(kineme.load_lasa(["Zshape"])[1:2])
shown = primitive.rollout().positions[0]
obstacles = shown[[50, 105, 165]] + [[0.0, 2.0], [1.0, 1.0], [0.0, -1.0]]

# %%
# The strength gamma says how early it turns away. The steering does no work, so it can only turn the velocity.
figure, axes = plt.subplots(figsize=(5.6, 4))
axes.plot(*shown.T, color="0.8", linewidth=6, label="demonstrated")
for gamma, style in zip((500, 1500, 4500), ("-", "--", ":"), strict=True):
    controller = primitive.controller(dt=0.005, avoidance=ObstacleAvoidance(gamma=gamma, reach=12.0), settle=0.5)
    path = [primitive.starts[0]]
    while not controller.state.status & Status.SETTLED:
        path.append(controller.step(obstacles=obstacles).position)
    axes.plot(*np.array(path).T, style, label=f"γ = {gamma}")
axes.plot(*obstacles.T, "X", color="black", markersize=9, label="obstacles")
axes.plot(*primitive.goals[0], "*", color="black", markersize=9, label="goal")
axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(-45, 35))
axes.legend(loc="upper right")
plt.show()
