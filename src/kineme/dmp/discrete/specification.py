"""Parameters of a discrete DMP, checked: the canonical system, basis functions over its phase, spring and fit.

In normalized time u = t / tau every formulation is one linear spring-damper,

    x'' = K (g - x) - D x' + scale f(s) + coupling(s) (g - x0),        ' = d/du,

and only scale and coupling differ: encoding, decoding and features are written once for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.dmp.spring_damper import SpringDamper
from kineme.errors import DegenerateMovementError, DegenerateMovementWarning, SpecificationError, warn
from kineme.movements.preparation.trim import check_steps
from kineme.validation import Array, check_choice, check_count, check_number, describe

#: Share of its largest extent within which the goal of a movement counts as equal to its start.
ZERO = 1e-9

_NEAR = 1e-2  # of its largest extent; the original formulation magnifies noise a hundredfold there


@dataclass(frozen=True)
class Formulation:
    """One row of `FORMULATIONS`."""

    name: str
    equation: str  # the transformation system as the paper prints it
    coupling: Callable[[float, Array], Array]  # of K and s: of g - x0, and of x - x0 in the shape-attractor term
    ratio: Callable[[Array, Array, Array], Array]  # new by learned g - x0 and extents, all (n, d): a factor of scale f
    divides_by_amplitude: bool = False  # scale is g - x0, and weights and f do not exist where it is 0; else K

    def scale(self, stiffness: float, amplitude: Array) -> Array:
        """The factor of f in the equation, for learned amplitudes g - x0 of any shape."""
        return amplitude if self.divides_by_amplitude else np.full_like(amplitude, stiffness)


def _per_dimension(new: Array, learned: Array, extents: Array) -> Array:
    # A g - x0 that is rounding error would mirror and magnify the shape.
    nothing = ZERO * extents.max(axis=-1, keepdims=True)
    closed = np.abs(learned) <= nothing
    ratio = np.where(np.abs(new) <= nothing, 1.0, np.inf)
    return np.divide(new, learned, out=ratio, where=~closed)


def _unchanged(new: Array, learned: Array, extents: Array) -> Array:
    return np.ones_like(new)


def _isotropic(new: Array, learned: Array, extents: Array) -> Array:
    distance = np.linalg.norm(learned, axis=-1, keepdims=True)
    closed = distance <= CLOSED * extents.max(axis=-1, keepdims=True)
    ratio = np.linalg.norm(new, axis=-1, keepdims=True) / np.where(closed, 1.0, distance)
    return np.broadcast_to(np.where(closed, 1.0, ratio), new.shape)


#: Share of its extent within which a movement that ends there counts as closed for the amplitude-scaled formulation.
CLOSED = 0.05

#: Phase at which shape and goal have equal weight in the decoupled formulation; 35 % of the time for s(tau) = 0.01.
HANDOVER = 0.2


def late_shape_weight(s: Array) -> Array:
    """Weight of the shape-attractor in the decoupled formulation: 1 at the start, 0 in the end.

    ``w_s(s) = (1 + c^3) s^3 / (s^3 + c^3)`` with c = `HANDOVER`: a logistic curve in time. With K = 100 a change of the
    goal has gone through to 7 % at 30 % of the time, against 39 % in Eq. (4), to 20 % at 40 % of the time, against 56
    %, and to 98 % at the end, against 97 %, with a smaller largest acceleration. Later or slower curves arrive late.
    """
    return (1.0 + HANDOVER**3) * s**3 / (s**3 + HANDOVER**3)


FORMULATIONS = {
    row.name: row
    for row in (
        Formulation(
            name="original",
            equation="tau v' = K (g - x) + (g - x0) f(s) - D v  (Eq. 1)",
            divides_by_amplitude=True,
            coupling=lambda K, s: 0.0 * s,  # of tensors, too
            ratio=_per_dimension,
        ),
        # Eq. (4) multiplied out: s K (f/s + x0 - x) + (1 - s) K (g - x) = K (g - x) + K f - K s (g - x0).
        Formulation(
            name="bio-inspired",
            equation="tau v' = s K (f(s)/s + x0 - x) + (1 - s) K (g - x) - D v  (Eq. 4)",
            coupling=lambda K, s: -K * s,
            ratio=_unchanged,
        ),
        # Eq. (4) with f multiplied by the ratio of the distances from start to goal, new over learned: one factor
        # for all dimensions, never negative, so a nearer goal shrinks the shape and nothing is mirrored. Closed
        # movements keep their size.
        Formulation(
            name="amplitude-scaled",
            equation="tau v' = s K (r f(s)/s + x0 - x) + (1 - s) K (g - x) - D v,  r = |g - x0| / |g - x0| learned",
            coupling=lambda K, s: -K * s,
            ratio=_isotropic,
        ),
        # From Prada and Remazeilles (2012), the paper's [9]: each attractor has a weight of its own, so that the goal
        # can act later than with s. Chosen here: a logistic curve in time, and weights whose sum is 1, which keeps the
        # spring constant: K f + w_s K (x0 - x) + (1 - w_s) K (g - x) = K (g - x) + K f - K w_s (g - x0).
        Formulation(
            name="decoupled",
            equation="tau v' = w_s K (f(s)/w_s + x0 - x) + w_g K (g - x) - D v,  w_g = 1 - w_s, w_s logistic in time",
            coupling=lambda K, s: -K * late_shape_weight(s),
            ratio=_unchanged,
        ),
    )
}


def safe_amplitudes(amplitudes: Array, extents: Array, names: Sequence[str | None] | None, feature: str) -> Array:
    """Return `amplitudes` g - x0 (n, d) if none is zero; warn where one is below 1 % of the largest extent."""
    relative = np.abs(amplitudes) / extents.max(axis=1, keepdims=True)
    zero = relative <= ZERO
    if zero.any():
        i, k = (int(index) for index in np.argwhere(zero)[0])
        raise DegenerateMovementError(
            f"{describe(i, names)}: expected g != x0 in every dimension, got equal start and goal in "
            f"dimension {k} ({zero.any(axis=1).sum()} of {len(zero)} movements are closed or flat); the original "
            f'formulation divides by g - x0 to get {feature}: use feature "shape-attractor", which does not, or the '
            '"bio-inspired" formulation'
        )
    near = (relative < _NEAR).any(axis=1)
    if near.any():
        warn(
            f"{near.sum()} of {len(near)} movements end within 1 % of their extent from where they start, in some "
            f"dimension (first: {describe(int(np.argmax(near)), names)}); "
            f'their {feature} are large and fragile: prefer "shape-attractor" or the "bio-inspired" formulation',
            DegenerateMovementWarning,
            stacklevel=4,
        )
    return amplitudes


REGRESSIONS = ("local", "ridge")
GATINGS = ("none", "phase")
MOST_BASIS = 2_000  # the response to N functions takes 32 N^2 numbers
# Beyond these limits the centers c_i, or squares of their distances, are equal after rounding.
_SMALLEST, _LARGEST = 1e-100, 0.999

MOST_POINTS = 10_000  # a fit with T points needs matrices of T^2 numbers


@dataclass(frozen=True)
class Specification(SpringDamper):
    """Parameters of a `DMP`, which explains them."""

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

    def terms(self, u: Array) -> Array:
        """Return basis functions and coupling at normalized times u (T,), shape (T, N + 1)."""
        return np.column_stack((self.basis.design(u), self.system.coupling(self.K, self.basis.phase(u))))

    @property
    def system(self) -> Formulation:
        """The formulation's row in the table."""
        return FORMULATIONS[self.formulation]


@dataclass(frozen=True)
class ExponentialPhase:
    """Exponential decay ``tau ds/dt = -alpha s``, so ``s(u) = exp(-alpha u)`` with ``u = t / tau`` (Section 2.1)."""

    end: float = 0.01  # the phase at the end of the movement, s(tau), between 0 and 1; ``alpha = -ln(end)``

    def __post_init__(self) -> None:
        check_number("phase_end", self.end, above=0.0, smallest=0.0)
        if not _SMALLEST <= self.end <= _LARGEST:
            raise SpecificationError(
                f"expected phase_end to be between {_SMALLEST:g} and {_LARGEST:g}, got {self.end!r}"
            )

    @property
    def alpha(self) -> float:
        """Rate of decay."""
        return -math.log(self.end)

    def __call__(self, u: Array) -> Array:
        """Phase at normalized times `u` = t / tau."""
        return np.exp(-self.alpha * u)


@dataclass(frozen=True)
class GaussianBasis:
    """Basis functions ``psi_i(s) = exp(-h_i (s - c_i)^2)``, Eq. (3), with centers equally spaced in time."""

    n_basis: int  # number N of basis functions
    overlap: float  # value of each function at the next center: ``h_i = -ln(overlap) / (c_{i+1} - c_i)^2``
    gating: str  # "phase" if f is Eq. (2) times s; papers mix the two and call both f
    phase: ExponentialPhase  # maps time to s

    def __post_init__(self) -> None:
        check_count("n_basis", self.n_basis, 2, most=MOST_BASIS)
        check_number("overlap", self.overlap, above=0.0, below=1.0)
        check_choice("gating", self.gating, GATINGS)

    @property
    def centers(self) -> Array:
        """Centers c_i, shape (N,), from 1 down to the phase's end."""
        return self.phase(np.linspace(0.0, 1.0, self.n_basis))

    @property
    def widths(self) -> Array:
        """Factors h_i, shape (N,)."""
        gaps = -np.diff(self.centers)
        return -math.log(self.overlap) / np.append(gaps, gaps[-1]) ** 2

    def activations(self, u: Array) -> Array:
        """Eq. (3) at u (T,), shape (T, N), up to a factor per row that makes its largest 1: Eq. (2) is never 0/0."""
        exponents = self.exponents(u)
        return np.exp(exponents - exponents.max(axis=1, keepdims=True))

    def exponents(self, u: Array) -> Array:
        """Logarithms of Eq. (3) at normalized times u (T,), shape (T, N)."""
        return -self.widths * (self.phase(u)[:, None] - self.centers) ** 2

    def design(self, u: Array) -> Array:
        """Matrix (T, N) that maps weights w to f, Eq. (2), times s if gated."""
        psi = self.activations(u)
        normalized = psi / psi.sum(axis=1, keepdims=True)
        return normalized * self.gate(u)[:, None]

    def gate(self, u: Array) -> Array:
        """The factor that f carries besides the basis, shape (T,): s if gated, else 1.

        Past the end, where Eq. (2) leaves f open, an ungated f decays with the phase, as ``s / s(tau)``: the last
        weight would keep the movement away from its goal forever.
        """
        s = self.phase(u)
        return s if self.gating == "phase" else np.minimum(1.0, s / self.phase.end)
