"""One movement that turns into another on the way."""

from __future__ import annotations

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.modulation.carried_over import carried_over
from kineme.dmp.modulation.parts import moving, within
from kineme.dmp.modulation.refit import fitting_specification, refitted, smooth_rise
from kineme.validation import Array


def blend(first: Primitives | Rollout, second: Primitives | Rollout, stretch: tuple[float, float]) -> Primitives:
    """One movement that begins as the first and ends as the second, and changes from one to the other over a stretch.

    Both go on at the same phase t / tau, ``x = (1 - b) x_first + b x_second``, with b rising from 0 to 1 over the
    stretch, with its first two derivatives: so position, velocity and acceleration are continuous. The tempo changes
    in the same way.

    Parameters
    ----------
    first, second : Primitives or Rollout
        Of one movement or of n.
    stretch : tuple of float
        Where the change begins and where it ends, as shares of the duration.

    Returns
    -------
    Primitives
        As of `join`, with the larger number of basis functions. Discrete channels are those of the second movement
        from the middle of the stretch on.

    Raises
    ------
    TrajectoryError
        Something else than primitives and rollouts, different dimensions or numbers of movements; channels
        that are known to differ, as joint angles and positions.
    SpecificationError
        A stretch that is not within the movement.
    """
    movements = moving([first, second])
    begin, end = within(stretch, "stretch")
    dmp = fitting_specification(movements, max(one.dmp.n_basis for one in movements))
    laid = [one.rollout(n_samples=dmp.n_points) for one in movements]
    u = np.linspace(0.0, 1.0, dmp.n_points)
    share = smooth_rise(u - begin, end - begin)
    path = (1.0 - share)[:, None] * laid[0].positions + share[:, None] * laid[1].positions
    pace = np.outer(movements[0].durations, 1.0 - share) + np.outer(movements[1].durations, share)  # dt / du
    steps = 0.5 * (pace[:, 1:] + pace[:, :-1]) / (dmp.n_points - 1)
    times = np.concatenate((np.zeros((len(path), 1)), np.cumsum(steps, axis=1)), axis=1)
    shares = times / times[:, -1:]
    switch = _at_phase(shares, 0.5 * (begin + end))
    ends = (laid[0].velocities[:, 0], laid[1].positions[:, -1], laid[1].velocities[:, -1])
    return carried_over(refitted(dmp, path, times, ends), movements, [shares, shares], switch[None])


def _at_phase(shares: Array, u: float) -> Array:
    """The columns (n,) of numbers at even phases (n, T) at phase u."""
    return np.array([np.interp(u, np.linspace(0.0, 1.0, shares.shape[1]), one) for one in shares])
