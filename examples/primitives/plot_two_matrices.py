"""
Learning is a matrix, and so is moving
======================================

For a fixed specification, everything from a path to its weights is linear, and everything from weights to a path. So
a thousand movements are learned by one product, and moved by another.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.dmp.discrete.operators import decoder, encoder

dmp = kineme.DMP(n_basis=30)
E, Phi = encoder(dmp, 200).weights, decoder(dmp, 200).Phi[0]

# %%
# Left, what a sample of the path adds to each weight; right, what each weight adds to the path: the answer of the
# spring to one basis function.
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2))
for axes, matrix, title in ((left, E.T, "encode: weights from a path"), (right, Phi, "decode: a path from weights")):
    most = np.quantile(np.abs(matrix), 0.995)
    image = axes.imshow(matrix, aspect="auto", cmap="PuOr", vmin=-most, vmax=most, interpolation="nearest")
    axes.set_title(f"{title}, {matrix.shape[0]} × {matrix.shape[1]}")
    figure.colorbar(image, ax=axes)
left.set(xlabel="sample", ylabel="basis function")
right.set(xlabel="basis function", ylabel="sample")
plt.show()

# %%
# Ten thousand movements, learned and moved to goals of their own:
paths = np.random.default_rng(0).normal(size=(10_000, 200, 2)).cumsum(axis=1)
primitives = dmp.learn(paths)
again = primitives.rollout(goal=primitives.goals + 1.0).positions
print(again.shape)
