"""
Held back, and going on
=======================

Somebody holds the arm for a second. By default the movement goes on from where the arm is; with ``feedback="phase"``
it waits for the arm, so that nothing of its shape is lost.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

primitive = kineme.DMP().learn(kineme.load_lasa(["Zshape"])[1:2])
dt, steps = 0.01, 550
ways = {"state": {"feedback": "state"}, "phase": {"feedback": "phase", "phase_stopping": 50.0}}
measured = {name: np.empty((steps, 2)) for name in ways}
for name, options in ways.items():
    controller = primitive.controller(dt, duration=4.0, **options)
    robot = primitive.starts[0]
    for k in range(steps):
        wanted = controller.step(position=robot).position
        robot = robot if 150 <= k < 250 else wanted  # a robot that follows, unless it is held
        measured[name][k] = robot

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), width_ratios=(1.3, 1), layout="constrained")
right.plot(*primitive.rollout().positions[0].T, color="0.8", linewidth=6, label="demonstrated")
for (name, path), style in zip(measured.items(), ("--", "-"), strict=True):
    left.plot(dt * np.arange(steps), path[:, 0], style, label=f'feedback="{name}"')
    right.plot(*path.T, style)
left.axvspan(1.5, 2.5, color="C4", alpha=0.2, linewidth=0, label="held")
left.set(xlabel="time [s]", ylabel="x [mm]", xlim=(0, dt * steps))
right.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()
