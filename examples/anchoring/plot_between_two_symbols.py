"""
What lies between two symbols
=============================

Between two symbols there are movements that nobody showed. `morph` goes from one to the other in shape, size and
direction, so that nothing shrinks half way, as a plain mean of paths does.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme import anchoring

demos = kineme.load_lasa(["Sine", "CShape"])
dmp = kineme.DMP()
sine, c = dmp.learn(demos[:1]), dmp.learn(demos[7:8])
shares = np.linspace(0, 1, 7)
between = anchoring.morph(sine, c, shares).rollout().positions
means = [(1 - share) * sine.rollout().positions[0] + share * c.rollout().positions[0] for share in shares]

# %%
figure, rows = plt.subplots(2, 7, figsize=(9, 2.9), sharex=True, sharey=True)
for axes, share, one, mean, color in zip(rows.T, shares, between, means, plt.cm.viridis(0.9 * shares), strict=True):
    axes[0].plot(*one.T, color=color)
    axes[1].plot(*mean.T, color="0.6", linestyle="--")
    axes[0].set_title(f"{share:.0%}", fontsize=8)
    for each in axes:
        each.set_aspect("equal")
        each.axis("off")
figure.suptitle("from a sine to a C: above, `morph`; below, dashed, the mean of the paths", fontsize=9)
plt.show()
