"""Explanations of answers: the movement over its nearest example, where they differ, and the runner-up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels.channel import Channels, learned_names
from kineme.movements.channels.detect import point_names
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.presented import with_units
from kineme.sampling import runs
from kineme.similarity.comparison import Comparison, IndexedMovements
from kineme.similarity.describe import N_POINTS, even_paths, fit_maps, recorded_paths
from kineme.similarity.specification import POSITIONS
from kineme.validation import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEAR = 0.5  # of the largest difference: the part around it that is named
_SAME = 0.005  # of the size: what is rounded to 0 %
_ALIKE = 0.05  # of the size: differences that are no more than people's hands
_TURNED = 10.0  # [degrees]: less is no more than people's hands
_ALONG = replace(POSITIONS, n_points=N_POINTS)
_CONVOLUTIONS = "ranked with random convolutions; example and shares are those of the kernels"


class Part(NamedTuple):
    """A point of a movement, or one of its columns where these are no points: its name, and the numbers of columns."""

    name: str
    columns: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Overlay:
    """A stored example laid over a movement: moved, turned and sized as the recognizer allows.

    Attributes
    ----------
    label : label
        What the example shows.
    similarity : float
        The averaged kernel K between the two, from 0 to 1.
    path : ndarray of shape (199, d)
        The example at even arc lengths, of a signal at even times, in the coordinates of the movement.
    differences : ndarray of shape (199,)
        Its distance from the movement at the same share of their paths, as a share of the movement's size: the root
        mean square distance from its center.
    part : str or None
        The point, or the column, in which they differ most where they differ most; None where there is but one.
    turned : float
        By how many degrees the example was turned; in the plane counterclockwise if positive.
    """

    label: Label
    similarity: float
    path: Array = field(repr=False)
    differences: Array = field(repr=False)
    part: str | None
    turned: float

    @property
    def name(self) -> str:
        """The label, and by how much its example was turned where that tells them apart."""
        return f"{self.label} {self.turn}".rstrip()

    @property
    def turn(self) -> str:
        """By how much the example was turned; empty for less than 10 degrees."""
        return f"turned by {self.turned:.0f} degrees" if abs(self.turned) >= _TURNED else ""

    @property
    def where(self) -> tuple[float, float]:
        """Shares of the path between which they differ most: where differences are half of the largest or more."""
        largest, last = int(self.differences.argmax()), len(self.differences) - 1
        far = runs(self.differences >= _NEAR * self.differences[largest])
        first, stop = far[far[:, 1] > largest][0].tolist()
        return first / last, (stop - 1) / last

    @property
    def in_words(self) -> str:
        """Where and by how much they differ, in one clause."""
        largest = float(self.differences.max())
        if largest < _SAME:
            return f"the same as an example of {self.name}"
        if largest <= _ALIKE:
            return f"nowhere farther from {self.name} than {100 * largest:.0f} % of its size"
        first, last = self.where
        along, part = "time" if self.path.shape[1] == 1 else "path", f", most in {self.part}" if self.part else ""
        return (
            f"farthest from {self.name} at {100 * first:.0f} to {100 * last:.0f} % of the {along}, "
            f"by up to {100 * largest:.0f} % of its size{part}"
        )


@dataclass(frozen=True, eq=False)
class Explanation:
    """Why a movement got its answer, see `Answer.explain`.

    Attributes
    ----------
    answer : str
        The answer in words, such as "sure GShape".
    path : ndarray of shape (199, d)
        The movement, smoothed, at even arc lengths, of a signal at even times.
    columns : tuple of d str
        Names of the columns, with their units where these are known.
    parts : tuple of Part
        The points, or the columns where these are no points.
    nearest : Overlay
        The most similar example of the class that is answered, or, if the movement is new, of the class that it is most
        like.
    runner_up : Overlay or None
        That of the class next in rank; None if there is no other.
    shares : dict from str to float
        Share of each representation in the similarity to the nearest example.
    by_convolutions : bool
        True if random convolutions ranked the classes, alone or beside the kernels, which chose the examples alone.
    """

    answer: str
    path: Array = field(repr=False)
    columns: tuple[str, ...] = field(repr=False)
    parts: tuple[Part, ...] = field(repr=False)
    nearest: Overlay
    runner_up: Overlay | None
    shares: dict[str, float] = field(repr=False)
    by_convolutions: bool

    @property
    def in_words(self) -> str:
        """The answer, where the movement differs from its nearest example, and from the runner-up."""
        words = f"{self.answer}{f' ({_CONVOLUTIONS})' * self.by_convolutions}: {self.nearest.in_words}"
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
                "part": shown.part,
                "turned": shown.turned,
                "differences": shown.differences.tolist(),
                "path": shown.path.tolist(),
            }

        return {
            "answer": self.answer,
            "in_words": self.in_words,
            "by_convolutions": self.by_convolutions,
            "columns": list(self.columns),
            "path": self.path.tolist(),
            "nearest": overlay(self.nearest),
            "runner_up": overlay(self.runner_up),
            "shares": self.shares,
        }

    def plot(self) -> Figure:
        """Draw the movement over its nearest example and over the runner-up, colored by how far it is from them.

        Each point is drawn apart, and each column where these are no points; of many those that differ most.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("why.png")`` writes it to a file; see `Demonstrations.plot` for ``plt.show()``.
        """
        from kineme.recognition.answer_figure import Panel, draw_explanation

        overlays = {"nearest": self.nearest, "next in rank": self.runner_up}
        panels = [
            Panel(
                [
                    f"{f'{role}: ' * (self.runner_up is not None)}{overlay.label}, {overlay.similarity:.2f} alike",
                    *filter(None, [overlay.turn]),
                ],
                overlay.path,
                by_part(self.path, overlay.path, self.parts),
            )
            for role, overlay in overlays.items()
            if overlay is not None
        ]
        title = [self.answer, *[_CONVOLUTIONS] * self.by_convolutions]
        return draw_explanation(title, self.path, self.columns, self.parts, panels)

    def _repr_html_(self) -> str:
        """Show the figure in a notebook, and say the same in words."""
        from kineme.reporting.page import inline

        return inline(self.plot(), self.in_words)


@dataclass(frozen=True, eq=False)
class Transform:
    """``x = matrix @ x_demonstration + shift``, and a time that runs `duration_ratio` as long.

    With sizes of both per dimension, ``matrix = diag(size) R diag(1 / size_demonstration)``; with one size for all
    dimensions, ``matrix = scale R``. What the recognizer does not take out stays 0, or 1, here.
    """

    matrix: Array  # (d, d)
    shift: Array  # (d,)
    scale: Array  # (d,), equal numbers unless sizes are per dimension
    rotation: Array  # (d, d), R: of points that turn together the rotation of each along the diagonal
    duration_ratio: float
    n_points: int = 1

    @property
    def angle(self) -> float:
        """Angle of the rotation [rad], of points their common one; with a sign in the plane, counterclockwise positive.

        0 for columns that are not rotated.
        """
        return angle_of(self.rotation, self.n_points)

    def apply(self, positions: Array) -> Array:
        """Return positions (T, d) of the demonstration, mapped."""
        return np.asarray(positions) @ self.matrix.T + self.shift


def angle_of(rotation: Array, n_points: int) -> float:
    """Return the angle of a rotation (d, d) [rad], as `Transform.angle` says it."""
    d = len(rotation) // n_points
    R = rotation[:d, :d]
    if d == 2:
        return math.atan2(R[1, 0], R[0, 0])
    if d != 3:
        return 0.0
    return math.atan2(float(np.linalg.norm(R - R.T)) / math.sqrt(2.0), float(np.trace(R)) - 1.0)


@dataclass(frozen=True, eq=False)
class Matches:
    """Movements that were recognized together, and the reference that each is most like."""

    comparison: Comparison
    references: IndexedMovements
    movements: Demonstrations  # n
    examples: NDArray[np.intp]  # (n,), which references
    shares: Array  # (R, n), of the representations in these similarities

    @cached_property
    def transforms(self) -> list[Transform]:
        """Transforms from the references onto the movements, fitted when the first is asked for.

        Fitted to positions over the phase of the representation with the largest share, one batch for each phase.
        """
        comparison, demos = self.comparison, self.movements
        # Of two representations that are equally alike, the one with the larger weight has the larger share.
        weights = comparison.similarity.weights
        alike = self.shares if weights is None else self.shares / np.maximum(weights, np.finfo(float).tiny)[:, None]
        phases = np.array([each.arc_share for each in comparison.representations])[alike.argmax(axis=0)]
        used, which = np.unique(self.examples, return_inverse=True)  # one example may be that of many
        stored = self.references[used]
        examples, paths = _smooth(stored, comparison.cutoff)[which], _smooth(demos, comparison.cutoff)
        ratios = (demos.durations / stored.durations[which]).tolist()
        transforms: dict[int, Transform] = {}
        for phase in np.unique(phases):
            chosen = np.flatnonzero(phases == phase)
            positions = replace(POSITIONS, arc_share=float(phase))
            ours, theirs = positions.along(examples[chosen]), positions.along(paths[chosen])
            maps = fit_maps(ours, theirs, comparison.normalization, comparison.procrustes)
            for i, matrix, shift, rotation, scale in zip(chosen.tolist(), *maps, strict=True):
                transforms[i] = Transform(matrix, shift, scale, rotation, ratios[i], comparison.procrustes.n_points)
        return [transforms[i] for i in range(len(demos))]


class Rationale(NamedTuple):
    """What an answer rests on: one of the movements, and the examples that it is most like."""

    matches: Matches
    row: int
    examples: tuple[tuple[Label, int, float], ...]  # label, index and similarity: the nearest, and the runner-up
    by_convolutions: bool


def explain(rationale: Rationale, answer: str, shares: dict[str, float]) -> Explanation:
    """Lay the examples over the movement."""
    comparison, row = rationale.matches.comparison, rationale.row
    movement, cutoff = rationale.matches.movements[row : row + 1], comparison.specification.detailed_cutoff
    rows = np.array([index for _, index, _ in rationale.examples], dtype=np.intp)
    used, which = np.unique(rows, return_inverse=True)
    stored = rationale.matches.references[used]
    target, examples = (_ALONG.along(_smooth(movements, cutoff)) for movements in (movement, stored))
    examples = examples[which]
    maps = fit_maps(examples, target, comparison.normalization, comparison.procrustes)
    channels = comparison.channels or movement.channels  # movements are in the columns that were learned
    columns = movement._samples.axis_names if channels is None else with_units(learned_names(channels), channels)
    path, parts, overlays = np.ascontiguousarray(target[0].T), _parts(comparison, channels, columns), []
    n_points = comparison.procrustes.n_points
    for (label, _, similarity), moved, rotation in zip(
        rationale.examples, maps.move(examples), maps.rotations, strict=True
    ):
        example = np.ascontiguousarray(moved.T)
        squares = by_part(path, example, parts) ** 2
        differences = np.sqrt(squares.sum(axis=0))
        part = parts[squares[:, differences.argmax()].argmax()].name if parts[1:] else None
        overlays.append(
            Overlay(label, similarity, example, differences, part, math.degrees(angle_of(rotation, n_points)))
        )
    runner_up = overlays[1] if overlays[1:] else None
    return Explanation(answer, path, columns, parts, overlays[0], runner_up, shares, rationale.by_convolutions)


def _parts(comparison: Comparison, channels: Channels | None, columns: tuple[str, ...]) -> tuple[Part, ...]:
    """Return the points of the movement; its columns where these are none in the plane or in space."""
    n, d = comparison.procrustes.n_points, comparison.procrustes.n_dims
    if d not in (2, 3):
        return tuple(Part(name, (k,)) for k, name in enumerate(columns))
    names = point_names(channels)
    names = names if len(names) == n else tuple(f"point {k + 1}" for k in range(n))
    return tuple(Part(name, tuple(range(k * d, (k + 1) * d))) for k, name in enumerate(names))


def by_part(path: Array, example: Array, parts: tuple[Part, ...]) -> Array:
    """Return distances (P, T) of two paths (T, d) in each part, as shares of the size of the first."""
    size = float(np.sqrt(path.var(axis=0).sum())) or 1.0
    return np.stack([np.linalg.norm((example - path)[:, part.columns], axis=1) for part in parts]) / size


def _smooth(movements: Demonstrations, cutoff: float | None) -> Array:
    """Return paths (n, d, T) where they were recorded, smoothed as for comparison."""
    return recorded_paths(movements, even_paths(movements, 0, len(movements), cutoff))
