"""Annotation of long recordings by the symbols of a library, and where any number of them show some symbols."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import NamedTuple

from kineme.errors import DataError, KinemeError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.members import members_of
from kineme.library.recognize import some_of_each_symbol
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import spellings
from kineme.recognition.answer import KnownClasses
from kineme.recognition.compared_windows import Templates
from kineme.recognition.spotting import spot
from kineme.reporting.text import first_names
from kineme.runtime.parallel import single_threaded_blas

_MAX_PIECES = 8  # most stretches between rests that a movement may consist of, as in `Recognizer.spot`


Progress = Callable[[float], object]  # takes the seconds of recordings that are done


class Annotated(NamedTuple):
    """Annotations of recordings."""

    annotations: list[Annotation]  # in the order of the recordings, and of time
    problems: list[Problem]  # recordings in which nothing can be looked for, and why
    calibrated: bool  # True if the p-values of every symbol are, at the error rate, as in `Answer`; else a guess


@single_threaded_blas()  # of few rows at a time: a second thread mostly waits
def annotate_by(
    classes: KnownClasses, recordings: Recordings, error_rate: float = 0.05, progress: Progress | None = None
) -> Annotated:
    """Find movements of symbols, as of `some_of_each_symbol`, in long recordings, and unknown motion between them."""
    classes.comparison.checked(recordings.demonstrations[:1], "recordings")  # all of them have the same columns
    templates = Templates(classes.comparison, classes.references, classes.calibration)
    annotations: list[Annotation] = []
    problems: list[Problem] = []
    done = 0.0
    for recording, source in zip(recordings.demonstrations, recordings.sources, strict=True):
        before = done

        def tell(share: float, before: float = before, duration: float = recording.duration) -> None:
            if progress is not None:
                progress(before + share * duration)

        try:
            spotted = spot(templates, recording, error_rate, _MAX_PIECES, tell)
        except KinemeError as error:
            where = f"{source.place}: " if source.place else ""
            problems.append(Problem(source.path, None, f"{where}{error}", type(error)))
        else:
            for movement in spotted:
                label = None if movement.label is None else str(movement.label)
                times = movement.start, movement.end
                certainty = movement.p_known, movement.confidence
                origin = float(recording.times[0])
                place = source.path, source.place
                annotations.append(Annotation(*place, *times, label, *certainty, origin, movement.uncertainty))
        done += recording.duration
        tell(1.0)
    return Annotated(annotations, problems, bool(classes.calibration.calibrated(error_rate).all()))


_SUGGESTED = 5  # symbols that a message names


class Occurrences(NamedTuple):
    """Stretches of recordings that show one of the symbols, and what was searched."""

    hits: list[Annotation]  # the surest first, of equally sure ones the most usual
    recordings: int  # that were searched
    seconds: float  # of these
    problems: list[Problem]  # recordings that cannot be read or searched, and why
    calibrated: bool  # as of `Annotated`


def find(
    store: Store,
    pieces: Iterable[Recordings | Problem],
    symbols: Collection[str],
    error_rate: float = 0.05,
    progress: Progress | None = None,
) -> Occurrences:
    """Search recordings for all symbols of a library, and return where they show one of `symbols`.

    All symbols compete for a stretch, as in `annotate_by`, so that its certainty is calibrated; only the hits are held.
    `progress` is called after each piece with the seconds of recordings that are done.
    """
    classes = some_of_each_symbol(store)
    hits: list[Annotation] = []
    problems: list[Problem] = []
    n, seconds = 0, 0.0
    for piece in pieces:
        if isinstance(piece, Problem):
            problems.append(piece)
            continue
        try:
            report = annotate_by(classes, piece, error_rate)
        except KinemeError as error:  # other columns than those of the library, most likely
            paths = dict.fromkeys(source.path for source in piece.sources)
            problems += [*piece.problems, *(Problem(path, None, str(error), type(error)) for path in paths)]
            continue
        hits += [annotation for annotation in report.annotations if annotation.symbol in symbols]
        problems += [*piece.problems, *report.problems]
        n, seconds = n + len(piece), seconds + float(piece.demonstrations.durations.sum())
        if progress is not None:
            progress(seconds)
    hits.sort(key=lambda hit: (-hit.confidence, -hit.p_value))
    return Occurrences(hits, n, seconds, problems, bool(classes.calibration.calibrated(error_rate).all()))


def check_symbols(store: Store, symbols: Collection[str]) -> list[str]:
    """Return names as the library has them; refuse those that no symbol has, and say which are near."""
    from difflib import get_close_matches

    names = list(members_of(store).names)
    known = {text: name for name in names for text in spellings(name)} | dict(zip(names, names, strict=True))
    for symbol in symbols:
        if symbol not in known:
            near = get_close_matches(symbol, names, _SUGGESTED, 0.5) or names
            raise DataError(
                f"expected a symbol of the library {store.folder}, got {symbol!r}; there are "
                f"{first_names(near, _SUGGESTED)}"
            )
    return [known[symbol] for symbol in symbols]
