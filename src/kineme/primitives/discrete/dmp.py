"""The specification of a DMP: every parameter that the weights depend on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from kineme.movements.preparation.preprocess import check_steps
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.primitives.discrete.basis import ExponentialPhase, GaussianBasis
from kineme.primitives.discrete.fits import FITS, REGRESSIONS
from kineme.primitives.discrete.formulations import FORMULATIONS, Formulation
from kineme.primitives.spring_damper import SpringDamper
from kineme.validation import check_choice, check_count

if TYPE_CHECKING:
    from kineme.primitives.discrete.primitives import Primitives

MOST_POINTS = 10_000  # a fit with T points needs matrices of T^2 numbers


@dataclass(frozen=True)
class DMP(SpringDamper):
    """A Dynamical Movement Primitive, as a frozen specification.

    In normalized time u = t / tau, with one canonical system s(u) shared by all dimensions,

        original      x'' = K (g - x) + (g - x0) f(s) - D x'                            Eq. (1)
        bio-inspired  x'' = s K (f(s)/s + x0 - x) + (1 - s) K (g - x) - D x'            Eq. (4)

    and ``f(s) = sum_i psi_i(s) w_i / sum_i psi_i(s)``, Eq. (2).

    Parameters
    ----------
    formulation : {"original", "bio-inspired", "amplitude-scaled", "decoupled"}, default "bio-inspired"
        The transformation system; see `kineme.primitives.discrete.formulations.FORMULATIONS`.
    n_basis : int, default 40
        Number N of basis functions, at most 2,000.
    stiffness : float, default 100.0
        Spring constant K, in units of 1 / tau^2.
    damping : float, optional
        Damping D; by default critical, ``2 sqrt(K)``.
    gating : {"none", "phase"}, default "none"
        Whether f is Eq. (2) as printed, or that times s, as many implementations have it.
    fit : {"trajectory", "forcing"}, default "trajectory"
        Fit the path itself by regularized least squares on the system's response: no numerical derivatives, robust to
        noise. Or solve the equation for f and fit that, as the paper does, with 80 basis functions.
    regression : {"local", "ridge"}, default "local"
        How ``fit="forcing"`` finds the weights: locally weighted, or jointly by ridge regression. The fit of the path
        does not use it.
    ridge : float, optional
        Strength of the penalty of ``regression="ridge"`` (default 1e-8) and ``fit="trajectory"`` (1e-6).
    phase_end : float, default 0.01
        The phase at the end, s(tau); ``alpha = -ln(phase_end)``.
    overlap : float, default 0.3
        Value of a basis function at its neighbor's center; sets the widths h_i.
    n_points : int, default 200
        Points T that each movement is resampled to before the fit, at most 10,000.
    preprocessing : tuple of steps, default ()
        Steps applied before learning, as `TrimRest` and `Smooth`; they are part of the specification.

    Raises
    ------
    SpecificationError
        A parameter out of its range; the message says what was expected.

    Examples
    --------
    >>> import kineme
    >>> demos = kineme.load_lasa(["CShape"])
    >>> kineme.DMP("bio-inspired", n_basis=20).learn(demos).weights.shape
    (7, 20, 2)
    """

    formulation: str = "bio-inspired"
    n_basis: int = 40
    stiffness: float = 100.0
    damping: float | None = None
    gating: str = "none"
    fit: str = "trajectory"
    regression: str = "local"
    ridge: float | None = None
    phase_end: float = 0.01
    overlap: float = 0.3
    n_points: int = 200
    preprocessing: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        check_choice("formulation", self.formulation, list(FORMULATIONS))
        check_choice("fit", self.fit, FITS)
        check_choice("regression", self.regression, REGRESSIONS)
        self._check_spring_damper()
        check_count("n_points", self.n_points, 10, most=MOST_POINTS)
        if self.fit == "trajectory":
            check_count("n_basis", self.n_basis, 3)
        object.__setattr__(self, "preprocessing", check_steps(self.preprocessing))
        _ = self.basis  # checks its own parameters

    @property
    def basis(self) -> GaussianBasis:
        """Basis functions over the shared canonical system."""
        return GaussianBasis(self.n_basis, self.overlap, self.gating, ExponentialPhase(self.phase_end))

    @property
    def system(self) -> Formulation:
        """The formulation's row in the table."""
        return FORMULATIONS[self.formulation]

    def learn(self, movements: MovementsLike) -> Primitives:
        """Learn one primitive per movement, all in one matrix product.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling.

        Returns
        -------
        Primitives
            Weights, start, goal, initial velocity and duration of each movement.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used: see `Demonstrations`; also a movement that does not move.
        """
        from kineme.primitives.discrete.encode import encode

        return encode(self, movements)
