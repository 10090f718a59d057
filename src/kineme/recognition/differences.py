"""Confusion of classes by people or folds left out, and how two movements differ."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.metrics import confusion_matrix
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, StratifiedKFold

from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.trajectory import MovementLike, MovementsLike
from kineme.recognition.conformal import check_groups
from kineme.recognition.explanation import Explanation
from kineme.recognition.recognizer import Recognizer
from kineme.reporting.page import inline
from kineme.reporting.table import data_frame
from kineme.reporting.text import counted, drawable, first_names, shortened
from kineme.validation import check_count

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NEW = "new"  # the answer to a movement that is called unknown
_DRAWN, _NAME = 40, 24  # classes of a figure, and letters of their names
_NAMED = 3  # classes in a message


@dataclass(frozen=True, eq=False)
class Confusion:
    """Which classes are taken for which, see `confusion`.

    Attributes
    ----------
    labels : tuple of C labels
        The classes, sorted.
    counts : ndarray of shape (C, C + 1)
        Movements by their class (rows) and by the class that was answered; the last column counts those called new.
    """

    labels: tuple[Label, ...]
    counts: NDArray[np.intp] = field(repr=False)

    @property
    def accuracy(self) -> float:
        """Share of movements whose class was answered."""
        return float(self.counts.diagonal().sum() / self.counts.sum())

    @property
    def mistakes(self) -> list[tuple[Label, Label | None, int]]:
        """Class, answer (None for new) and number of movements of every mistake, the most frequent first."""
        wrong = self.counts.copy()
        np.fill_diagonal(wrong, 0)
        rows, columns = np.nonzero(wrong)
        order = np.argsort(-wrong[rows, columns], kind="stable")
        answers = [*self.labels, None]
        return [
            (self.labels[i], answers[j], int(wrong[i, j])) for i, j in zip(rows[order], columns[order], strict=True)
        ]

    @property
    def in_words(self) -> str:
        """How many are right, and the most frequent mistake."""
        n, right = int(self.counts.sum()), int(self.counts.diagonal().sum())
        words = f"{right:,} of {counted(n, 'movement')} right ({100 * self.accuracy:.1f} %)"
        for label, answer, number in self.mistakes[:1]:
            of_class = int(self.counts[self.labels.index(label)].sum())
            taken = "called new" if answer is None else f"taken for {answer}"
            words += f"; most often {label} is {taken}: {number} of {of_class}"
        return words

    def to_pandas(self) -> Any:
        """Return the counts as a data frame: classes as its index, answers as its columns, and ``new`` at the end.

        Raises
        ------
        DataError
            The package pandas is not installed.
        """
        names = [*map(str, self.labels), _NEW]
        # By numbers first: a class may be called "class" or "new".
        frame = data_frame({str(k): column for k, column in enumerate(self.counts.T)})
        return frame.set_axis(names, axis=1).set_axis(names[:-1]).rename_axis("class")

    @overload
    def plot(self, ax: None = None) -> Figure: ...
    @overload
    def plot(self, ax: Axes) -> Axes: ...
    def plot(self, ax: Axes | None = None) -> Figure | Axes:
        """Draw the shares of the answers to each class; of more than 40 classes, those with most mistakes.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Draw into these axes.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            `ax` if it was given; else a new figure, see `Demonstrations.plot`.
        """
        import matplotlib

        from kineme.reporting.figures import figure_to_show

        wrong = self.counts.sum(axis=1) + self.counts[:, :-1].sum(axis=0) - 2 * self.counts.diagonal()
        rows = np.sort(np.argsort(-wrong, kind="stable")[:_DRAWN])
        columns = [*rows.tolist(), *[len(self.labels)] * bool(self.counts[:, -1].any())]
        shares = self.counts / np.maximum(self.counts.sum(axis=1, keepdims=True), 1)
        names = [drawable(shortened(str(name), _NAME)) for name in (*self.labels, _NEW)]
        with matplotlib.rc_context():
            side = 2.2 + 0.3 * len(rows)
            axes: Any = figure_to_show(side + 0.6, side).subplots() if ax is None else ax
            image = axes.imshow(shares[np.ix_(rows, columns)], cmap="Blues", vmin=0, vmax=1)
            for i, row in enumerate(rows.tolist()):
                for j, column in enumerate(columns):
                    if number := self.counts[row, column]:
                        color = "white" if shares[row, column] > 0.5 else "black"
                        axes.text(j, i, f"{number:,}", ha="center", va="center", color=color, fontsize=8)
            axes.set_xticks(np.arange(len(columns)), [names[k] for k in columns], rotation=90)
            axes.set_yticks(np.arange(len(rows)), [names[k] for k in rows])
            title = f"{100 * self.accuracy:.1f} % right"
            title += f"; {len(rows)} of {len(self.labels)} classes" if len(rows) < len(self.labels) else ""
            axes.set(xlabel="answer", ylabel="class", title=title)
            axes.figure.colorbar(image, ax=axes, label="share of the class", shrink=0.8)
        return axes.figure if ax is None else axes

    def _repr_html_(self) -> str:
        """Show the figure in a notebook, and the numbers that matter in words."""
        return inline(self.plot(), self.in_words)


def confusion(
    movements: MovementsLike,
    y: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    *,
    recognizer: Recognizer | None = None,
    folds: int | None = None,
    error_rate: float | None = None,
) -> Confusion:
    """Recognize movements by recognizers that have not seen them, and count which classes are taken for which.

    Parameters
    ----------
    movements : MovementsLike
        Movements with labels, or with `y`.
    y : array_like of shape (n,), optional
        Labels.
    groups : array_like of shape (n,), optional
        Who did each movement. The movements of each person are recognized from those of all others; without, parts of
        each class are left out in turn.
    recognizer : Recognizer, optional
        Whose parameters are used; by default ``Recognizer()``.
    folds : int, optional
        How many parts are left out in turn: by default one for each of the groups, else 5. There are at most as many
        as the smallest class has movements.
    error_rate : float, optional
        Let movements be called new at this error rate, see `Recognizer.recognize`; by default none is.

    Raises
    ------
    SpecificationError
        One group only, a class whose groups are all left out at once, as where it has one, or, without groups, a class
        of one movement.
    TrajectoryError
        Not one label, or not one group, for each movement.
    """
    demos = Demonstrations.of(movements)
    labels = check_labels(demos, y)
    classes, truth = np.unique(labels, return_inverse=True)
    numbers = None if groups is None else check_groups(groups, len(demos))
    least = int(np.bincount(truth if numbers is None else numbers).min())
    n_parts = least if numbers is None else len(np.unique(numbers))
    if n_parts < 2:
        raise SpecificationError(
            "expected several movements of each class, or groups, of which some can be left out, got "
            f"{'one group' if groups is not None else 'a class of one movement'}; record more"
        )
    if folds is not None:
        check_count("folds", folds, least=2)
    n_folds = min(folds or (5 if numbers is None else n_parts), n_parts)
    if numbers is None:
        splitter: Any = StratifiedKFold(n_folds, shuffle=True, random_state=0)
    else:
        splitter = LeaveOneGroupOut() if n_folds == n_parts else GroupKFold(n_folds)
    answers = np.empty(len(demos), dtype=np.intp)
    index_of = {label: c for c, label in enumerate(classes.tolist())}
    parts = list(splitter.split(np.zeros(len(demos)), truth, numbers))
    if lost := sorted({c for train, test in parts for c in np.setdiff1d(truth[test], truth[train]).tolist()}):
        raise SpecificationError(
            "expected each class in groups of which some stay to learn from, got all groups of a class left out: "
            f"{first_names(classes[lost].tolist(), _NAMED)}; leave the class out, record it with others, or leave one "
            "group out at a time, without folds="
        )
    for train, test in parts:
        known_groups = None if numbers is None or error_rate is None else numbers[train]
        fitted = clone(recognizer or Recognizer()).fit(demos[train], labels[train], known_groups)
        given = fitted.predict(demos[test]) if error_rate is None else fitted.predict_known(demos[test], error_rate)
        answers[test] = [index_of.get(label, len(classes)) for label in given.tolist()]
    counts = confusion_matrix(truth, answers, labels=np.arange(len(classes) + 1))[:-1]
    return Confusion(tuple(classes.tolist()), counts)


def compare(movement: MovementLike, other: MovementLike, recognizer: Recognizer | None = None) -> Explanation:
    """Lay another movement over a movement, and say where and by how much they differ.

    Parameters
    ----------
    movement, other : MovementLike
        Of the same dimensions. Their names, or else their labels, are those of the answer.
    recognizer : Recognizer, optional
        Whose parameters say what is taken out before: place, size and a rotation by default.

    Returns
    -------
    Explanation
        ``nearest`` is the other movement, moved, turned and sized onto the first; ``plot()`` draws both, colored by
        their distance, and ``in_words`` says the largest one.

    Raises
    ------
    SpecificationError
        Not one movement each.
    TrajectoryError
        Movements that cannot be compared, as of other dimensions.
    """
    both = [Demonstrations.of(movement), Demonstrations.of(other)]
    if {len(demos) for demos in both} != {1}:
        raise SpecificationError(
            f"expected one movement and another, got {both[0]!r} and {both[1]!r}; choose one of each"
        )
    called = [(each[0].name, each[0].label, default) for each, default in zip(both, ("first", "second"), strict=True)]
    names = [str(next(name for name in each if name is not None)) for each in called]
    one_class = clone(recognizer or Recognizer()).set_params(classifier="nearest")  # a support vector machine needs two
    answer = one_class.fit(both[1], [names[1]]).recognize(both[0][0])
    transform = answer.transform
    turned, sizes = math.degrees(transform.angle), [*map(_rounded, transform.scale.tolist())]
    how = [f"{' by '.join(sizes[:1] if len({*sizes}) == 1 else sizes)} times as large"] * (one_class.scale != "none")
    how += [f"turned by {turned:.0f} degrees"] * (abs(turned) >= 0.5)
    how += [f"{_rounded(1 / transform.duration_ratio)} times as fast"]
    return replace(answer.explain(), answer=f"{names[0]} beside {names[1]} ({', '.join(how)})")


def _rounded(factor: float) -> str:
    """Three digits of a factor of any size, as 0.001 or 1,230."""
    return f"{float(f'{factor:.3g}'):,g}"
