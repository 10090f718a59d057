"""
Shown once, moved to new goals
==============================

A primitive that was learned from one demonstration moves to other goals, from other places, faster or slower. Twelve
goals are one matrix product, and so are ten thousand.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demo = kineme.load_lasa(["GShape"])[:1]
primitive = kineme.DMP().learn(demo)

angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
goals = primitive.goals + 20 * np.column_stack((np.cos(angles), np.sin(angles)))
paths = primitive.rollout(goal=goals)
print(paths.positions.shape)

# %%
figure, axes = plt.subplots(figsize=(5, 4))
axes.plot(*demo[0].positions.T, color="0.8", linewidth=6, label="demonstrated")
for path in paths.positions:
    axes.plot(*path.T, color="C0", linewidth=1)
axes.plot(*goals.T, "*", color="black", markersize=7, label="goals")
axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
axes.legend(loc="upper left")
plt.show()
