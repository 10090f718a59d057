"""
The recordings that come with kineme
====================================

Thirty handwritten shapes, seven demonstrations of each: the LASA handwriting data set of Khansari-Zadeh and Billard.
They are real recordings, small, and need no download, so most examples here begin with them.
"""

import matplotlib.pyplot as plt

import kineme

demos = kineme.load_lasa(kineme.datasets.LASA_30)
print(demos)

# %%
# A set of demonstrations is a sequence of movements: each has time stamps in seconds, positions of shape (T, d), here
# in millimeters, and a label. All of these drawings end at the origin.
figure, rows = plt.subplots(5, 6, figsize=(8, 6.4))
for axes, name in zip(rows.flat, kineme.datasets.LASA_30, strict=True):
    for movement in demos[demos.labels == name]:
        axes.plot(*movement.positions.T, linewidth=0.8)
    axes.set_title(name.replace("_", " "), fontsize=7)
    axes.set_aspect("equal")
    axes.axis("off")
plt.show()
