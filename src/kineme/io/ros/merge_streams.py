"""Several streams as one table: the others are interpolated to the stamps of the first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kineme.errors import DataError
from kineme.io.ros.rotations import interpolated
from kineme.io.ros.streams import Stamps, Stream, rotations_in
from kineme.reporting.text import counted
from kineme.validation import Array

SECOND = 1_000_000_000  # [ns]


def clock_of(streams: Sequence[Stream]) -> tuple[bool, str]:
    """Whether the stamps in the headers are the time, and else why they are not.

    They are where every message has one and they increase in every stream. Otherwise it is the time of recording.
    """
    for one in streams:
        if one.stamped is None:
            return False, one.why or f"{one.name} has no stamps in headers"
        if not one.stamped.any():
            return False, f"the stamps in the headers of {one.name} are 0"
        steps = np.diff(one.stamped)
        if len(steps) and steps.min() <= 0:
            k = int(np.argmax(steps <= 0)) + 1
            what = "repeats the one" if steps[k - 1] == 0 else "is earlier than that"
            return False, f"the stamp in the header of message {k} of {one.name} {what} before"
    return True, ""


def stamps_of(stream: Stream, of_headers: bool) -> Stamps:
    """The stamps of one clock [ns]."""
    if not of_headers:
        return stream.recorded
    assert stream.stamped is not None
    return stream.stamped


def merge_streams(streams: Sequence[Stream], of_headers: bool) -> tuple[Stream, list[str]]:
    """One stream with the columns of all, at the stamps of the first; and what was left out.

    Samples of the first stream before another one begins, or after it ends, are left out. Columns are prefixed with
    the name of their stream where names occur twice.

    Raises
    ------
    DataError
        Streams that share no time.
    """
    first = streams[0]
    if len(streams) == 1:
        return first, []
    at = stamps_of(first, of_headers)
    others = [(one, in_order(one, of_headers)) for one in streams[1:]]
    inside = np.ones(len(at), dtype=bool)
    for _, (stamps, _) in others:
        inside &= (at >= stamps[0]) & (at <= stamps[-1])
    names = ", ".join(one.name for one in streams[1:])
    if not inside.any():
        raise DataError(
            f"expected samples of {first.name} and of {names} at the same time, got none: {_spans(streams, of_headers)}"
            + ("; if their headers are of two clocks, say time='recorded', in the shell --time recorded" * of_headers)
        )
    start = int(at[inside][0])
    seconds = (at[inside] - start) / SECOND
    values = [first.values[inside]]
    values += [values_at(seconds, (stamps - start) / SECOND, one, x) for one, (stamps, x) in others]
    kept = replace(
        first,
        heads=_heads(streams),
        values=np.hstack(values),
        recorded=first.recorded[inside],
        stamped=None if first.stamped is None else first.stamped[inside],
    )
    n_lost = int(len(at) - inside.sum())
    lost = f"{counted(n_lost, 'sample')} of {first.name} before {names} begins or after it ends"
    return kept, [lost] if n_lost else []


def _spans(streams: Sequence[Stream], of_headers: bool) -> str:
    spans = ((one.name, stamps_of(one, of_headers)) for one in streams)
    return ", ".join(f"{name} from {at.min() / SECOND:.12g} to {at.max() / SECOND:.12g} s" for name, at in spans)


def values_at(at: Array, times: Array, stream: Stream, values: Array) -> Array:
    """Samples at other times, linearly, and of rotations on the sphere."""
    result = np.column_stack([np.interp(at, times, column) for column in values.T])
    for k in rotations_in(stream.heads):
        result[:, k : k + 4] = interpolated(at, times, values[:, k : k + 4])
    return result


def in_order(stream: Stream, of_headers: bool) -> tuple[Stamps, Array]:
    """Stamps that increase strictly, and the samples."""
    known = stamps_of(stream, of_headers)
    if (np.diff(known) > 0).all():
        return known, stream.values
    stamps, where = np.unique(stamps_of(stream, of_headers), return_index=True)
    return stamps, stream.values[where]


def _heads(streams: Sequence[Stream]) -> tuple[str, ...]:
    twice = {head for head, n in Counter(head for one in streams for head in one.heads).items() if n > 1}
    return tuple(f"{one.name}.{head}" if twice & set(one.heads) else head for one in streams for head in one.heads)
