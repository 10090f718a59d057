"""
As fast as the joints allow
===========================

The same path, in the least time that the limits of the arm permit: at every moment some joint is at a limit.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme import robots

u = np.linspace(0, 1, 150)
s = 10 * u**3 - 15 * u**4 + 6 * u**5
tip = np.column_stack((0.45 + 0.1 * np.sin(np.pi * s), 0.5 * s - 0.25, 0.3 + 0.15 * np.sin(2 * np.pi * s)))
path = kineme.DMP().learn([kineme.Trajectory(2.5 * u, tip)]).rollout(end_velocity=[0, 0, 0], rate=100)

panda = robots.load("panda")
made = {"as demonstrated": robots.move(path, panda), "fastest": robots.move(path, panda, timing="fastest")}

# %%
figure, panels = plt.subplots(2, 2, figsize=(8.5, 4.2), sharex="col", sharey="row", layout="constrained")
for column, (name, one) in zip(panels.T, made.items(), strict=True):
    first = one.first
    times = one.trajectory.times[first:] - one.trajectory.times[first]
    for axes, rates, limits in zip(
        column,
        (one.trajectory.velocities, one.trajectory.accelerations),
        (panda.velocity, panda.acceleration),
        strict=True,
    ):
        axes.plot(times, np.abs(rates[first:]) / limits, linewidth=1)
        axes.axhline(1, color="black", linestyle="--", linewidth=1)
    column[0].set_title(f"{name}: {times[-1]:.2f} s")
    column[1].set_xlabel("time [s]")
panels[0, 0].set_ylabel("velocity / limit")
panels[1, 0].set_ylabel("acceleration / limit")
figure.legend(panels[0, 0].lines[:7], [f"joint {k + 1}" for k in range(7)], loc="outside right")
plt.show()
