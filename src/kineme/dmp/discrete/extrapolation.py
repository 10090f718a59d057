"""What is said of changes that lead outside what was demonstrated: how far, how loosely, how wide."""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.rollout import Change, Rollout
from kineme.dmp.discrete.via_points import SHARES, Span, ViaPoints
from kineme.errors import ExtrapolationWarning, warn
from kineme.validation import Array

_LOOSE = 1e-3  # of the extent: a stretch that is met less closely is said
_WIDE = 3.0  # times the extent and what is missing: a change that leads farther away is said


class Measured(NamedTuple):
    """Dimensions of one unit, whose distances are measured together."""

    dims: slice = slice(None)
    unit: str = ""  # with a space before it
    least: float = sys.float_info.min  # the extent of movements that hardly move in these dimensions


MEASURED = Measured()


class Changed(NamedTuple):
    """What a change of the weights does to movements."""

    change: Change
    left: Array | None  # (n, d, K) of what it was to make up for; None where nothing is left
    looks: Array  # (N, T), from weights to the path


def warn_far(
    extents: Array, asked: ViaPoints, errors: Array, measured: Measured = MEASURED, span: Span = SHARES
) -> None:
    """Say how far a via point is from the path as it is, if that is farther than the movement is large, `extents` (n,).

    `errors` (n, d, K or more) is what is missing at the points.
    """
    distances, unit = _distances(asked, errors, measured), measured.unit
    far = distances > extents[:, None]
    if far.any():
        i, j = np.unravel_index(int(np.argmax(distances / extents[:, None])), far.shape)
        warn(
            f"{far.any(axis=1).sum()} of {len(far)} movements have a via point outside what was demonstrated: the one "
            f"at {span.where.format(asked.times[j] * span.end)} is {distances[i, j]:.3g}{unit} from the path of "
            f"movement {i} at that time, which is {extents[i]:.3g}{unit} large; check its unit and frame, or "
            "demonstrate such a movement",
            ExtrapolationWarning,
            stacklevel=4,
        )


def warn_changed(
    extents: Array, asked: ViaPoints, errors: Array, changed: Changed, measured: Measured = MEASURED
) -> None:
    """Say how far a movement stays from a stretch that it does not follow, or how far it is led from its path."""
    unit = measured.unit
    asked_for = _distances(asked, errors, measured).max(axis=1, initial=0.0)
    much = _WIDE * np.maximum(extents, asked_for)
    farthest = _farthest(changed, much, measured)
    wide = farthest > much
    missed = np.zeros(len(much)) if changed.left is None else _distances(asked, changed.left, measured).max(axis=1)
    if (missed > _LOOSE * extents).any():
        i = int(np.argmax(missed / extents))
        one = changed.change._replace(coefficients=changed.change.coefficients[[i]])
        swing = _farthest(changed._replace(change=one), np.full(1, -1.0), measured)
        message = (
            f"movement {i} stays {missed[i]:.3g}{unit} from its via stretch, {100 * missed[i] / extents[i]:.2g} % of "
            f"its extent, and is led away from its path by {swing[0]:.3g}{unit}, where the stretch is "
            f"{asked_for[i]:.3g}{unit} from it: the stretch bends more than {len(changed.looks)} basis "
            "functions can; smooth its points, as kineme.Smooth does, give fewer of them, or use more basis functions; "
            "AveragePrimitive.condition(t, position, std) passes near points that are not exact"
        )
    elif wide.any():
        i = int(np.argmax(np.where(wide, farthest / extents, 0.0)))
        message = (
            f"{wide.sum()} of {len(wide)} movements are led far away by their via points or end velocity: movement {i} "
            f"by {farthest[i]:.3g}{unit}, which is {extents[i]:.3g}{unit} large; different places at almost the same "
            "time, or close to the start or the end, need high velocities: move their times apart, or ask for a lower "
            "velocity"
        )
    else:
        return
    warn(message, ExtrapolationWarning, stacklevel=4)


def extents_of(movement: Rollout, measured: Measured) -> Array:
    """How large each movement is (n,): the diagonal of its bounding box."""
    between = np.abs(movement.arrivals - movement.starts)
    sides = np.maximum(movement.primitives.extents, between)[:, measured.dims]
    return np.maximum(np.sqrt(np.einsum("nd,nd->n", sides, sides)), measured.least)


def _distances(asked: ViaPoints, errors: Array, measured: Measured) -> Array:
    """Of the paths from the via points (n, k), in the dimensions that are not free."""
    missing = errors[:, measured.dims, : len(asked.times)]
    missing = np.where(np.isnan(missing), 0.0, missing)
    return np.asarray(np.sqrt(np.einsum("ndk,ndk->nk", missing, missing)))


def _farthest(changed: Changed, much: Array, measured: Measured) -> Array:
    """How far a change leads each movement away in a coordinate (n,); where it is not `much`, at most so far."""
    change, effect = changed.change, changed.change.directions @ changed.looks
    coefficients = change.coefficients[:, measured.dims]
    farthest = (np.abs(coefficients) @ np.abs(effect).max(axis=1)).max(axis=1)
    near = np.flatnonzero(farthest > much)
    farthest[near] = np.abs(coefficients[near] @ effect).max(axis=(1, 2))
    return np.asarray(farthest)
