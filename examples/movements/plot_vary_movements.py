"""
The same movement elsewhere, larger, turned, hurried
====================================================

How much does a method bear? `kineme.movements.Perturbation` changes movements in ways that keep what they are, by
amounts that you choose, and the same seed gives the same movements.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme

demo = kineme.load_lasa(["BendedLine"])[:1]
kinds = {
    "translation": kineme.movements.Perturbation(shift=0.6),
    "size": kineme.movements.Perturbation(scale=1.0),
    "rotation": kineme.movements.Perturbation(rotation=np.pi / 3),
    "timing": kineme.movements.Perturbation(warp=0.8),
    "noise": kineme.movements.Perturbation(noise=0.006),
    "all of them": kineme.movements.Perturbation(0.6, 1.0, np.pi / 3, 0.8, 0.006),
}

# %%
# The path of a movement that is hurried here and slowed there stays the same, so dots mark even times.
figure, panels = plt.subplots(2, 3, figsize=(8, 5))
for axes, (title, perturbation) in zip(panels.flat, kinds.items(), strict=True):
    axes.plot(*demo[0].positions.T, color="0.8", linewidth=5)
    for seed in range(4):
        (varied,) = perturbation.apply(demo, seed)
        path = varied.positions + ([0, 12 * (seed + 1)] if title == "timing" else 0)
        axes.plot(*path.T, marker=".", markevery=12, linewidth=1)
    axes.set(title=title, aspect="equal", adjustable="datalim")
    axes.axis("off")
figure.suptitle("gray: as recorded; dots: even times", fontsize=9)
plt.show()
