"""
Three formulations, one movement
================================

The original formulation stretches each axis by its own distance from start to goal, and mirrors the movement when the
goal changes sides. The bio-inspired one keeps the shape, and the amplitude-scaled one makes it smaller where the goal
is nearer.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demo = kineme.load_lasa(["GShape"])[:1]
start, goal = demo[0].positions[0], demo[0].positions[-1]
shares = np.array([1.0, 0.5, 0.0, -0.5])  # of the way from the start to the goal that was shown
goals = start + shares[:, None] * (goal - start)

# %%
# With a share of 0 the goal is the start: the original formulation does not move at all. Below 0 it mirrors.
figure, panels = plt.subplots(1, 3, figsize=(9, 3), sharex=True, sharey=True, layout="constrained")
for axes, formulation in zip(panels, ("original", "bio-inspired", "amplitude-scaled"), strict=True):
    primitive = kineme.DMP(formulation).learn(demo)
    paths = primitive.rollout(goal=goals, velocity=[0.0, 0.0]).positions
    axes.plot(*demo[0].positions.T, color="0.8", linewidth=6)
    for path, share, style in zip(paths, shares, ("-", "--", ":", "-."), strict=True):
        (line,) = axes.plot(*path.T, style, label=f"{share:.0%} of the way")
        axes.plot(*path[-1], "*", color=line.get_color(), markersize=8)
    axes.set(title=formulation, xlabel="x [mm]", aspect="equal")
panels[0].set_ylabel("y [mm]")
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, title="goal")
plt.show()
