"""
A movement for a height that was never shown
============================================

Four demonstrations step over obstacles of four heights. The primitive becomes a function of the height, and knows its
own range.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

u = np.linspace(0, 1, 100)
heights = np.array([0.1, 0.2, 0.35, 0.5])
demos = [kineme.Trajectory((1 + h) * u, np.column_stack((u, h * np.sin(np.pi * u) ** 2))) for h in heights]
task = kineme.dmp.Contextual().fit(demos, parameters=heights)
print(f"{task.smoother_}, error at a height left out: {1000 * task.leave_one_out_error_:.1f} mm")

# %%
# Asked for a height outside of those shown, it refuses, and says how far outside.
try:
    task.primitive(0.8)
except kineme.errors.KinemeError as error:
    print(error)

# %%
new = np.array([0.15, 0.27, 0.42])
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 2.9), width_ratios=(1.5, 1))
for demo in demos:
    left.plot(*demo.positions.T, color="0.8", linewidth=6)
for height, path, style in zip(new, task.primitive(new).rollout().positions, ("-", "--", "-."), strict=True):
    left.plot(*path.T, style, label=f"for {height} m")
    left.axhline(height, color="0.9", linewidth=0.6, zorder=0)
left.set(xlabel="x [m]", ylabel="y [m]")
left.legend()
right.plot(heights, [demo.duration for demo in demos], "o", color="0.6", markersize=8, label="shown")
right.plot(new, task.primitive(new).durations, "s", markersize=5, label="learned")
right.set(xlabel="height [m]", ylabel="duration [s]", xlim=(0, 0.55))
right.legend()
plt.show()
