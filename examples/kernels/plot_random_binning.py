r"""
A kernel for a million movements
================================

A Gram matrix of a million movements has :math:`10^{12}` entries. `RandomBinning` makes sparse rows whose products are
the truncated kernel on average, so that a linear classifier takes its place.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.kernels import TruncatedEuclidean

shapes = kineme.load_lasa()
rows = kineme.DMPFeatures("shape-attractor", n_samples=20).fit_transform(shapes)
kernel = TruncatedEuclidean().fit(rows)
exact = kernel(rows) / kernel.m

# %%
# The more random grids for each column, the closer the products are to the kernel. Rows grow with the number of
# movements, a Gram matrix with its square.
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4))
size = {}
for n_shifts, color in ((1, "0.75"), (4, "C4"), (32, "C0")):
    Z = kineme.kernels.RandomBinning(m=kernel.m, n_shifts=n_shifts).fit_transform(rows)
    product = (Z @ Z.T).toarray() / kernel.m
    left.plot(exact.ravel()[::17], product.ravel()[::17], ".", color=color, markersize=2, label=f"{n_shifts} grids")
    size[n_shifts] = Z.nnz / len(rows)
left.plot([0, 1], [0, 1], color="black", linewidth=0.8)
left.set(xlabel="truncated kernel / m", ylabel="product of sparse rows / m", aspect="equal")
left.legend(markerscale=6)
n = np.logspace(2, 6.5, 50)
right.loglog(n, n**2, label="Gram matrix")
right.loglog(n, size[4] * n, "--", label="sparse rows, 4 grids")
right.axhline(3e9, color="0.6", linestyle=":")
right.text(1.2e2, 4e9, "24 GB", fontsize=8, color="0.4")
right.set(xlabel="movements", ylabel="numbers to keep")
right.legend()
plt.show()
