"""
Gram matrices of nine letters
=============================

Each pixel is the similarity of two movements. Letters that a kernel tells apart show as squares along the diagonal,
which is what the paper's Figures 8 to 11 show.
"""

import matplotlib.pyplot as plt
import numpy as np

import kineme
from kineme.kernels import RBF, TruncatedEuclidean

letters = kineme.load_lasa(kineme.datasets.PAPER_LETTERS)
three = letters[np.arange(len(letters)) % 7 < 3]

figure, panels = plt.subplots(1, 4, figsize=(9.6, 2.9), sharex=True, sharey=True)
cases = [(feature, kernel) for feature in ("weights", "shape-attractor") for kernel in (RBF(), TruncatedEuclidean())]
for axes, (feature, kernel) in zip(panels, cases, strict=True):
    rows = kineme.DMPFeatures(feature, dmp=kineme.DMP("original", fit="forcing", n_basis=80)).fit_transform(three)
    gram = kernel.fit(rows)(rows)  # widths that are not given are chosen from the rows
    image = axes.imshow(gram / gram.max(), vmin=0, vmax=1)
    axes.set_title(f"{feature}\n{type(kernel).__name__}")
    axes.set_xticks(np.arange(1, 27, 3), [name[0] for name in kineme.datasets.PAPER_LETTERS])
panels[0].set_yticks(np.arange(1, 27, 3), [name[0] for name in kineme.datasets.PAPER_LETTERS])
figure.colorbar(image, ax=panels, label="similarity / largest")
plt.show()
