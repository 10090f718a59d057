"""Fill short gaps, crop ends without values, drop the invalid movements of a file and report why."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, TrajectoryError
from kineme.io.records import Problem, in_shell
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.coordinates import period_of_channel, without_wraps
from kineme.movements.channels.detect import find_channels, kinds_of
from kineme.movements.rotations import slerp
from kineme.movements.tables.layout import Block, Layout, Repair
from kineme.reporting.text import counted
from kineme.sampling import runs
from kineme.validation import (
    LARGEST_POSITION,
    LARGEST_STAMP,
    MIN_SAMPLES,
    SHORTEST_STEP,
    SMALLEST_EXTENT,
    Array,
    too_small,
)

_LEAST = 0.5  # share of its samples that a movement keeps when it is cropped
_EDGE = 0.25  # share of the samples that a column may lack at both ends, where cropping to all would leave less
_SHOWN = 5  # columns in a message beside the first
_ROUNDING = 1e-9  # of a gap, relative

_VAST = np.append(10.0 ** np.arange(20, 39), np.finfo(np.float32).max)
#: Numbers that programs write where they have no value: 999 to 9999999, 32768, 1e20 to 1e38, the largest of a float32,
#: with either sign.
SENTINELS = np.concatenate(
    [sign * np.concatenate([10.0 ** np.arange(3, 8) - 1, _VAST, _VAST.astype(np.float32), [32768]]) for sign in (-1, 1)]
)

Flags = NDArray[np.bool_]


def check_block(block: Block, file: str, layout: Layout, columns: Sequence[str]) -> tuple[Block, list[Problem]]:
    """Return the valid movements, gaps filled and ends cropped, and one problem for each invalid movement.

    `skip` of the layout says what is dropped for a sample that is missing, out of the ranges of `kineme.validation`, or
    not later than the one before. Movements of fewer than `MIN_SAMPLES` samples or too small are always dropped.
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
        filled = fill_gaps(replace(block, times=block.stamps), columns, layout)
        timed, (block, lacking) = block.times is not None, _without_missing(filled, file, skip, columns)
        block = block if timed else replace(block, times=None)
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
    """Return a block without the movements, or with `skip` the samples alone, that lack values; a problem for each."""
    lacking: Flags = np.asarray(np.isnan(block.positions).any(axis=1))
    counts = np.diff(np.concatenate(([0], np.cumsum(lacking)))[block.offsets])
    readable: Flags = np.diff(block.offsets) - counts >= MIN_SAMPLES if skip == "sample" else counts == 0
    problems = []
    for i in np.flatnonzero(counts).tolist():
        first = int(block.offsets[i] + np.argmax(lacking[block.offsets[i] :]))
        left_out = int(counts[i]) if readable[i] else 0
        effect = f"; {counted(left_out, 'sample')} like this left out" if left_out else ""
        names, words = lacking_values(block, columns, i, skip)
        reason = movement_of(block, i) + words + effect
        line = block.line_of(block.row(first))
        problems.append(Problem(file, line, reason, DataError, left_out, () if left_out else names))
    block = take_movements(block, readable)
    return _keep(block, ~np.asarray(np.isnan(block.positions).any(axis=1))), problems


def _unusable(block: Block, skip: str) -> Flags:
    """Mark samples out of range, or not later than the sample before; if samples are dropped, the fewest of these."""
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
        for i in np.unique(np.searchsorted(block.offsets, np.flatnonzero(odd | late), side="right") - 1):
            rows = slice(block.offsets[i], block.offsets[i + 1])
            late[rows] = ~_increasing(block.times[rows], ~odd[rows])
    return odd | late


def _increasing(times: Array, usable: Flags) -> Flags:
    """Mark as many usable stamps as increase one after the other, the earlier one of two that are equal."""
    ends, last, before = list[float](), list[int](), np.full(len(times), -1)  # per length the run that ends earliest
    for k in np.flatnonzero(usable).tolist():
        t = float(times[k])
        n = bisect_right(ends, t - SHORTEST_STEP)
        n -= n > 0 and t - ends[n - 1] < SHORTEST_STEP  # rounded
        before[k] = last[n - 1] if n else -1
        if n == len(ends) or t < ends[n]:
            ends[n : n + 1], last[n : n + 1] = [t], [k]
    marked: Flags = np.zeros(len(times), dtype=bool)
    k = last[-1] if last else -1
    while k >= 0:
        marked[k], k = True, int(before[k])
    return marked


def _problem(block: Block, file: str, i: int, k: int, odd: tuple[int, str]) -> Problem:
    row, (n_odd, skip) = block.row(k), odd
    samples = f"{n_odd} samples like this" if n_odd > 1 else "this sample"
    effect = f"; {samples} left out" if skip == "sample" else f"; {n_odd - 1} more like this" if n_odd > 1 else ""
    fault = (block.faults or {}).get(row)
    reason = movement_of(block, i) + (fault or _reason(block, i, k, skip)) + effect
    left_out = n_odd if skip == "sample" and block.offsets[i + 1] - block.offsets[i] - n_odd >= MIN_SAMPLES else 0
    return Problem(file, block.line_of(row), reason, DataError if fault else TrajectoryError, left_out)


def movement_of(block: Block, i: int) -> str:
    """Return movement i at the beginning of a message; empty if the file holds but one."""
    return f"movement {' '.join(block.places[i].splitlines())}: " if block.places[i] else ""


def _reason(block: Block, i: int, k: int, skip: str) -> str:
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
    first, end = block.offsets[i], block.offsets[i + 1]
    if k == first or times[k] - times[k - 1] >= SHORTEST_STEP:  # this one is too late: the next ones are before it
        k += 1 + int(np.argmax(times[k + 1 : end] - times[k] < SHORTEST_STEP))
        at = f" at sample {k - first}"
    before = times[k - 1]
    if before < times[k]:
        return f"expected at least {SHORTEST_STEP:g} s between stamps, got {before:.9g} and {times[k]:.9g} s{at}"
    skipped = "" if skip == "sample" else " leave such samples out with --skip sample, or,"
    what, several = "duplicate", f";{skipped} if rows are of several things,"
    if times[k] < before:
        what, several = "decreasing", "; if several movements follow each other,"
    remedy = f"{several} say which column tells them apart, movement=, --movement"
    return f"expected strictly increasing times, got {what} stamps {before:.9g} and {times[k]:.9g} s{at}{remedy}"


def _keep(block: Block, mask: Flags) -> Block:
    offsets = np.concatenate(([0], np.cumsum(mask)))[block.offsets].astype(np.intp)
    rows = np.flatnonzero(mask) if block.rows is None else block.rows[mask]
    times = None if block.times is None else block.times[mask]
    return replace(block, positions=block.positions[mask], times=times, offsets=offsets, rows=rows)


def take_movements(block: Block, chosen: Flags) -> Block:
    """Return the chosen movements of a block."""
    if chosen.all():
        return block
    taken = _keep(block, np.repeat(chosen, np.diff(block.offsets)))
    ends = taken.offsets[np.concatenate(([True], chosen))]
    labels = [label for label, is_chosen in zip(block.labels, chosen, strict=True) if is_chosen]
    places = [place for place, is_chosen in zip(block.places, chosen, strict=True) if is_chosen]
    people = block.people and [person for person, is_chosen in zip(block.people, chosen, strict=True) if is_chosen]
    repairs = block.repairs and [repair for repair, is_chosen in zip(block.repairs, chosen, strict=True) if is_chosen]
    return replace(taken, offsets=ends, labels=labels, places=places, people=people, repairs=repairs)


def spans_of(missing: Flags, times: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Find runs of missing values (T,) at times (T,) [s]: first rows, rows after the last ones, and lengths [s]."""
    first, stop = runs(missing).T
    before, after = np.concatenate(([-np.inf], times)), np.concatenate((times, [np.inf]))
    return first, stop, after[stop] - before[first]


def sentinels_as_missing(block: Block, columns: Sequence[str]) -> tuple[Block, tuple[str, ...]]:
    """Take numbers as -9999, far from all others of their column, as missing values, and say which in which columns."""
    positions, said = block.positions, []
    with np.errstate(invalid="ignore"):
        suspected = np.flatnonzero((np.abs(positions) >= np.abs(SENTINELS).min()).any(axis=0))
    for k in suspected.tolist():
        x = block.positions[:, k]
        marks = np.isfinite(x) & np.isin(x, SENTINELS)
        others = x[np.isfinite(x) & ~marks]
        if not len(others) or not marks.any():
            continue
        low, high = others.min(), others.max()
        marks &= np.maximum(low - x, x - high) > high - low
        if marks.any():
            positions = positions.copy() if positions is block.positions else positions
            said += [f"{value:g} in {columns[k]}" for value in np.unique(x[marks]).tolist()]
            positions[marks, k] = np.nan
    return (replace(block, positions=positions), tuple(said)) if said else (block, ())


def fill_gaps(block: Block, columns: Sequence[str], layout: Layout) -> Block:
    """Crop movements to where all columns have values, and fill the short gaps between; other values stay missing.

    NaN stands for a missing value, and `fill_gaps` of the layout is the longest gap that is filled [s]. Positions, and
    angles without their wraps, are interpolated in time by Akima's cubic polynomials (Akima, "A new method of
    interpolation and smooth curve fitting based on local procedures", J. ACM 17, 1970), orientations by turning at
    constant angular velocity; discrete channels keep the value before. A movement that would lose half of its samples
    is cropped only to where those columns have values that lack fewer than a quarter at their ends.
    """
    missing: Flags = np.isnan(block.positions)
    lacking = np.concatenate(([0], np.cumsum(missing.any(axis=1))))[block.offsets]
    if block.times is None or not lacking[-1]:
        return block
    positions, outside = block.positions.copy(), np.zeros(len(block.positions), dtype=bool)
    number = {name: k for k, name in enumerate(columns)}
    channels = [
        (channel, [number[name] for name in channel.columns])
        for channel in _channels(block, columns, layout, np.asarray(~missing.any(axis=1)))
    ]
    repairs = [Repair()] * len(block.labels)
    for i in np.flatnonzero(np.diff(lacking)).tolist():
        rows = slice(block.offsets[i], block.offsets[i + 1])
        times = block.times[rows]
        filled = _fill(positions[rows], times, layout.fill_gaps, channels)
        inside = _span_of_all(np.isnan(positions[rows]), layout.skip)
        outside[rows] = True
        outside[rows][inside] = False
        ends = times[[0, -1]] - times[inside][[0, -1]]
        filled = filled[inside]
        repairs[i] = Repair(int(np.count_nonzero(filled)), float(filled.max()), float(np.abs(ends).sum()))
    return replace(_keep(replace(block, positions=positions), ~outside), repairs=repairs)


def _span_of_all(missing: Flags, skip: str) -> slice:
    """Return the samples from the first to the last one in which all columns of a movement (T, d) have values."""
    n, present = len(missing), ~missing
    ends = np.where(missing.all(axis=0), n, present.argmax(axis=0) + present[::-1].argmax(axis=0))
    for columns, least in ((ends <= n, 0 if skip == "sample" else _LEAST * n), (ends < _EDGE * n, _LEAST * n)):
        complete = np.flatnonzero(present[:, columns].all(axis=1))
        if len(complete) and complete[-1] + 1 - complete[0] >= max(MIN_SAMPLES, least):
            return slice(int(complete[0]), int(complete[-1]) + 1)
    return slice(0, n)


def _channels(block: Block, columns: Sequence[str], layout: Layout, complete: Flags) -> Channels:
    """Find the channels by the samples in which no value is missing; a step across a gap tells nothing."""
    if np.count_nonzero(complete) < MIN_SAMPLES:
        return tuple(Channel(name, "position", (name,)) for name in columns)
    given = kinds_of(layout.kinds if isinstance(layout.kinds, Mapping) else {}, columns)
    begins = complete & ~np.append(False, complete[:-1])
    firsts = block.offsets[:-1][np.diff(block.offsets) > 0]
    begins[firsts] = complete[firsts]
    offsets = np.append(np.flatnonzero(begins[complete]), np.count_nonzero(complete))
    return find_channels(columns, block.positions[complete], offsets, given)


def _fill(values: Array, times: Array, most: float, channels: Sequence[tuple[Channel, list[int]]]) -> Array:
    """Fill the short gaps of one movement (T, d) in place; the longest gap in which each sample lay, 0 for none [s]."""
    longest = np.zeros(len(values))
    for channel, columns in channels:
        missing: Flags = np.asarray(np.isnan(values[:, columns]).any(axis=1))
        first, stop, seconds = spans_of(missing, times)
        short = seconds <= most * (1.0 + _ROUNDING)
        if not short.any():
            continue
        lengths = (stop - first)[short]
        begun = np.repeat(first[short] - np.cumsum(lengths) + lengths, lengths)
        chosen = begun + np.arange(len(begun))
        samples = times[~missing], values[~missing][:, columns]
        values[chosen[:, None], columns] = _between(channel, samples, times[chosen])
        longest[chosen] = np.maximum(longest[chosen], np.repeat(seconds[short], lengths))
    return longest


def _between(channel: Channel, samples: tuple[Array, Array], times: Array) -> Array:
    """Return values (m, c) of a channel at m times between those at which (n, c) are known."""
    stamps, values = samples
    after = np.searchsorted(stamps, times)
    if channel.kind == "discrete":
        return np.asarray(values[after - 1])
    if channel.kind == "orientation":
        order = [channel.order.index(axis) for axis in "wxyz"]
        share = (times - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
        turned = slerp(values[after - 1][:, order], values[after][:, order], share)
        return np.asarray(turned[:, np.argsort(order)])
    if channel.kind == "angle":
        period = period_of_channel(channel, values[:, 0])
        unwrapped = without_wraps(values[:, 0], np.array([0, len(values)]), period)[:, None]
        between = _smooth(stamps, unwrapped, times)
        if np.array_equal(unwrapped, values):
            return between
        low = 0.0 if values.min() >= 0.0 else -period / 2  # the turn that the recorded angles lie in
        return np.asarray(low + (between - low) % period)
    return _smooth(stamps, values, times)


def _smooth(stamps: Array, values: Array, times: Array) -> Array:
    """Return values (m, c) at m times on the curve through those (n, c) at stamps (n,)."""
    if len(stamps) < 3:
        return np.interp(times, stamps, values[:, 0])[:, None]
    from scipy.interpolate import Akima1DInterpolator

    return np.asarray(Akima1DInterpolator(stamps, values)(times))


def lacking_values(block: Block, columns: Sequence[str], i: int, skip: str) -> tuple[tuple[str, ...], str]:
    """Return the columns of movement i that lack values, or what they begin with, and say what reads them."""
    rows = slice(block.offsets[i], block.offsets[i + 1])
    missing = np.isnan(block.positions[rows])
    share_of = missing.mean(axis=0).tolist()
    longest = 0.0  # where values are missing at the ends alone
    if block.times is not None:
        spans = [spans_of(missing[:, k], block.times[rows])[2] for k, share in enumerate(share_of) if share]
        longest = max((float(seconds[np.isfinite(seconds)].max(initial=0.0)) for seconds in spans), default=0.0)
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(columns):
        groups.setdefault(name.rpartition(".")[0], []).append(k)
    named: dict[str, float] = {}
    for group, members in groups.items():
        together = group and len(members) > 1 and (missing[:, members] == missing[:, members[:1]]).all()
        named |= {group: share_of[members[0]]} if together else {columns[k]: share_of[k] for k in members}
    first, *others = names = sorted((name for name, share in named.items() if share > 0), key=lambda name: -named[name])
    shares = {name: f"{100 * named[name]:.{'2g' if named[name] < 0.1 else '0f'}}" for name in names}
    more = [f"{shares[name]} % of {name!r}" for name in others]
    also = f", {', '.join(more[:_SHOWN])}" + (f" and of {len(more) - _SHOWN} more" if len(more) > _SHOWN else "")
    lasting = f", for up to {longest:.3g} s" if longest else ""
    options = {} if len(names) == len(named) else {"exclude=": f"--exclude {in_shell(names)}"}
    if longest:
        unit = 10.0 ** (np.floor(np.log10(longest)) - 1)  # two digits, not fewer
        options["fill_gaps="] = f"--fill-gaps {float(np.ceil(round(longest / unit, 6)) * unit):g}"
    options |= {"skip=": "--skip sample"} if skip == "movement" else {}
    said = f"; say {' or '.join(options.values())}, in Python {' or '.join(options)}" if options else ""
    share = f"{shares[first]} % of the samples"
    words = f"expected a number in {first!r}, got nothing in {share}{also if others else ''}{lasting}{said}"
    return tuple(names), words
