"""Drop the invalid movements of a file and report why; no Python loop runs over the valid ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, TrajectoryError
from kineme.io.gaps import fill_gaps, in_words, missing_values
from kineme.io.problem import Problem
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Block
from kineme.reporting.text import counted
from kineme.validation import (
    LARGEST_POSITION,
    LARGEST_STAMP,
    MIN_SAMPLES,
    SHORTEST_STEP,
    SMALLEST_EXTENT,
    Array,
    too_small,
)

Flags = NDArray[np.bool_]


def check_block(block: Block, file: str, layout: Layout, columns: Sequence[str]) -> tuple[Block, list[Problem]]:
    """The valid movements, gaps filled and ends cropped, and one problem for each invalid movement.

    Parameters
    ----------
    block : Block
    file : str
        Name of the file in the problems.
    layout : Layout
        `skip`: what is dropped for a sample that is missing, infinite, out of range, or not later than the one before:
        its movement, or the sample alone. Movements of fewer than `MIN_SAMPLES` samples, or with an extent out of
        range, are always dropped; the ranges are those of `kineme.validation`. `fill_gaps`: see
        `kineme.io.gaps.fill_gaps`.
    columns : sequence of d str
        Names of the columns.
    """
    skip, problems = layout.skip, list[Problem]()
    odd = _unusable(block, skip)
    if odd.any():
        starts = block.offsets[:-1]
        n_odd = np.diff(np.concatenate(([0], np.cumsum(odd)))[block.offsets])
        for i in np.flatnonzero(n_odd).tolist():
            first = int(starts[i] + np.argmax(odd[starts[i] : block.offsets[i + 1]]))
            problems.append(_problem(block, file, i, first, (int(n_odd[i]), skip)))
        block = _keep(block, ~odd) if skip == "sample" else take_movements(block, n_odd == 0)
    if np.isnan(block.positions).any():
        block, lacking = _without_missing(fill_gaps(block, columns, layout), file, skip, columns)
        problems += lacking
    lengths = np.diff(block.offsets)
    for i in np.flatnonzero(lengths < MIN_SAMPLES).tolist():
        reason = f"expected at least {MIN_SAMPLES} samples, got {lengths[i]}"
        line = block.line_of(block.row(int(block.offsets[i]))) if lengths[i] and len(lengths) > 1 else None
        problems.append(Problem(file, line, movement_of(block, i) + reason, TrajectoryError))
    block = take_movements(block, lengths >= MIN_SAMPLES)
    good = np.ones(len(block.labels), dtype=bool)
    for i, extent in too_small(block.positions, block.offsets):
        reason = f"expected an extent of at least {SMALLEST_EXTENT:g}, got {extent:g}; choose another unit"
        problems.append(Problem(file, None, movement_of(block, i) + reason, TrajectoryError))
        good[i] = False
    return take_movements(block, good), sorted(problems, key=lambda problem: problem.line or 0)


def _without_missing(block: Block, file: str, skip: str, columns: Sequence[str]) -> tuple[Block, list[Problem]]:
    """A block without the movements, or with `skip` the samples alone, that lack values; a problem for each."""
    lacking: Flags = np.asarray(np.isnan(block.positions).any(axis=1))
    counts = np.diff(np.concatenate(([0], np.cumsum(lacking)))[block.offsets])
    readable: Flags = np.asarray(
        np.diff(block.offsets) - counts >= MIN_SAMPLES if skip == "sample" else counts == 0, dtype=np.bool_
    )
    problems = []
    for i in np.flatnonzero(counts).tolist():
        first = int(block.offsets[i] + np.argmax(lacking[block.offsets[i] :]))
        left_out = int(counts[i]) if readable[i] else 0
        effect = f"; {counted(left_out, 'sample')} like this left out" if left_out else ""
        missing = missing_values(block, columns, i)
        reason = movement_of(block, i) + in_words(missing, skip) + effect
        line = block.line_of(block.row(first))
        problems.append(Problem(file, line, reason, DataError, left_out, () if left_out else missing.names))
    block = take_movements(block, readable)
    return _keep(block, ~np.asarray(np.isnan(block.positions).any(axis=1))), problems


def _unusable(block: Block, skip: str) -> Flags:
    """Per sample: out of range, or not later than the sample before; if samples are dropped, than all kept before."""
    total = len(block.positions)
    odd: Flags = np.asarray((np.abs(block.positions) > LARGEST_POSITION).any(axis=1))  # what is missing comes later
    if block.faults:
        odd |= np.isin(np.arange(total) if block.rows is None else block.rows, list(block.faults))
    if block.times is None or not total:
        return odd
    step = np.diff(block.times, prepend=-np.inf)
    odd |= ~(np.abs(block.times) <= LARGEST_STAMP)
    step[block.offsets[:-1][np.diff(block.offsets) > 0]] = np.inf
    late = ~(step >= SHORTEST_STEP)
    if skip == "sample" and (odd | late).any():
        return odd | _late_after_leaving_out(block.times, block.offsets, odd, late)
    return odd | late


def _late_after_leaving_out(times: Array, offsets: NDArray[np.intp], odd: Flags, late: Flags) -> Flags:
    """Samples not later than all usable ones before them, in the movements that have a fault."""
    result = np.zeros_like(odd)
    owners = np.unique(np.searchsorted(offsets, np.flatnonzero(odd | late), side="right") - 1)
    for i in owners:
        rows = slice(offsets[i], offsets[i + 1])
        usable = np.where(odd[rows], -np.inf, times[rows])
        before = np.maximum.accumulate(np.concatenate(([-np.inf], usable[:-1])))
        with np.errstate(invalid="ignore"):  # dropped samples may be NaN or infinite
            result[rows] = ~odd[rows] & ~(usable - before >= SHORTEST_STEP)
    return result


def _problem(block: Block, file: str, i: int, k: int, odd: tuple[int, str]) -> Problem:
    row, (n_odd, skip) = block.row(k), odd
    samples = f"{n_odd} samples like this" if n_odd > 1 else "this sample"
    effect = f"; {samples} left out" if skip == "sample" else f"; {n_odd - 1} more like this" if n_odd > 1 else ""
    known = (block.faults or {}).get(row)
    reason = movement_of(block, i) + (known or _reason(block, i, k)) + effect
    left_out = n_odd if skip == "sample" and block.offsets[i + 1] - block.offsets[i] - n_odd >= MIN_SAMPLES else 0
    return Problem(file, block.line_of(row), reason, DataError if known else TrajectoryError, left_out)


def movement_of(block: Block, i: int) -> str:
    """Movement i at the beginning of a message; empty if the file holds but one."""
    return f"movement {' '.join(block.places[i].splitlines())}: " if block.places[i] else ""


def _reason(block: Block, i: int, k: int) -> str:
    at = f" at sample {k - block.offsets[i]}"
    if np.isinf(block.positions[k]).any():
        return f"expected finite positions, got {block.positions[k].tolist()}{at}"
    if np.nanmax(np.abs(block.positions[k]), initial=0.0) > LARGEST_POSITION:
        return (
            f"expected positions up to {LARGEST_POSITION:g}, got {block.positions[k].tolist()}{at}; choose another unit"
        )
    times = block.times
    assert times is not None
    if not np.isfinite(times[k]):
        return f"expected finite times, got {times[k]}{at}"
    if abs(times[k]) > LARGEST_STAMP:
        return f"expected times up to {LARGEST_STAMP:g} s, got {times[k]:.9g}{at}"
    before = times[k - 1]
    if before < times[k]:
        return f"expected at least {SHORTEST_STEP:g} s between stamps, got {before:.9g} and {times[k]:.9g} s{at}"
    what = "duplicate" if times[k] == before else "decreasing"
    return f"expected strictly increasing times, got {what} stamps {before:.9g} and {times[k]:.9g} s{at}"


def _keep(block: Block, kept: Flags) -> Block:
    """The kept samples of every movement."""
    offsets = np.concatenate(([0], np.cumsum(kept)))[block.offsets].astype(np.intp)
    rows = np.flatnonzero(kept) if block.rows is None else block.rows[kept]
    times = None if block.times is None else block.times[kept]
    return replace(block, positions=block.positions[kept], times=times, offsets=offsets, rows=rows)


def take_movements(block: Block, chosen: Flags) -> Block:
    """The chosen movements of a block."""
    if chosen.all():
        return block
    kept = _keep(block, np.repeat(chosen, np.diff(block.offsets)))
    ends = kept.offsets[np.concatenate(([True], chosen))]
    labels = [label for label, one in zip(block.labels, chosen, strict=True) if one]
    places = [place for place, one in zip(block.places, chosen, strict=True) if one]
    people = block.people and [person for person, one in zip(block.people, chosen, strict=True) if one]
    repairs = block.repairs and [repair for repair, one in zip(block.repairs, chosen, strict=True) if one]
    return replace(kept, offsets=ends, labels=labels, places=places, people=people, repairs=repairs)
