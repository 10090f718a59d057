"""
A goal that moves away
======================

A controller moves step by step and takes a new goal whenever there is one. Told how fast the goal moves, it follows
without lagging behind.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

primitive = kineme.DMP().learn(kineme.load_lasa(["Spoon"])[:1])
dt, steps, velocity = 0.01, 700, np.array([12.0, 8.0])  # millimeters per second
goals = primitive.goals[0] + dt * np.arange(steps)[:, None] * velocity

paths = {}
for name, told in (("goal alone", None), ("goal and its velocity", velocity)):
    controller = primitive.controller(dt, duration=3.0)
    paths[name] = np.array([controller.step(goal=goal, goal_velocity=told).position for goal in goals])

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
left.plot(*goals.T, ":", color="black", label="goal")
left.plot(*goals[-1], "*", color="black", markersize=9)
for (name, path), style in zip(paths.items(), ("--", "-"), strict=True):
    left.plot(*path.T, style, label=name)
    right.semilogy(dt * np.arange(steps), np.linalg.norm(path - goals, axis=1), style, label=name)
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
right.set(xlabel="time [s]", ylabel="distance to the goal [mm]", xlim=(0, dt * steps), ylim=(1e-2, None))
right.axvline(3.0, color="0.7", linewidth=1)
right.text(3.05, 40, "duration", color="0.4", fontsize=8)
figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
plt.show()
