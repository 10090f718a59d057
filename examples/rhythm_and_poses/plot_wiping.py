"""
Wiping: a movement that repeats
===============================

A rhythmic primitive finds the period in a recording of a few repetitions and learns one cycle. It repeats as often as
you like, larger or smaller, faster or slower.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

rng = np.random.default_rng(0)
times = np.sort(rng.uniform(0.0, 5.3, 600))  # irregular stamps, 3.3 periods of 1.6 s
phase = 2 * np.pi * times / 1.6
wipe = np.column_stack((0.20 * np.sin(phase), 0.06 * np.sin(2 * phase) + 0.03 * np.cos(phase)))
recording = kineme.Trajectory(times, wipe + rng.normal(scale=0.004, size=wipe.shape))

primitive = kineme.RhythmicDMP().learn([recording])
print("period", primitive.periods.round(2), "s")

# %%
# Step by step, amplitude and period may change at any time, and a push is followed by the way back to the cycle.
controller, states = primitive.controller(dt=0.01), []
for k in range(900):
    changed = {"amplitude": 0.3, "period": 1.0} if k == 600 else {}
    states.append(controller.step([0.1, 0.2] if k == 300 else None, **changed).position)

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), width_ratios=(1, 1.5))
left.plot(*recording.positions.T, ".", color="0.7", markersize=3, label="recorded")
for amplitude, style in ((None, "-"), (0.12, "--")):
    cycle = primitive.rollout(n_periods=1, amplitude=amplitude).positions[0]
    left.plot(*cycle.T, style, label="one cycle" if amplitude is None else "smaller")
left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", ylim=(-0.1, 0.2))
left.legend(loc="upper left", ncols=3, columnspacing=1.0)
right.plot(0.01 * np.arange(900), states, label=["x", "y"])
for time, text in ((3.0, "pushed"), (6.0, "larger, faster")):
    right.axvline(time, color="0.7", linewidth=1)
    right.text(time + 0.05, 0.33, text, fontsize=8, color="0.4")
right.set(xlabel="time [s]", ylabel="position [m]", xlim=(0, 9))
right.legend(loc="lower left", ncols=2)
plt.show()
