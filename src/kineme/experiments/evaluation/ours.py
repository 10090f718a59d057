"""The recognizer of this library as a contender: its defaults, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.recognizer import Recognizer
from kineme.validation import Array


class Ours:
    """`Recognizer`; familiarity is the smallest nonconformity to any class, negated."""

    def __init__(self, max_angle: float | None) -> None:
        self.recognizer = Recognizer(max_angle=max_angle)

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        self.recognizer.fit(demonstrations)

    def answer(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and familiarity of each movement."""
        scores = self.recognizer.decision_function(demonstrations)
        return self.recognizer.classes_[scores.argmax(axis=1)], -self.recognizer.novelty(demonstrations)

    @property
    def answer_partial(self) -> Callable[[Demonstrations], NDArray[Any]] | None:
        """Class of each movement of which only the beginning has been seen; None where the recognizer has no such."""
        return getattr(self.recognizer, "predict_partial", None)
