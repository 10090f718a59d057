"""DMP features of movements, Eq. (9), as a scikit-learn transformer."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Self

from kineme.features.movement_features import MovementFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.primitives.discrete.dmp import DMP


class DMPFeatures(MovementFeatures):
    """Describe each movement by its DMP: rows ``x_1 ... x_S, y_1 ... y_S``, Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        The shape-attractor term of the equation, the forcing term f, or the weights w; see
        `Primitives.shape_attractor`, `Primitives.forcing`, `Primitives.weights`.
    formulation, n_basis, stiffness, damping, gating, regression, ridge, phase_end, overlap, n_points, preprocessing
        The specification of the DMP; see `DMP`.
    n_samples : int, default 100
        Samples S of the shape-attractor and of f. Weights have n_basis instead.
    fit_to : {"forcing", "trajectory"}, default "forcing"
        The `fit` of `DMP`; a scikit-learn estimator has a method of that name.
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

    def __init__(  # noqa: PLR0913, PLR0917 - one parameter per choice, as scikit-learn's searches need them
        self,
        feature: str = "shape-attractor",
        formulation: str = "bio-inspired",
        n_basis: int = 80,
        n_samples: int = 100,
        stiffness: float = 100.0,
        damping: float | None = None,
        gating: str = "none",
        fit_to: str = "forcing",
        regression: str = "local",
        ridge: float | None = None,
        phase_end: float = 0.01,
        overlap: float = 0.3,
        n_points: int = 200,
        preprocessing: tuple[Any, ...] = (),
        dtype: str = "float64",
    ) -> None:
        self.feature = feature
        self.formulation = formulation
        self.n_basis = n_basis
        self.n_samples = n_samples
        self.stiffness = stiffness
        self.damping = damping
        self.gating = gating
        self.fit_to = fit_to
        self.regression = regression
        self.ridge = ridge
        self.phase_end = phase_end
        self.overlap = overlap
        self.n_points = n_points
        self.preprocessing = preprocessing
        self.dtype = dtype

    def fit(self, X: Any, y: Any = None) -> Self:
        """Check the parameters and store the number of dimensions; y is ignored."""
        self._check_parameters()
        shared = {field.name for field in fields(DMP)} - {"fit"}
        self.dmp_ = DMP(fit=self.fit_to, **{name: getattr(self, name) for name in shared})
        self.n_dims_ = Demonstrations.of(X).n_dims
        return self
