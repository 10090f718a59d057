"""
The average of seven demonstrations, and how much they differ
=============================================================

A path is linear in what a primitive keeps, so the mean of seven primitives is the primitive of the mean path, and
their covariance says how much each stretch varies.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.styles import average

demos = kineme.load_lasa(["Sharpc"])
mean = average(kineme.DMP().learn(demos))
path, deviation = mean.primitive.rollout(n_samples=101).positions[0], mean.deviation(101)

# %%
# New movements vary as the demonstrations do.
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), width_ratios=(1, 1.5))
for demo in demos:
    left.plot(*demo.positions.T, color="0.7", linewidth=1)
for variant in mean.sample(4, seed=0).rollout().positions:
    left.plot(*variant.T, color="C1", linewidth=0.8, linestyle="--")
left.plot(*path.T, linewidth=2)
left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="gray: shown; dashed: new")
u = np.linspace(0, 1, 101)
for k, name in enumerate("xy"):
    right.fill_between(u, path[:, k] - 2 * deviation[:, k], path[:, k] + 2 * deviation[:, k], alpha=0.3, linewidth=0)
    right.plot(u, path[:, k], label=f"{name}, two standard deviations")
right.set(xlabel="time / duration", ylabel="position [mm]", xlim=(0, 1))
right.legend()
plt.show()
