"""Annotation of long recordings by the symbols of a library."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kineme.errors import KinemeError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.recognize import some_of_each_symbol
from kineme.library.storage.store import Store
from kineme.recognition.answer import KnownClasses
from kineme.recognition.compared_windows import Templates
from kineme.recognition.spotting import spot

_MAX_PIECES = 8  # most stretches between rests that a movement may consist of, as in `Recognizer.spot`


Progress = Callable[[float], object]  # takes the seconds of recordings that are done


class Annotated(NamedTuple):
    """Annotations of recordings."""

    annotations: list[Annotation]  # in the order of the recordings, and of time
    problems: list[Problem]  # recordings in which nothing can be looked for, and why
    calibrated: bool  # True if the p-values of every symbol are, at the error rate, as in `Answer`; else a guess


def annotate(
    store: Store, recordings: Recordings, error_rate: float = 0.05, progress: Progress | None = None
) -> Annotated:
    """Find the movements of a library's symbols in long recordings, and unknown motion between them.

    Each movement of the recordings is searched on its own, at an error rate as in `Recognizer.spot`. `progress` is
    called now and then with the seconds of recordings that are done.
    """
    return annotate_by(some_of_each_symbol(store), recordings, error_rate, progress)


def annotate_by(
    known: KnownClasses, recordings: Recordings, error_rate: float = 0.05, progress: Progress | None = None
) -> Annotated:
    """Annotate by symbols that are prepared once for many recordings, see `some_of_each_symbol`."""
    known.comparison.checked(recordings.demonstrations[:1], "recordings")  # all of them have the same columns
    templates = Templates(known.comparison, known.references, known.calibration)
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
                annotations.append(Annotation(source.path, source.place, *times, label, *certainty, origin))
        done += recording.duration
        tell(1.0)
    return Annotated(annotations, problems, bool(known.calibration.calibrated(error_rate).all()))
