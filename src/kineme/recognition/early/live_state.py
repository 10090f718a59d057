"""The state of a live recognizer after each sample."""

from __future__ import annotations

import math
from enum import Flag, auto
from typing import Any, NamedTuple

from kineme.movements.trajectories.labels import Label
from kineme.recognition.answer import Certainty, in_words
from kineme.validation import Array


class LiveStatus(Flag):
    """Events of an update; members combine. Nothing here is an exception: the stream goes on."""

    UNDECIDED = auto()
    DECIDED = auto()
    TOO_SHORT = auto()
    NOT_FINITE = auto()
    TIME_NOT_INCREASING = auto()
    WRONG_SHAPE = auto()
    AVERAGED = auto()
    NOT_UNIT = auto()

    @property
    def messages(self) -> tuple[str, ...]:
        """One sentence for each member that is set."""
        return tuple(MESSAGES[member] for member in self)


MESSAGES = {
    LiveStatus.UNDECIDED: "no label has been sure enough for long enough",
    LiveStatus.DECIDED: "a label is decided",
    LiveStatus.TOO_SHORT: "fewer than four samples that can be used, or no motion yet",
    LiveStatus.NOT_FINITE: "a sample with NaN, infinity or a number out of range was skipped",
    LiveStatus.TIME_NOT_INCREASING: "a sample that is not later than the one before was skipped",
    LiveStatus.WRONG_SHAPE: "expected a time and d positions or recorded columns, or k times and (k, d) of them, "
    "as many as the samples before; the call was skipped",
    LiveStatus.AVERAGED: "the stream is longer than what is kept: earlier samples are averages of several",
    LiveStatus.NOT_UNIT: "a sample with a quaternion that is not of norm 1 was skipped",
}


class Guess(NamedTuple):
    """A class and its share of the evidence; the shares of all classes and of "unknown" sum to 1."""

    label: Label
    confidence: float


class LiveState(NamedTuple):
    """A movement in progress. Where there is nothing to say yet, floats are NaN, tuples empty and arrays None.

    Attributes
    ----------
    ranked : tuple of Guess
        All classes, the most likely first.
    unknown : float
        Share of a movement of no known class. It grows late: many such movements begin as a known one does.
    label : label or None
        The decided one; None is undecided.
    progress : float
        Share of the path of the most likely class that is done, 0 to 1. Does not fall while that class stays.
    path : ndarray of shape (20, d) or None
        The remaining path, predicted, at even times from now to the arrival.
    goal : ndarray of shape (d,) or None
        Where it ends.
    arrival : float
        Predicted time stamp of the end [s].
    skipped : int
        Samples that could not be used so far; of a call in a wrong shape, one.
    status : LiveStatus
    """

    ranked: tuple[Guess, ...]
    unknown: float
    label: Label | None
    progress: float
    path: Array | None
    goal: Array | None
    arrival: float
    skipped: int
    status: LiveStatus

    @property
    def certainty(self) -> Certainty | None:
        """Certainty so far: "looks like"; None before a movement, and while unknown has the largest share.

        What begins like a known movement may go on otherwise, and what is unlike each one so far may end like one in
        another hand: no more is said before the end, so that the answer to the whole movement contradicts nothing.
        """
        return "looks like" if self.ranked and self.unknown <= self.ranked[0].confidence else None

    @property
    def probabilities(self) -> dict[Label, float]:
        """Probability of each class if the movement is of a known one, most likely first: as that of an `Answer`."""
        known = sum(guess.confidence for guess in self.ranked) or 1.0  # 1 - unknown may be 0 by cancellation
        return {guess.label: guess.confidence / known for guess in self.ranked}

    def to_dict(self, top: int | None = None) -> dict[str, Any]:
        """Return the state as plain data that JSON can hold; what it shares with `Answer.to_dict` has the same keys.

        Parameters
        ----------
        top : int, optional
            How many classes `ranked` lists, the most likely first; by default all.

        Returns
        -------
        dict
            ``label`` (None while undecided), ``certainty``, ``ranked`` (``label``, ``confidence`` and ``probability``
            of each class), ``unknown``, ``progress``, ``arrival``, ``path``, ``goal``, ``skipped`` and ``status`` (its
            messages). What is not known yet is None, or an empty list.
        """
        unknown, progress, arrival = (
            value if math.isfinite(value) else None for value in (self.unknown, self.progress, self.arrival)
        )
        probabilities = self.probabilities
        return {
            "label": None if self.label is None else str(self.label),
            "certainty": self.certainty,
            "ranked": [
                {"label": str(guess.label), "confidence": guess.confidence, "probability": probabilities[guess.label]}
                for guess in self.ranked[:top]
            ],
            "unknown": unknown,
            "progress": progress,
            "arrival": arrival,
            "path": [] if self.path is None else self.path.tolist(),
            "goal": None if self.goal is None else self.goal.tolist(),
            "skipped": self.skipped,
            "status": list(self.status.messages),
        }

    @property
    def in_words(self) -> str:
        """Words for what the movement looks like so far: the decided class, or the most likely one."""
        if not self.ranked:
            return "nothing yet"
        best, word = str(self.ranked[0].label), self.certainty
        if word is None:
            return f"still open, most like {best} so far"
        return f"{in_words(word, best if self.label is None else str(self.label), best)} so far"
