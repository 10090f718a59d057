"""The specification of a rhythmic DMP."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from kineme.movements.preparation.preprocess import check_steps
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.primitives.discrete.dmp import MOST_POINTS
from kineme.primitives.discrete.fits import FITS
from kineme.primitives.rhythmic.basis import VonMisesBasis
from kineme.primitives.spring_damper import SpringDamper
from kineme.validation import check_choice, check_count, check_number

if TYPE_CHECKING:
    from kineme.primitives.rhythmic.primitives import RhythmicPrimitives

APERIODIC = ("raise", "accept")


@dataclass(frozen=True)
class RhythmicDMP(SpringDamper):
    """A rhythmic Dynamical Movement Primitive, as a frozen specification: a limit cycle that attracts.

    With the phase ``phi = 2 pi t / period`` shared by all dimensions, and in time u = t / period (' = d/du),

        x'' = K (b - x) - D x' + r f(phi),    f(phi) = sum_i psi_i(phi) w_i / sum_i psi_i(phi),

    ``psi_i = exp(h (cos(phi - c_i) - 1))``, baseline b and amplitude r.

    Parameters
    ----------
    n_basis : int, default 25
        Number N of basis functions; they hold about N / 2 harmonics.
    stiffness : float, default 100.0
        Spring constant K, in units of 1 / period^2.
    damping : float, optional
        Damping D; by default critical, ``2 sqrt(K)``.
    fit : {"trajectory", "forcing"}, default "trajectory"
        Fit the path itself on the system's periodic response, or solve the equation for f and fit that. On noisy
        recordings the first finds f with a third of the error.
    ridge : float, optional
        Strength of the penalty, by default 1e-8 on the weights (forcing) and 1e-6 on their curvature (trajectory).
    n_points : int, default 200
        Number T of phases at which the fit compares paths.
    overlap : float, default 0.5
        Value of a basis function at its neighbor's center; sets the width h.
    period : float, optional
        Period of all movements [s]; by default it is estimated from each recording, which must then hold 1.5 periods.
    align_on : int, optional
        Dimension whose first harmonic is largest at phase 0. By default that with the largest first harmonic, chosen
        for each movement; to compare movements in which two dimensions are alike, name one.
    aperiodic : {"raise", "accept"}, default "raise"
        For a recording without a clear period: an error, or the best estimate, at worst the whole recording as one
        period.
    preprocessing : tuple of steps, default ()
        Steps applied before learning; they are part of the specification.

    Raises
    ------
    SpecificationError
        A parameter out of its range; the message says what was expected.

    Notes
    -----
    Ijspeert et al. write ``tau = period / (2 pi)`` and measure stiffness per tau^2: their alpha_z = 25, beta_z = 25/4
    is K = 4 pi^2 alpha_z beta_z = 6168.5 here. Instead of locally weighted regression the weights are found jointly,
    and r is estimated instead of set to 1.

    References
    ----------
    A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives: Learning Attractor
    Models for Motor Behaviors", Neural Computation 25(2), 2013: Eqs. (2.1), (2.5) and (2.6), Table 1.

    Examples
    --------
    >>> import numpy as np, kineme
    >>> t = np.linspace(0.0, 2.5, 200)
    >>> wave = kineme.Trajectory(t, np.sin(2 * np.pi * t / 0.8))
    >>> learned = kineme.RhythmicDMP().learn(wave)
    >>> float(learned.periods[0].round(6))
    0.8
    """

    n_basis: int = 25
    stiffness: float = 100.0
    damping: float | None = None
    fit: str = "trajectory"
    ridge: float | None = None
    n_points: int = 200
    overlap: float = 0.5
    period: float | None = None
    align_on: int | None = None
    aperiodic: str = "raise"
    preprocessing: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        check_choice("fit", self.fit, FITS)
        check_choice("aperiodic", self.aperiodic, APERIODIC)
        self._check_spring_damper()
        if self.period is not None:
            check_number("period", self.period, above=0.0)
        if self.align_on is not None:
            check_count("align_on", self.align_on, 0)
        _ = self.basis  # checks its own parameters
        check_count("n_points", self.n_points, 2 * self.n_basis, most=MOST_POINTS)
        object.__setattr__(self, "preprocessing", check_steps(self.preprocessing))

    @property
    def basis(self) -> VonMisesBasis:
        """Basis functions over the phase."""
        return VonMisesBasis(self.n_basis, self.overlap)

    @property
    def n_harmonics(self) -> int:
        """Number of harmonics of the folded cycle: twice as many as the basis functions can represent."""
        return min(self.n_basis, (self.n_points - 1) // 2)

    def learn(self, movements: MovementsLike) -> RhythmicPrimitives:
        """Learn one limit cycle per movement.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling, any number of periods from 1.5 on, or from 1 on if the period is given.

        Returns
        -------
        RhythmicPrimitives
            Weights, baseline, amplitude, period and starting phase of each movement.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used: see `Demonstrations`; no period found; less than one period; fewer than four
            samples per period; a movement that does not move.
        """
        from kineme.primitives.rhythmic.encode import encode

        return encode(self, movements)
