"""Columns of one recording beside those of another: the same by their names, whatever their order and their units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.channels.detect import name_of
from kineme.movements.tables.time_stamps import words_of
from kineme.units import Unit, converted, unit_named
from kineme.validation import Array

#: What programs call columns that have no name, before their number.
_NAMELESS = re.compile(
    r"(x|q|c|d|v|column|col|dim|dimension|coordinate|channel|feature|value|var|unnamed)?[ _:]*\d+", re.I
)


#: A rotation of a joint about an axis, one of three whose order says which is turned first: ``Hips.Zrotation``.
_ROTATION = re.compile(r"(?P<joint>.+)\.(?P<axis>[xyz])rotation", re.I)


class Columns(NamedTuple):
    """The columns of a recording.

    Attributes
    ----------
    heads : tuple of m str
    units : tuple of m str or None
        Their units as the file says them; None where it does not.
    """

    heads: tuple[str, ...]
    units: tuple[str | None, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The heads in lower case without the units that they end in, or with them where two would be the same."""
        return _names_of(self.heads)

    @property
    def rotations(self) -> dict[str, str]:
        """Joint -> the axes that it turns about, one after the other: ``hips`` -> ``zxy``."""
        axes: dict[str, str] = {}
        for match in filter(None, map(_ROTATION.fullmatch, self.names)):
            axes[match["joint"]] = axes.get(match["joint"], "") + match["axis"]
        return axes

    @property
    def are_nameless(self) -> bool:
        """Whether the heads only count the columns: x1, x2, x3."""
        return all(_NAMELESS.fullmatch(head.strip()) for head in self.heads)


def columns_recorded(channels: Channels) -> Columns:
    """The columns of channels."""
    return Columns(recorded_names(channels), tuple(one.unit for one in channels for _ in one.columns))


def may_be(channels: Channels, others: Channels) -> bool:
    """Whether channels of other names may be those: x, y, z without any other name may be those of a hand."""
    names = [Columns(tuple(one.name for one in several), ()).names for several in (channels, others)]
    kinds = [tuple(one.kind for one in several) for several in (channels, others)]
    is_bare = any(all(len(words_of(name)) == 1 for name in each) for each in names)
    return any(columns_recorded(several).are_nameless for several in (channels, others)) or (
        is_bare
        and kinds[0] == kinds[1]
        and all(
            kind == "orientation" or words_of(a)[-1:] == words_of(b)[-1:]
            for kind, a, b in zip(kinds[0], *names, strict=True)
        )
    )


@lru_cache(maxsize=256)  # thousands of files have the same heads
def _names_of(heads: tuple[str, ...]) -> tuple[str, ...]:
    plain = tuple(name_of(head).lower() for head in heads)
    return plain if len({*plain}) == len(plain) else heads


def columns_like(positions: Array, ours: Columns, wanted: Columns, known_units: bool = True) -> Array:
    """Columns (total, m) by their names in the order and in the units of those that are `wanted`, of others no more.

    Parameters
    ----------
    positions : ndarray of shape (total, m)
    ours, wanted : Columns
    known_units : bool, default True
        Refuse columns without a unit beside those with one; else they count as in that unit.

    Raises
    ------
    TrajectoryError
        A name that is not there, a unit that cannot be converted, or rotations about the same axes one after the other
        in another order, which are other angles of the same turn.
    """
    place = {name: k for k, name in enumerate(ours.names)}
    missing = [head for head, name in zip(wanted.heads, wanted.names, strict=True) if name not in place]
    if missing:
        raise TrajectoryError(f"expected the column {missing[0]!r}, got {', '.join(map(repr, ours.heads))}")
    turned = ours.rotations
    for joint, axes in wanted.rotations.items():
        if (other := "".join(axis for axis in turned[joint] if axis in axes)) != axes:
            raise TrajectoryError(
                f"expected the rotations of {joint!r} in the order {axes}, as the others have them, got {other}, which "
                "are other angles of the same turns; export all in one order, or read these apart"
            )
    order = [place[name] for name in wanted.names]
    result = positions if order == list(range(positions.shape[1])) else positions[:, order]
    for k, (from_k, unit) in enumerate(zip(order, wanted.units, strict=True)):
        sizes = conversion(ours.heads[from_k], ours.units[from_k], unit, known_units)
        if sizes is not None:
            result = np.array(result) if result is positions else result
            result[:, k] = converted(result[:, k], *sizes)
    return result


def numbers_by_name(heads: Sequence[str], names: Sequence[str]) -> list[int | None]:
    """The column of each name, with or without its unit, whatever that is; None where none or several have it."""
    exact: dict[str, list[int]] = {}
    bare: dict[str, list[int]] = {}
    for k, head in enumerate(heads):
        exact.setdefault(head, []).append(k)
        bare.setdefault(name_of(head).lower(), []).append(k)
    same = [exact.get(name) or bare.get(name_of(name).lower(), []) for name in names]
    return [several[0] if len(several) == 1 else None for several in same]


def conversion(head: str, ours: str | None, wanted: str | None, known_units: bool) -> tuple[Unit, Unit] | None:
    """The units to convert from and to; None where they are the same, or where one is not known and need not be.

    Raises
    ------
    TrajectoryError
        Units that cannot be converted.
    """
    if (ours or "").strip().lower() == (wanted or "").strip().lower() or (None in (ours, wanted) and not known_units):
        return None
    here, there = unit_named(ours or ""), unit_named(wanted or "")
    if here is None or there is None or here.quantity != there.quantity:
        raise TrajectoryError(
            f"expected {head!r} in {wanted!r}, as the others have it, got "
            f"{f'{ours!r}, which cannot be converted' if ours else f'no unit; name the column {head} [{wanted}]'}"
            if wanted
            else f"expected {head!r} without a unit, as the others have it, got {ours!r}; say the unit in all heads"
        )
    return None if here == there else (here, there)
