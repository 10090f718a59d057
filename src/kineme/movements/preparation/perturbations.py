"""Random perturbations of movements: translation, scale, rotation, timing and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kineme.errors import SpecificationError
from kineme.movements.preparation.resample import along, relative_rows, resample_by_phase
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array, check_number, check_seed

N_POINTS = 200  # samples afterwards
_FINE = 1000  # samples between which the warp interpolates linearly, so that it leaves no kinks
_SPEED_KNOTS = 4
_STRONGEST = 100.0  # far beyond any use; powers of much larger strengths overflow
_STREAMS = ("shift", "scale", "rotation", "warp", "noise")  # each has its own random numbers


@dataclass(frozen=True)
class Perturbation:
    """Random perturbations of movements that keep their class.

    Each movement gets its own random values; a strength of 0 leaves a perturbation out. Each perturbation has its own
    stream of random numbers, so changing the strength of one does not change the others.

    Parameters
    ----------
    shift : float
        Translation by up to this many extents in each dimension. The extent is the diagonal of the bounding box.
    scale : float
        Isotropic factor ``2^(scale r)``, r uniform in [-1, 1]: at 1, from half to twice the size.
    rotation : float
        Rotation by an angle uniform within +-rotation [rad], in space about a random axis.
    warp : float
        Uneven speed: the logarithm of the speed is normal with this standard deviation at four even knots, and smooth
        between them (PCHIP). The duration stays.
    noise : float
        Standard deviation of white noise on each sample and dimension, as a share of the extent.

    Raises
    ------
    SpecificationError
        A strength that is negative or not a number.
    """

    shift: float = 0.0
    scale: float = 0.0
    rotation: float = 0.0
    warp: float = 0.0
    noise: float = 0.0

    def __post_init__(self) -> None:
        for name in _STREAMS:
            check_number(name, getattr(self, name), least=0.0, most=_STRONGEST)

    def in_dimensions(self, n_dims: int) -> Perturbation:
        """The same perturbation, without rotation unless `n_dims` is 2 or 3."""
        return self if n_dims in (2, 3) else replace(self, rotation=0.0)

    def apply(self, demonstrations: MovementsLike, seed: int | Sequence[int]) -> Demonstrations:
        """The movements, perturbed, at 200 even samples; labels, names, durations stay.

        Parameters
        ----------
        demonstrations : MovementsLike
            See `Demonstrations.of`.
        seed : int or sequence of int
            The same seed and number of movements give the same random numbers.

        Raises
        ------
        SpecificationError
            A rotation of movements that have neither two nor three dimensions.
        """
        demos = Demonstrations.of(demonstrations)
        n, d = len(demos), demos.n_dims
        if self.rotation > 0 and d not in (2, 3):
            raise SpecificationError(f"expected rotation=0 for movements of {d} dimensions, got {self.rotation!r}")
        check_seed("seed", seed)
        random = {name: np.random.default_rng([k, *np.atleast_1d(seed)]) for k, name in enumerate(_STREAMS)}
        paths = self._warped(demos, random["warp"])
        if self.rotation > 0:
            paths = _rotations(n, d, self.rotation, random["rotation"]) @ paths
        paths = paths * 2.0 ** (self.scale * random["scale"].uniform(-1, 1, (n, 1, 1)))
        extents = np.linalg.norm(np.ptp(paths, axis=2), axis=1)[:, None, None]
        paths += self.shift * extents * random["shift"].uniform(-1, 1, (n, d, 1))
        paths += self.noise * extents * random["noise"].normal(size=paths.shape)
        return Demonstrations.of_movements(along(demos, paths), demos.steps)

    def _warped(self, demonstrations: Demonstrations, random: np.random.Generator) -> Array:
        """Paths (n, d, 200) relative to their start, at even values of the warped time."""
        n = len(demonstrations)
        if self.warp == 0:
            return relative_rows(demonstrations, 0, n, N_POINTS)
        phase = warped_phase(self.warp * random.normal(size=(n, _SPEED_KNOTS)), _FINE)
        return resample_by_phase(relative_rows(demonstrations, 0, n, _FINE), phase, N_POINTS)


def warped_phase(log_speeds: Array, n_samples: int) -> Array:
    """Monotonic phases from 0 to 1, shape (n, n_samples), whose slope is exp(PCHIP through the log speeds (n, k))."""
    from scipy.interpolate import PchipInterpolator

    knots = np.linspace(0.0, 1.0, log_speeds.shape[1])
    speed = np.exp(PchipInterpolator(knots, log_speeds, axis=1)(np.linspace(0.0, 1.0, n_samples)))
    phase = np.zeros_like(speed)
    np.cumsum(speed[:, 1:] + speed[:, :-1], axis=1, out=phase[:, 1:])  # trapezoids
    return np.asarray(phase / phase[:, -1:])


def _rotations(n: int, d: int, angle: float, random: np.random.Generator) -> Array:
    """Rotation matrices (n, d, d) by angles uniform in +-angle."""
    from scipy.spatial.transform import Rotation

    angles = random.uniform(-angle, angle, n)
    axes = random.normal(size=(n, 3)) if d == 3 else np.tile([0.0, 0.0, 1.0], (n, 1))
    axes *= (angles / np.linalg.norm(axes, axis=1))[:, None]
    return np.asarray(Rotation.from_rotvec(axes).as_matrix()[:, :d, :d])
