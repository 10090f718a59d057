"""Annotation of long recordings by the symbols of a library."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kineme.errors import KinemeError
from kineme.io.reading.merge_files import Recordings, Source
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.recognize import some_of_each_symbol
from kineme.library.storage.store import Store
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import KnownClasses
from kineme.recognition.compared_windows import Templates
from kineme.recognition.spotting import Spotted, spot

_MAX_PIECES = 8  # most stretches between rests that a movement may consist of, as in `Recognizer.spot`


class Annotated(NamedTuple):
    """Annotations of recordings.

    Attributes
    ----------
    annotations : list of Annotation
        In the order of the recordings, and of time.
    problems : list of Problem
        Recordings in which nothing can be looked for, and why.
    calibrated : bool
        Whether the p-values of every symbol are calibrated at the error rate, as in `Answer`; else they are a guess.
    """

    annotations: list[Annotation]
    problems: list[Problem]
    calibrated: bool


def annotate(
    store: Store, recordings: Recordings, error_rate: float = 0.05, progress: Callable[[float], object] | None = None
) -> Annotated:
    """Find the movements of a library's symbols in long recordings, and unknown motion between them.

    Each movement of the recordings is searched on its own, at an error rate as in `Recognizer.spot`. `progress` is
    called now and then with the seconds of recordings that are done.
    """
    classes = some_of_each_symbol(store)
    classes.comparison.checked(recordings.demonstrations[:1], "recordings")  # all of them have the same columns
    annotations, problems, done = [], [], 0.0
    for recording, source in zip(recordings.demonstrations, recordings.sources, strict=True):
        before = done

        def tell(share: float, before: float = before, duration: float = recording.duration) -> None:
            if progress is not None:
                progress(before + share * duration)

        try:
            spotted = spot_known(classes, recording, error_rate, tell)
        except KinemeError as error:
            where = f"{source.place}: " if source.place else ""
            problems.append(Problem(source.path, None, f"{where}{error}", type(error)))
        else:
            annotations += annotations_of(spotted, recording, source)
        done += recording.duration
        tell(1.0)
    return Annotated(annotations, problems, bool(classes.calibration.calibrated(error_rate).all()))


def spot_known(
    classes: KnownClasses, recording: Trajectory, error_rate: float, progress: Callable[[float], object] | None = None
) -> list[Spotted]:
    """Find movements of known classes in a recording, see `Recognizer.spot`."""
    templates = Templates(classes.comparison, classes.references, classes.calibration)
    return spot(templates, recording, error_rate, _MAX_PIECES, progress)


def annotations_of(spotted: list[Spotted], recording: Trajectory, source: Source) -> list[Annotation]:
    """Return what was spotted in a recording of that source as annotations."""
    origin = float(recording.times[0])
    return [
        Annotation(
            source.path,
            source.place,
            movement.start,
            movement.end,
            None if movement.label is None else str(movement.label),
            movement.p_known,
            movement.confidence,
            origin,
        )
        for movement in spotted
    ]
