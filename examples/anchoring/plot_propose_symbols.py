"""
Unlabeled recordings become symbols
===================================

Nobody labels everything. Recordings without labels are gathered into clusters, each with how surely it comes again
when some of the recordings are left out, and a person names them.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme import anchoring

names = ["Angle", "heee", "Khamesh", "Leaf_1", "Sharpc", "Snake", "Trapezoid", "Worm"]
demos = kineme.load_lasa(names)
varied = kineme.movements.Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.005).apply(
    demos, 0
)
unlabeled = kineme.Demonstrations.from_arrays([movement.positions for movement in varied])

proposals = anchoring.propose(unlabeled)
for k, proposal in enumerate(proposals):
    print(f"{k + 1}: {len(proposal)} movements, stability {proposal.stability:.2f}")

# %%
# Members are laid onto the most typical one; a dot is where they start. `figure.savefig` keeps the picture.
figure = anchoring.draw_proposals(unlabeled, proposals)

# %%
# What was not known when they were found: the labels.
table = np.array([[np.sum(demos.labels[p.members] == name) for name in names] for p in proposals])
figure, axes = plt.subplots(figsize=(5.4, 3.6))
axes.imshow(table, cmap="Blues")
for (row, column), count in np.ndenumerate(table):
    if count:
        axes.text(column, row, count, ha="center", va="center", color="white")
axes.set_xticks(range(len(names)), names, rotation=45, ha="right")
axes.set_yticks(range(len(proposals)), [f"proposal {k + 1}" for k in range(len(proposals))])
plt.show()
