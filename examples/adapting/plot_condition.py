"""
What is known about a movement tells the rest of it
===================================================

Seven demonstrations differ in a few directions only. Once it is known where a movement passes, its whole path is
known better: before it, after it, and in the other dimension.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.styles import average

mean = average(kineme.DMP().learn(kineme.load_lasa(["Sine"])))
path, deviation = mean.primitive.rollout(n_samples=101).positions[0], mean.deviation(101)
known = path[25, 1] + 1.5 * deviation[25, 1]
passing = mean.condition(t=0.25, position=[np.nan, known], std=0.2)  # only y is known

# %%
u = np.linspace(0, 1, 101)
figure, panels = plt.subplots(1, 2, figsize=(8, 3), sharex=True)
for k, axes in enumerate(panels):
    for model, color, label in ((mean, "0.6", "seven demonstrations"), (passing, "C1", "y known at a quarter")):
        line, spread = model.primitive.rollout(n_samples=101).positions[0, :, k], model.deviation(101)[:, k]
        axes.fill_between(u, line - 2 * spread, line + 2 * spread, color=color, alpha=0.35, linewidth=0)
        axes.plot(u, line, color=color, label=label)
    axes.set(xlabel="time / duration", ylabel=f"{'xy'[k]} [mm]", xlim=(0, 1))
panels[1].plot(0.25, known, "o", color="black", markersize=5)
panels[0].legend()
plt.show()
