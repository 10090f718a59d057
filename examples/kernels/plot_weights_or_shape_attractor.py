r"""
Weights or shape-attractor?
===========================

Two rows of numbers describe a movement in the paper that kineme started from: the weights w, and the shape-attractor,
what the forcing term does in the equation. Three handwritten Cs should give similar rows.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

letters = kineme.load_lasa(["CShape", "NShape"])
paper = {"fit": "forcing", "n_basis": 80}  # as the paper fits
chosen = letters[[0, 1, 2, 7]]

# %%
# In the original formulation weights are divided by the distance from start to goal: where that is small, they are
# huge and may change their sign. The shape-attractor is not divided by anything.
figure, panels = plt.subplots(2, 2, figsize=(8, 4.4), sharex="col")
u = np.linspace(0, 1, 100)
for row, formulation in zip(panels, ("original", "bio-inspired"), strict=True):
    primitives = kineme.DMP(formulation, **paper).learn(chosen)
    columns = ("weights w", primitives.weights), ("shape-attractor", primitives.shape_attractor(100))
    for axes, (name, values) in zip(row, columns, strict=True):
        for one, label in zip(values[:, :, 1], chosen.labels, strict=True):
            c = label == "CShape"
            axes.plot(np.linspace(0, 1, len(one)), one, color="C0" if c else "C1", linestyle="-" if c else "--")
        axes.set_title(f"{name}, {formulation}")
for axes in panels[1]:
    axes.set(xlabel="time / duration", xlim=(0, 1))
panels[0, 1].legend(panels[0, 1].lines[2:], ["three Cs", "an N"])
plt.show()
