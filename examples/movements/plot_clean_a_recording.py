"""
A noisy recording with a rest before it
=======================================

Sensors are noisy, and people wait before they begin. Two steps of preparation mend both, on the true time stamps,
however irregular these are.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

clean = kineme.load_lasa(["Spoon"])[0]
rng = np.random.default_rng(0)
kept = np.sort(rng.choice(1000, 300, replace=False))  # a sensor that drops two samples of three
rest = np.linspace(0.0, 1.5, 60, endpoint=False)
times = np.concatenate([rest, 1.5 + clean.times[kept]])
positions = np.concatenate([np.repeat(clean.positions[:1], 60, axis=0), clean.positions[kept]])
recording = kineme.Trajectory(times, positions + rng.normal(scale=0.25, size=positions.shape))

# %%
# `Smooth` is a smoothing spline that keeps so many cycles per movement; `TrimRest` drops what stays near the first
# and the last position.
(prepared,) = kineme.preprocess([recording], (kineme.Smooth(12), kineme.TrimRest()))
print(len(recording), "samples before,", len(prepared), "after")

# %%
# Positions hardly tell the difference. Speeds do, and anything that differentiates would see noise alone.
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), width_ratios=(1, 1.6))
left.plot(*recording.positions.T, ".", color="0.7", markersize=3, label="recorded")
left.plot(*prepared.positions.T, label="prepared")
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
for movement, color, label in ((recording, "0.7", "recorded"), (prepared, "C0", "prepared")):
    velocity = np.gradient(movement.positions, movement.times, axis=0)
    right.plot(movement.times, np.linalg.norm(velocity, axis=1), color=color, label=label)
right.axvspan(0.0, 1.5, color="C1", alpha=0.15, linewidth=0, label="rest")
right.set(xlabel="time [s]", ylabel="speed [mm/s]", xlim=(0, None), ylim=(0, None))
right.legend()
plt.show()
