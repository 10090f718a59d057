"""DMP features of movements, Eq. (9), as a scikit-learn transformer."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from kineme.dmp.discrete.dmp import DMP
from kineme.features.movement_features import MovementFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike


class DMPFeatures(MovementFeatures[DMP]):
    """Describe each movement by its DMP: rows ``x_1 ... x_S, y_1 ... y_S``, Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        The shape-attractor term of the equation, the forcing term f, or the weights w; see
        `Primitives.shape_attractor`, `Primitives.forcing`, `Primitives.weights`.
    dmp : DMP, default DMP()
        How the movements are learned. Its fields are searched as ``dmp__n_basis`` and so on.
    n_samples : int, default 100
        Samples S of the shape-attractor and of f. Weights have ``dmp.n_basis`` instead.
    dtype : {"float64", "float32"}, default "float64"
        Type of the result; kernels compute in the type of their input.

    Attributes
    ----------
    dmp_ : DMP
        The specification in force.
    n_dims_ : int
        Dimensions d of the training movements.

    Examples
    --------
    >>> import kineme
    >>> from sklearn.model_selection import cross_val_score
    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> from sklearn.pipeline import make_pipeline
    >>> demos = kineme.load_lasa(kineme.datasets.PAPER_LETTERS)
    >>> model = make_pipeline(kineme.DMPFeatures("shape-attractor"), KNeighborsClassifier(1))
    >>> float(cross_val_score(model, demos, demos.labels).mean())
    1.0
    """

    _specification_type: ClassVar[type] = DMP

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and store the number of dimensions; y is ignored."""
        self.dmp_ = self._checked()
        self.n_dims_ = Demonstrations.of(X).n_dims
        return self
