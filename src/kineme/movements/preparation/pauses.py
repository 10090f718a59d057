"""Movements as they are compared: without glitches, and with pauses cut short, stamps far apart and rests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.movements.preparation.glitches import without_glitches
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

#: A rest stays within this share of the movement's reach, which is its largest distance from its first sample. Of
#: hands the noise at rest is below, and corners are above.
RADIUS = 0.015
#: Steps are gaps if they are longer than so many median ones, than so many times their neighbors, and than so many
#: times what their length takes at the mean speed: who lifts a pen, or whose samples are lost, moves meanwhile.
GAP = 3.0
#: A gap or a rest counts as at most this share of the time in motion, but three median steps always do.
PAUSE = 0.1
#: A rest after the start counts as at most the time that this share of the movement's reach takes at the mean speed: as
#: long as people take at a corner. Long movements have more corners, not slower ones: with a tenth, words lose 0.03.
REST = 0.2
#: A rest at the end counts as at most this share: that a movement comes to rest tells that it is over.
LAST_REST = 0.25
#: Samples of a window: at least so many, and the largest power of two with so many windows in the movement.
SHORTEST, WINDOWS = 4, 32
FEWEST = 3  # steps that a rest is left, at least
EQUAL, SAME_COUNT = 1 + 1e-9, 1e-6  # of times, and of numbers of samples: differences that are rounding
ROUNDS = 2  # what is cut makes windows narrower, so that a shorter rest is seen
_OPERATIONS, _PER_NUMBER = 60_000, 100  # of NumPy, of which many calls are needed

Parts = tuple[Array, Array, NDArray[np.intp]]


def uninterrupted(
    demos: Demonstrations, start: int, stop: int, allowance: float = 1.0, *, rests: bool = True
) -> Demonstrations | None:
    """Movements start:stop without glitches, see `without_glitches`, and with their pauses cut short, see `cut_pauses`.

    None if they have neither, the usual case.
    """
    rows = slice(int(demos.offsets[start]), int(demos.offsets[stop]))
    recorded, offsets = demos.positions[rows], demos.offsets[start : stop + 1] - demos.offsets[start]
    clean = without_glitches(recorded, offsets)
    cut = cut_pauses(demos.movements.spread[rows], clean, offsets, allowance, rests=rests)
    if cut is None and clean is recorded:
        return None
    times, positions, ends = cut or (demos.movements.spread[rows], clean, offsets)
    durations = times[ends[1:] - 1] - times[ends[:-1]]
    return Demonstrations.of_movements(Movements(positions, ends, durations, times))


def cut_pauses(
    times: Array, positions: Array, offsets: NDArray[np.intp], allowance: float = 1.0, *, rests: bool = True
) -> Parts | None:
    """Cut short the time in which a movement does not move, or in which nothing was recorded of it.

    So that a drawing during which somebody stopped to think is the drawing that it would have been: smoothing by cycles
    of a movement and representations over time divide by its duration.

    A gap counts as the longest of what `GAP` says, by neighbors and length as at most `PAUSE`. A rest is a run of
    windows that stay within `RADIUS` of the sample in which they begin. It counts as at most `PAUSE`, after the start
    as at most `REST`, too, and at the end as at most `LAST_REST`; of its samples as many are kept as fit into that,
    evenly spaced, at least three.

    `allowance` times these shares of the time in motion, and of the reach, are left of pauses. Without `rests` these
    stay, and gaps alone are cut short: who holds a value says something by how long. Times are returned from 0 in each
    movement; first and last samples stay. None if there is no pause.
    """
    if use_compiled(_OPERATIONS + _PER_NUMBER * positions.size):
        cut_times, cut_positions, ends = np.empty(len(times)), np.empty(positions.shape), np.empty_like(offsets)
        fill = compiled_module("kineme.movements.preparation._pauses").fill_cut
        if not fill((times, positions), offsets, (allowance, rests), (cut_times, cut_positions), ends):
            return None
        return cut_times[: ends[-1]], cut_positions[: ends[-1]], ends
    cut: Parts | None = None
    for _ in range(ROUNDS):
        steps, moving = np.empty(len(times)), np.ones(len(times), dtype=np.bool_)
        if not _fill_shortened((times, positions), offsets, (allowance, rests), steps, moving):
            break
        elapsed = np.append(0.0, np.cumsum(steps)[:-1])
        elapsed -= np.repeat(elapsed[offsets[:-1]], np.diff(offsets))
        ends = np.append(0, np.cumsum(np.add.reduceat(moving, offsets[:-1], dtype=np.intp)))
        times, positions, offsets = cut = elapsed[moving], positions[moving], ends
    return cut


def _fill_shortened(
    samples: tuple[Array, Array],
    offsets: NDArray[np.intp],
    rule: tuple[float, bool],
    steps: Array,
    moving: NDArray[np.bool_],
) -> bool:
    """Write the time that each step counts, 0 after last samples, and which samples are kept; whether any changes."""
    (times, positions), (allowance, rests) = samples, rule
    first, last, lengths = offsets[:-1], offsets[1:] - 1, np.diff(offsets)
    owner = np.repeat(np.arange(len(lengths)), lengths)
    steps[:] = np.diff(times, append=times[-1])
    steps[last] = np.inf
    ordered = np.lexsort((steps, owner))
    usual = GAP * steps[ordered[first + (lengths - 1) // 2]]
    steps[last] = 0.0
    apart = np.append(np.linalg.norm(np.diff(positions, axis=0), axis=1), 0.0)
    apart[last] = 0.0
    reach = np.maximum.reduceat(np.linalg.norm(positions - positions[first][owner], axis=1), first)
    resting = _resting(positions, offsets, RADIUS * reach[owner]) if rests else np.zeros(len(times), np.bool_)
    motion = np.add.reduceat(np.where(resting, 0.0, np.minimum(steps, usual[owner])), first)
    path = np.add.reduceat(np.where(resting, 0.0, apart), first)
    pace = np.divide(motion, path, out=np.zeros(len(path)), where=path > 0)  # seconds for a unit of length
    motion *= allowance  # pauses count by shares of it
    neighbors = np.maximum(np.append(0.0, steps[:-1]), np.append(steps[1:], 0.0))  # 0 beyond an end
    most = np.minimum(GAP * np.maximum(neighbors, apart * pace[owner]), PAUSE * motion[owner])
    longest = np.maximum(usual[owner], most)
    changes = bool((steps > EQUAL * longest).any())
    np.minimum(steps, longest, out=steps)
    begins = np.flatnonzero(resting & ~np.append(False, resting[:-1]))
    n_steps = np.flatnonzero(resting & ~np.append(resting[1:], False)) + 1 - begins
    if not len(begins):
        return changes
    total = np.add.reduceat(np.where(resting, steps, 0.0), begins)  # until the next rest begins
    own = owner[begins]
    most, within = PAUSE * motion[own], allowance * REST * reach[own] * pace[own]
    limit = np.where(begins == first[own], most, np.minimum(most, within))
    limit = np.where(begins + n_steps == last[own], LAST_REST * motion[own], limit)
    long = (total > EQUAL * limit) & (limit > 0)
    begins, n_steps, shares = begins[long], n_steps[long], limit[long] / total[long]
    run, place = np.repeat(np.arange(len(begins)), n_steps), np.arange(n_steps.sum())
    place -= np.repeat(np.cumsum(n_steps) - n_steps, n_steps)
    left = np.maximum(FEWEST, np.ceil(shares * n_steps - SAME_COUNT).astype(np.intp))
    at = begins[run] + place
    steps[at] *= shares[run]
    moving[at] = (place == 0) | (place * left[run] // n_steps[run] != (place - 1) * left[run] // n_steps[run])
    return changes or bool(long.any())


def _resting(positions: Array, offsets: NDArray[np.intp], radius: Array) -> NDArray[np.bool_]:
    """Tell whether the step after each sample lies in a window of samples that stays within a radius of its first."""
    first, last, total = offsets[:-1], offsets[1:] - 1, len(positions)
    owner = np.repeat(np.arange(len(first)), np.diff(offsets))
    windows = np.full(len(first), SHORTEST)
    while (wider := 2 * WINDOWS * windows <= np.diff(offsets)).any():
        windows[wider] *= 2
    own = windows[owner]
    still = np.arange(total) + own - 1 <= last[owner]
    for ahead in range(1, int(windows.max())):
        begins = np.flatnonzero(still & (ahead < own))
        apart = np.linalg.norm(positions[begins + ahead] - positions[begins], axis=1)
        still[begins[apart > radius[begins]]] = False
    begins, marks = np.flatnonzero(still), np.zeros(total + 1)
    np.add.at(marks, begins, 1)
    np.add.at(marks, begins + own[begins] - 1, -1)
    return np.asarray(np.cumsum(marks[:-1]) > 0)
