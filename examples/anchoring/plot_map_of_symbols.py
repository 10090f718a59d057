"""
A map of symbols
================

Similar symbols are near each other in the conceptual space. A map shows it in the plane, each symbol drawn as its
most typical movement.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme import anchoring

names = [
    "Angle",
    "BendedLine",
    "CShape",
    "GShape",
    "JShape",
    "Khamesh",
    "Leaf_2",
    "NShape",
    "Sine",
    "Snake",
    "Spoon",
    "Worm",
]
demos = kineme.load_lasa(names)
primitives = kineme.DMP().learn(demos)
prototypes = [anchoring.prototype(primitives[demos.labels == name]).primitive for name in names]
prototypes = kineme.dmp.Primitives.concatenate(prototypes)
space = anchoring.conceptual_space(names, prototypes.rollout())

# %%
# `figure.savefig` keeps the picture.
figure = anchoring.draw_map(space, prototypes)

# %%
# The distances themselves:
figure, axes = plt.subplots(figsize=(5.4, 4.4))
image = axes.imshow(space.distances, cmap="viridis_r")
axes.set_xticks(range(len(names)), names, rotation=90)
axes.set_yticks(range(len(names)), names)
figure.colorbar(image, label="distance")
nearest = np.argsort(space.distances + 9 * np.eye(len(names)), axis=None)[0]
print("nearest to each other:", *(names[k] for k in np.unravel_index(nearest, space.distances.shape)))
plt.show()
