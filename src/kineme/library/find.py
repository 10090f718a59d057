"""Occurrences of some symbols of a library in any number of recordings, the surest first."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import NamedTuple

from kineme.errors import DataError, KinemeError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.annotate import annotate_by
from kineme.library.storage.store import Store
from kineme.recognition.answer import KnownClasses

_SUGGESTED = 5  # symbols that a message names


class Occurrences(NamedTuple):
    """Stretches of recordings that show one of the symbols, and what was searched."""

    hits: list[Annotation]  # the surest first, of equally sure ones the most usual
    recordings: int  # that were searched
    seconds: float  # of these
    problems: list[Problem]  # recordings that cannot be read or searched, and why


def find(
    known: KnownClasses,
    pieces: Iterable[Recordings | Problem],
    symbols: Collection[str],
    error_rate: float = 0.05,
    progress: Callable[[float], object] | None = None,
) -> Occurrences:
    """Search recordings for all symbols that are known, and return where they show one of `symbols`.

    All symbols compete for a stretch, as in `annotate`, so that its certainty is calibrated; only the hits are held.
    `progress` is called after each piece with the seconds of recordings that are done.
    """
    hits: list[Annotation] = []
    problems: list[Problem] = []
    n, seconds = 0, 0.0
    for piece in pieces:
        if isinstance(piece, Problem):
            problems.append(piece)
            continue
        try:
            report = annotate_by(known, piece, error_rate)
        except KinemeError as error:  # other columns than those of the library, most likely
            paths = dict.fromkeys(source.path for source in piece.sources)
            problems += [Problem(path, None, str(error), type(error)) for path in paths]
            continue
        hits += [annotation for annotation in report.annotations if annotation.symbol in symbols]
        problems += [*piece.problems, *report.problems]
        n, seconds = n + len(piece), seconds + float(piece.demonstrations.durations.sum())
        if progress is not None:
            progress(seconds)
    hits.sort(key=lambda hit: (-hit.confidence, -hit.p_value))
    return Occurrences(hits, n, seconds, problems)


def check_symbols(store: Store, symbols: Collection[str]) -> None:
    """Refuse names that no symbol of a library has, and say which are near."""
    from difflib import get_close_matches

    from kineme.library.members import members_of

    names = list(members_of(store).names)
    for symbol in symbols:
        if symbol not in names:
            near = get_close_matches(symbol, names, _SUGGESTED, 0.5) or names[:_SUGGESTED]
            raise DataError(
                f"expected a symbol of the library {store.folder}, got {symbol!r}; there are {', '.join(near)}"
            )
