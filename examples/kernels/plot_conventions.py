"""
A conclusion that hangs on a convention
=======================================

The paper finds that weights are useless in the bio-inspired formulation. What it calls weights and f(t) can be read
in several ways; here is its experiment under each of them: the nearest neighbor, three of each of nine letters, one
left out at a time.
"""

import matplotlib.pyplot as plt
import numpy as np

from kineme_experiments.paper.experiments import run_draw
from kineme_experiments.paper.representations import REPRESENTATIONS

# %%
# Twelve random draws of three letters each, those of ``kineme reproduce``.
draws = [run_draw("paper", seed=0, index=k, svm=False)["nearest"] for k in range(12)]
divided = ("original-w-gated", "bio-w-over-s", "bio-f-over-s", "bio-bracket")
for key in REPRESENTATIONS:
    print(f"{key}: {np.mean([draw[key] for draw in draws]):.3f}")

# %%
# Dots are draws, lines their means. Divide by the phase, which ends at 0.01, and the last samples outweigh all
# others; do not, and weights recognize every letter.
figure, axes = plt.subplots(figsize=(8.5, 3.8))
for row, key in enumerate(REPRESENTATIONS):
    color = "C1" if key in divided else "C0"
    accuracies = [draw[key] for draw in draws]
    axes.plot(accuracies, row + np.linspace(-0.2, 0.2, len(draws)), ".", color=color, alpha=0.5)
    axes.plot(np.full(2, np.mean(accuracies)), [row - 0.35, row + 0.35], color=color, linewidth=3)
names = [f"{one.formulation}: {one.formula}" for one in REPRESENTATIONS.values()]
axes.set_yticks(range(len(names)), names)
axes.set(xlabel="accuracy of 1-NN on 27 letters; orange: divided by s", xlim=(0, 1.03))
axes.invert_yaxis()
plt.show()
