"""
Features in a pipeline of scikit-learn
======================================

`DMPFeatures` takes movements of any length and sampling and returns rows of numbers, so that anything in scikit-learn
can go on from there: here a principal component analysis draws nine letters in the plane.
"""

import matplotlib.pyplot as plt
from sklearn.decomposition import PCA
from sklearn.model_selection import LeaveOneOut, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline

import kineme

letters = kineme.load_lasa(kineme.datasets.PAPER_LETTERS)
features = kineme.DMPFeatures("shape-attractor")
model = make_pipeline(features, KNeighborsClassifier(1))
accuracy = cross_val_score(model, letters, letters.labels, cv=LeaveOneOut()).mean()
print(f"accuracy of the nearest neighbor, one left out at a time: {accuracy:.3f}")

# %%
plane = make_pipeline(features, PCA(2)).fit_transform(letters)
figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
markers = "os^vDPX*<"
for marker, name in zip(markers, kineme.datasets.PAPER_LETTERS, strict=True):
    own = plane[letters.labels == name]
    axes.plot(*own.T, marker, markersize=6, label=name)
axes.set(xlabel="first component of the shape-attractor", ylabel="second component")
figure.legend(loc="outside right upper")
plt.show()
