"""What a classifier of compared movements is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.similarity.scores import Compared
from kineme.validation import Array


class Classifier(Protocol):
    """A fitted classifier: scores of each class."""

    def scores(self, compared: Compared) -> Array:
        """Return a score per class, shape (n, C): larger is more like it."""
        ...

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        return self.scores(compared).argmax(axis=1)
