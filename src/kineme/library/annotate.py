"""What happens when in long recordings, by the symbols of a library."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kineme.errors import KinemeError
from kineme.io.reading.merge_files import Recordings, Source
from kineme.io.records import Problem
from kineme.io.writing.annotation import Annotation
from kineme.library.recognize import some_of_each_symbol
from kineme.library.storage.store import Store
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.compared_windows import Templates
from kineme.recognition.known_classes import KnownClasses
from kineme.recognition.spotting import Spotted, spot

_MAX_PIECES = 8  # most stretches between rests that a movement may consist of, as in `Recognizer.spot`


class Annotated(NamedTuple):
    """What happens when in recordings.

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

    Parameters
    ----------
    store : Store
        The library, ``ActionLibrary.store``.
    recordings : Recordings
        Each movement is searched on its own.
    error_rate : float, default 0.05
        As in `Recognizer.spot`.
    progress : callable, optional
        Called now and then with the seconds of recordings that are done.

    Raises
    ------
    SpecificationError
        No movement belongs to a symbol, or an error rate out of range.
    TrajectoryError
        The recordings have other columns than those of the library.
    """
    known = some_of_each_symbol(store)
    known.comparison.checked(recordings.demonstrations[:1], "recordings")  # all of them have the same columns
    annotations, problems, done = [], [], 0.0
    for one, source in zip(recordings.demonstrations, recordings.sources, strict=True):
        before = done

        def tell(share: float, before: float = before, duration: float = one.duration) -> None:
            if progress is not None:
                progress(before + share * duration)

        try:
            found = spot_known(known, one, error_rate, tell)
        except KinemeError as error:
            where = f"{source.place}: " if source.place else ""
            problems.append(Problem(source.path, None, f"{where}{error}", type(error)))
        else:
            annotations += annotations_of(found, one, source)
        done += one.duration
        tell(1.0)
    return Annotated(annotations, problems, bool(known.calibration.calibrated(error_rate).all()))


def spot_known(
    known: KnownClasses, recording: Trajectory, error_rate: float, progress: Callable[[float], object] | None = None
) -> list[Spotted]:
    """Find movements of known classes in a recording, see `Recognizer.spot`."""
    templates = Templates(known.comparison, known.references, known.calibration)
    return spot(templates, recording, error_rate, _MAX_PIECES, progress)


def annotations_of(found: list[Spotted], recording: Trajectory, source: Source) -> list[Annotation]:
    """What was spotted in a recording of that source."""
    origin = float(recording.times[0])
    return [
        Annotation(
            source.path,
            source.place,
            one.start,
            one.end,
            None if one.label is None else str(one.label),
            one.p_known,
            one.confidence,
            origin,
        )
        for one in found
    ]
