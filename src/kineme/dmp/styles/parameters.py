"""The numbers that a movement depends on linearly, the way back to primitives, and conditioning on observations.

Over the phase u = t / tau a movement is linear in ``theta = [W, x0, g, tau v0]`` (N + 3 numbers for each dimension):

    x(u) = Phi W + (1 - goal) x0 + goal g + velocity tau v0.

So the mean of many theta makes the mean of the paths, and a covariance of theta that of the path. This holds for the
scaled weights W, and not for w: in the original formulation the mean of ``w = W / (g - x0)`` belongs to no mean path.

Theta and ln tau together have the covariance ``Sigma = F' F``. A position is linear in theta, so conditioning on it is
exact (A. Paraschos, C. Daniel, J. Peters and G. Neumann, "Probabilistic Movement Primitives", NIPS 2013, Section 2.2):

    mean += Sigma A' (A Sigma A' + diag(s^2))^-1 e,    Sigma -= Sigma A' (A Sigma A' + diag(s^2))^-1 A Sigma.

A velocity v is met where ``dx/du = v tau``, which is not linear in ln tau: a few Gauss-Newton steps find it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from kineme.dmp.batch import Batch
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import Response, condition, decoder, decoder_at
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError, warn
from kineme.movements.channels.channel import Channels, check_alike
from kineme.movements.channels.coordinates import in_one_turn
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import LARGEST, Array, as_numbers

_STEPS = 50
_RARE = 0.0027  # share of demonstrations beyond three standard deviations, in one dimension
_NOTHING = 1e-7  # of the extent: deviations below it are rounding, of what was met exactly before
_MET = 1e-6  # of the extent
_SETTLED = 1e-13  # of the duration
_UNSETTLED = 1e-6  # of the duration: what is less is not worth a word
_TEMPO = float(np.log(1e6))  # larger changes of the duration are no movement
_KINDS = ("position", "velocity")


def to_numbers(primitives: Primitives) -> Array:
    """The numbers theta of each primitive, shape (n, d, N + 3)."""
    check_primitives(primitives)
    tangents = primitives.velocities * primitives.durations[:, None]  # dx/du at the start
    rest = np.stack((primitives.starts, primitives.goals, tangents), axis=2)
    return np.concatenate((primitives.scaled_weights, rest), axis=2)


def check_primitives(primitives: Any) -> None:
    """Refuse movements that are not learned yet, and rhythms and poses, which are no such numbers."""
    if not isinstance(primitives, Primitives):
        raise TrajectoryError(
            f"expected kineme.dmp.Primitives, got {type(primitives).__name__}; learn movements first, "
            "kineme.DMP().learn(movements), and take the tangent of pose primitives"
        )


def as_primitives(movements: Primitives | MovementsLike, dmp: DMP | None = None) -> Primitives:
    """Primitives, angles in one turn; movements as `dmp`, by default ``DMP()``, learns them, no rhythms and poses."""
    if isinstance(movements, Batch):
        check_primitives(movements)
    primitives = movements if isinstance(movements, Primitives) else (dmp or DMP()).learn(movements)
    about = primitives.recorded_as
    if about is None:
        return primitives
    return without_turns(primitives, in_one_turn(primitives.starts, about.periods(primitives.starts)))


def without_turns(primitives: Primitives, turns: Array) -> Primitives:
    """Primitives less whole turns (n, d): each recording is unwrapped from its own first sample."""
    if not turns.any():
        return primitives
    return replace(primitives, starts=primitives.starts - turns, goals=primitives.goals - turns)


def of_kind(
    movements: Primitives | MovementsLike,
    dmp: DMP,
    n_dims: int,
    channels: Channels | None,
    whose: str,
    remedy: str = "",
) -> Primitives:
    """Movements as primitives of this specification, dimension and kind of channels; others are refused."""
    primitives = movements if isinstance(movements, Primitives) else dmp.learn(movements)
    if primitives.dmp != dmp:
        raise SpecificationError(f"expected primitives of {whose} specification, {dmp}, got {primitives.dmp}{remedy}")
    if primitives.n_dims != n_dims:
        raise SpecificationError(f"expected movements of {n_dims} dimensions, got {primitives.n_dims}")
    check_alike([channels, primitives.moving_channels], "movement")
    return primitives


def from_numbers(
    dmp: DMP, theta: Array, durations: Array, label: Any = None, about: RecordedAs | None = None
) -> Primitives:
    """Primitives from theta (n, d, N + 3) and tau (n,) [s]; all of them get `label`, unless it is None, and `about`."""
    path = map_rows(theta, path_matrix(dmp, dmp.n_points))
    labels: NDArray[Any] | None = None if label is None else label_array([label] * len(theta))
    return Primitives(
        dmp,
        scaled_weights=np.ascontiguousarray(theta[:, :, :-3]),
        starts=theta[:, :, -3].copy(),
        goals=theta[:, :, -2].copy(),
        velocities=theta[:, :, -1] / durations[:, None],
        durations=durations,
        extents=np.ptp(path, axis=2),
        labels=labels,
        recorded_as=about,
    )


def with_numbers(primitives: Primitives, theta: Array, durations: Array) -> Primitives:
    """Primitives from theta and tau, with what these primitives have in common."""
    return from_numbers(primitives.dmp, theta, durations, shared_label(primitives), shared_recording(primitives))


def path_matrix(dmp: Specification, n_samples: int, derivative: int = 0) -> Array:
    """From theta to the path at `n_samples` even phases, or to its derivative in u; shape (N + 3, n_samples)."""
    return response_matrix(decoder(dmp, n_samples), derivative)


def response_matrix(response: Response, derivative: int = 0) -> Array:
    """The same at the times of a response, shape (N + 3, T)."""
    goal = response.goal[derivative]
    start = -goal if derivative else 1.0 - goal
    return np.vstack((response.Phi[derivative].T, start, goal, response.velocity[derivative]))


def map_rows(theta: Array, matrix: Array) -> Array:
    """``theta @ matrix``, shape (n, d, n_samples), as one product: a stack would become as many small ones."""
    return (theta.reshape(-1, theta.shape[2]) @ matrix).reshape(*theta.shape[:2], matrix.shape[1])


def shared_recording(primitives: Primitives) -> RecordedAs | None:
    """Return the common channels of primitives, without the steps of discrete ones: those are of one movement each."""
    return None if primitives.recorded_as is None else replace(primitives.recorded_as, steps=None)


def shared_label(primitives: Primitives) -> Any:
    """The label that all primitives have, or None."""
    labels = primitives.labels
    return labels[0] if labels is not None and (labels == labels[0]).all() else None


class _Rows(NamedTuple):
    """K observed numbers as linear functions of theta (d (N + 3),)."""

    order: Array  # (K,), 0 for a position, 1 for a velocity
    times: Array  # (K,)
    matrix: Array  # (K, d (N + 3))
    values: Array  # (K,)
    deviations: Array  # (K,)


def updated(
    primitive: Primitives, factor: Array, tempo_factor: Array, kinds: tuple[Observations | None, Observations | None]
) -> tuple[Array, Array, Array, Array]:
    """Theta, duration (1,) and both factors of an average that is conditioned on positions and velocities."""
    d, n_numbers = factor.shape[1:]
    rows = _rows(primitive.dmp, d, kinds)
    theta = to_numbers(primitive).ravel()
    extent = float(primitive.extents.max())
    both = np.column_stack((factor.reshape(len(factor), d * n_numbers), tempo_factor))
    tau, root = float(primitive.durations[0]), _Root()
    change, remaining = np.zeros(len(theta) + 1), both
    for step in range(_STEPS):
        ln_tau = root.at
        now = tau * np.exp(ln_tau)
        speed = np.where(rows.order == 1, rows.values, 0.0) * now
        matrix = np.column_stack((rows.matrix, -speed))
        expected = np.where(rows.order == 1, speed * (1.0 - ln_tau), rows.values)
        error, deviation = expected - rows.matrix @ theta, rows.deviations * np.where(rows.order == 1, now, 1.0)
        if step == 0:
            _warn_outside(rows, both @ matrix.T, error, deviation, now, extent)
        open_ones = _open(rows, both @ matrix.T, error, deviation, extent)
        conditioned = condition(both, matrix[open_ones], deviation[open_ones])
        change, remaining = error[open_ones] @ conditioned.gain, conditioned.factor
        if not speed.any() or root.found(float(change[-1]) - ln_tau):
            break
    else:
        if (left := abs(float(change[-1]) - ln_tau)) > _UNSETTLED:
            warn(
                f"after {_STEPS} steps the duration of the conditioned movement still changes by {100 * left:.2g} % "
                "a step, so the velocities are met about as closely only; give a larger velocity_std, fewer "
                "velocities, or such as were demonstrated",
                ExtrapolationWarning,
                stacklevel=3,
            )
    if not abs(change[-1]) <= _TEMPO:
        raise SpecificationError(
            "expected positions and velocities that a movement like the demonstrations could have, got such that its "
            f"duration would change by a factor of 10^{change[-1] / np.log(10.0):.3g}; demonstrate such a movement, or "
            "give a larger std"
        )
    return (
        (theta + change[:-1]).reshape(1, d, n_numbers),
        primitive.durations * np.exp(change[-1]),
        remaining[:, :-1].reshape(factor.shape),
        remaining[:, -1].copy(),
    )


class _Root:
    """The place where a falling function of ln tau is 0: by secants, halving where these lead out of the bracket."""

    def __init__(self) -> None:
        self.at = 0.0
        self._bracket = [-np.inf, np.inf]
        self._last: tuple[float, float] | None = None

    def found(self, value: float) -> bool:
        """Tell whether it is where the function has this value; else `at` is where to look next."""
        at, self._bracket[int(value < 0.0)] = self.at, self.at
        step = value
        if self._last is not None and value != self._last[1]:
            step = value * (at - self._last[0]) / (self._last[1] - value)
        low, high = self._bracket
        if not low < at + step < high:
            step = 0.5 * (low + high) - at if np.isfinite(low + high) else value
        self._last = at, value
        self.at = float(np.clip(at + step, -2.0 * _TEMPO, 2.0 * _TEMPO))
        return abs(value) <= _SETTLED or abs(self.at - at) <= _SETTLED


def _rows(dmp: Specification, d: int, kinds: tuple[Observations | None, Observations | None]) -> _Rows:
    parts = []
    for order, observed in enumerate(kinds):
        if observed is None:
            continue
        at = response_matrix(decoder_at(dmp, tuple(observed.times.tolist())), order).T  # (m, N + 3)
        j, k = np.nonzero(~np.isnan(observed.values))
        matrix = np.zeros((len(j), d, at.shape[1]))
        matrix[np.arange(len(j)), k] = at[j]
        parts.append(
            _Rows(
                np.full(len(j), order),
                observed.times[j],
                matrix.reshape(len(j), d * at.shape[1]),
                observed.values[j, k],
                observed.deviations[j, k],
            )
        )
    return _Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _open(rows: _Rows, whitened: Array, error: Array, deviation: Array, extent: float) -> Array:
    """Return which rows (K,) are left to be met: not those that are met by every movement of the distribution."""
    still = (np.linalg.norm(whitened, axis=0) <= _NOTHING * extent) & (deviation == 0.0)
    impossible = still & (np.abs(error) > _MET * extent)
    if impossible.any():
        k = int(np.argmax(impossible))
        raise SpecificationError(
            f"the {_KINDS[int(rows.order[k])]} at {rows.times[k]:g} of the duration: expected one that the "
            f"demonstrations have there, for they all agree, got one that is {abs(error[k]):.3g} off; demonstrate it, "
            "or give a std above 0"
        )
    exact = ~still & (deviation == 0.0)
    unit = np.linalg.norm(whitened[:, exact], axis=0)
    rank = int(np.linalg.matrix_rank(whitened[:, exact] / unit, tol=1e-10)) if exact.any() else 0
    if rank < exact.sum():
        raise SpecificationError(
            f"expected numbers that the demonstrations can meet exactly, got {exact.sum()} of which {rank} are "
            f"independent: they differ in few directions; give a std above 0, or demonstrate more"
        )
    return ~still


def _warn_outside(rows: _Rows, whitened: Array, error: Array, deviation: Array, tau: float, extent: float) -> None:
    """Say how far the observation that is farthest from the demonstrations is from them."""
    ratio, said = 1.0, ""
    for order, time in sorted(set(zip(rows.order.tolist(), rows.times.tolist(), strict=True))):
        here = (rows.order == order) & (rows.times == time)
        distance = mahalanobis(whitened[:, here], error[here], deviation[here], extent)
        usual, per = float(np.sqrt(chdtri(here.sum(), _RARE))), tau if order else 1.0
        if distance > ratio * usual:
            ratio = distance / usual
            said = (
                f"the {_KINDS[order]} at {time:g} of the duration is outside what was demonstrated: "
                f"{np.linalg.norm(error[here]) / per:.3g} from the average, where demonstrations are "
                f"{np.linalg.norm(whitened[:, here]) / per:.3g} from it, {distance:.3g} standard deviations "
                "(Mahalanobis)"
            )
    if said:
        message = f"{said}; the movement is a guess there: demonstrate such a one, or give a larger std"
        warn(message, ExtrapolationWarning, stacklevel=4)


def mahalanobis(whitened: Array, error: Array, deviation: Array, extent: float) -> float:
    """``sqrt(e' (B' B + diag(s^2))^-1 e)`` of ``B`` (r, k); infinite where nothing varies."""
    stacked = np.vstack((whitened, np.diag(deviation)))
    needed = np.linalg.lstsq(stacked.T, error, rcond=1e-10)[0]
    met = np.abs(stacked.T @ needed - error).max() <= _MET * extent
    return float(np.linalg.norm(needed)) if met else float("inf")


class Observations(NamedTuple):
    """The m d values of one kind that may be observed, of which NaN are not."""

    times: Array  # (m,), shares of the duration
    values: Array  # (m, d)
    deviations: Array  # (m, d)


def as_observations(name: str, times: Array, values: ArrayLike, std: ArrayLike, n_dims: int) -> Observations:
    """Check values (m, d), with NaN for dimensions that are free, and their standard deviations."""
    m = len(times)
    x = as_numbers(values, name)
    flat = m == 1 and (x.shape == (n_dims,) or (n_dims == 1 and not x.ndim))
    x = x.reshape(m, n_dims) if flat or (n_dims == 1 and x.shape == (m,)) else x
    if x.shape != (m, n_dims):
        shape = f"({n_dims},) or (1, {n_dims})" if m == 1 else f"({m}, {n_dims})"
        raise TrajectoryError(f"expected {name} of shape {shape}, one for each of {m} times, got {np.shape(values)}")
    if (np.abs(x) > LARGEST).any() or np.isnan(x).all():
        raise TrajectoryError(
            f"expected {name} to be numbers up to {LARGEST:g}, with NaN for dimensions that are free, got {values!r}"
        )
    s = as_numbers(std, "std")
    if s.ndim == 1 and len(s) == m and (m > 1 or n_dims == 1):
        s = s[:, None]
    try:
        deviations = np.broadcast_to(s, (m, n_dims))
    except ValueError:
        raise SpecificationError(
            f"expected std to be a number or of shape ({m},) or ({m}, {n_dims}), got {s.shape}"
        ) from None
    if not (deviations >= 0.0).all():
        raise SpecificationError(f"expected std of 0 or more, got {std!r}")
    free = deviations > LARGEST  # infinitely uncertain: not observed
    return Observations(times, np.where(free, np.nan, x), np.where(free, 0.0, deviations))
