"""Explanations of answers: the movement over its nearest example, where they differ, and the runner-up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.similarity.comparison import Comparison, IndexedMovements
from kineme.similarity.describe import even_paths, fit_maps, recorded_paths
from kineme.similarity.specification import POSITIONS
from kineme.validation import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEAR = 0.5  # of the largest difference: the part around it that is named
_SAME = 0.005  # of the size: what is rounded to 0 %
_ALIKE = 0.05  # of the size: differences that are no more than people's hands


@dataclass(frozen=True, eq=False)
class Overlay:
    """A stored example laid over a movement: moved, turned and sized as the recognizer allows.

    Attributes
    ----------
    label : label
        What the example shows.
    similarity : float
        The averaged kernel K between the two, from 0 to 1.
    path : ndarray of shape (100, d)
        The example at even arc lengths, in the coordinates of the movement.
    differences : ndarray of shape (100,)
        Its distance from the movement at the same share of their paths, as a share of the movement's size: the root
        mean square distance from its center.
    """

    label: Label
    similarity: float
    path: Array
    differences: Array

    @property
    def where(self) -> tuple[float, float]:
        """Shares of the path between which they differ most: where differences are half of the largest or more."""
        largest = int(self.differences.argmax())
        far = self.differences >= _NEAR * self.differences[largest]
        first = last = largest
        while first > 0 and far[first - 1]:
            first -= 1
        while last < len(far) - 1 and far[last + 1]:
            last += 1
        return first / (len(far) - 1), last / (len(far) - 1)

    @property
    def in_words(self) -> str:
        """Where and by how much they differ, in one clause."""
        largest = float(self.differences.max())
        if largest < _SAME:
            return f"the same as an example of {self.label}"
        if largest <= _ALIKE:
            return f"nowhere farther from {self.label} than {100 * largest:.0f} % of its size"
        first, last = self.where
        return (
            f"farthest from {self.label} at {100 * first:.0f} to {100 * last:.0f} % of the path, "
            f"by up to {100 * largest:.0f} % of its size"
        )


@dataclass(frozen=True, eq=False)
class Explanation:
    """Why a movement got its answer, see `Answer.explain`.

    Attributes
    ----------
    answer : str
        The answer in words, such as "sure GShape".
    path : ndarray of shape (100, d)
        The movement, smoothed, at even arc lengths.
    nearest : Overlay
        The most similar example of the class that is answered, or, if the movement is new, of the class that it is most
        like.
    runner_up : Overlay or None
        That of the next class; None if there is no other.
    shares : dict from str to float
        Share of each representation in the similarity to the nearest example.
    """

    answer: str
    path: Array
    nearest: Overlay
    runner_up: Overlay | None
    shares: dict[str, float]

    @property
    def in_words(self) -> str:
        """The answer, where the movement differs from its nearest example, and from the runner-up."""
        words = f"{self.answer}: {self.nearest.in_words}"
        return f"{words}; {self.runner_up.in_words}" if self.runner_up is not None else words

    def to_dict(self) -> dict[str, Any]:
        """Return the explanation as plain data that JSON can hold."""

        def overlay(shown: Overlay | None) -> dict[str, Any] | None:
            if shown is None:
                return None
            first, last = shown.where
            return {
                "label": str(shown.label),
                "similarity": shown.similarity,
                "largest_difference": float(shown.differences.max()),
                "from": first,
                "to": last,
                "differences": shown.differences.tolist(),
                "path": shown.path.tolist(),
            }

        return {
            "answer": self.answer,
            "in_words": self.in_words,
            "path": self.path.tolist(),
            "nearest": overlay(self.nearest),
            "runner_up": overlay(self.runner_up),
            "shares": self.shares,
        }

    def plot(self) -> Figure:
        """Draw the movement over its nearest example and over the runner-up, colored by how far it is from them.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("why.png")`` writes it to a file; see `Demonstrations.plot` for ``plt.show()``.
        """
        from kineme.recognition.answer_figure import Panel, draw_explanation

        overlays = {"nearest": self.nearest, "next": self.runner_up}
        return draw_explanation(
            self.answer,
            self.path,
            [
                Panel(f"{role}: {overlay.label}, {overlay.similarity:.2f} alike", overlay.path, overlay.differences)
                for role, overlay in overlays.items()
                if overlay is not None
            ],
        )


class Rationale(NamedTuple):
    """What an answer rests on: the movement, and the examples that it is most like."""

    comparison: Comparison
    references: IndexedMovements
    movement: Demonstrations  # one
    examples: tuple[tuple[Label, int, float], ...]  # label, index and similarity: the nearest, and the runner-up


def explain(rationale: Rationale, answer: str, shares: dict[str, float]) -> Explanation:
    """Lay the examples over the movement."""
    comparison = rationale.comparison
    rows = np.array([index for _, index, _ in rationale.examples], dtype=np.intp)
    used, which = np.unique(rows, return_inverse=True)
    stored = rationale.references[used]
    own, examples = (POSITIONS.along(_smooth(movements, comparison)) for movements in (rationale.movement, stored))
    examples = examples[which]
    mapped = fit_maps(examples, own, comparison.normalization, comparison.procrustes).move(examples)
    size = float(np.sqrt(own[0].var(axis=1).sum())) or 1.0
    differences = np.sqrt(((mapped - own) ** 2).sum(axis=1)) / size
    overlays = [
        Overlay(label, similarity, np.ascontiguousarray(path.T), difference)
        for (label, _, similarity), path, difference in zip(rationale.examples, mapped, differences, strict=True)
    ]
    return Explanation(
        answer, np.ascontiguousarray(own[0].T), overlays[0], overlays[1] if overlays[1:] else None, shares
    )


def _smooth(movements: Demonstrations, comparison: Comparison) -> Array:
    """Return paths (n, d, T) where they were recorded, smoothed as for comparison in detail."""
    cutoff = comparison.specification.detailed_cutoff
    return recorded_paths(movements, even_paths(movements, 0, len(movements), cutoff))
