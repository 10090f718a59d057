"""
How similar is a difference?
============================

A distance-based kernel turns a difference into a similarity. RBF never quite reaches zero; the truncated Euclidean
kernel does at the distance m, and from there on no difference is worse than another.
"""

import matplotlib.pyplot as plt
import numpy as np

from kineme.kernels import MEANS, RBF, Laplacian, TruncatedEuclidean

difference = np.linspace(0, 4, 401)[:, None]
origin = np.zeros((1, 1))
kernels = {"RBF(1)": RBF(1.0), "Laplacian(1)": Laplacian(1.0), "TruncatedEuclidean(1, 1)": TruncatedEuclidean(1.0, 1.0)}

# %%
# Movements have several dimensions, each with a similarity of its own, and an average makes one of them. On the right
# one dimension agrees, and the other is the less similar the further to the right.
figure, (left, right) = plt.subplots(1, 2, figsize=(8.5, 3.2))
for (name, kernel), style in zip(kernels.items(), ("-", "--", "-."), strict=True):
    left.plot(difference, kernel(origin, difference)[0], style, label=name)
left.set(xlabel="difference", ylabel="similarity", xlim=(0, 4), ylim=(0, 1.02))
left.legend()
second = np.linspace(1, 0, 201)
for (name, mean), style in zip(MEANS.items(), ("-", "--", "-.", ":", (0, (5, 1, 1, 1))), strict=True):
    right.plot(1 - second, mean.average(np.stack((np.ones_like(second), second))), linestyle=style, label=name)
right.set(xlabel="1 - similarity in the second dimension", ylabel="average with 1", xlim=(0, 1), ylim=(0, 1.02))
right.legend()
plt.show()
