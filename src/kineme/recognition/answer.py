"""The answer to a movement: label, confidence, nearest demonstrations, and the map from the nearest one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.trajectory import MovementLike, MovementsLike, Trajectory
from kineme.recognition.classifiers import BY_CONVOLUTIONS, KERNELS, NearestEach, fit_classifier
from kineme.recognition.conformal import GUESSES, RULES, Calibration, calibrate, check_error_rate, class_probabilities
from kineme.recognition.explanation import Explanation, Matches, Rationale, Transform, explain
from kineme.reporting.page import thumbnail
from kineme.reporting.table import Table, data_frame, to_html
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.comparison import Comparison, IndexedMovements, References, fit_comparison
from kineme.similarity.describe import Described
from kineme.similarity.scores import Classifier, Compared, for_compared, score
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.validation import Array, as_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What calibrates references, as `calibrate` does.
Calibrates = Callable[[AveragedSimilarity, References, NDArray[np.intp] | None, Classifier], Calibration]

Certainty = Literal["sure", "probably", "looks like", "new"]

#: Word -> the least confidence that it takes. The guide to recognition has the shares of right answers by word.
LEAST_CONFIDENCE = MappingProxyType({"sure": 0.999, "probably": 0.99})

_SHOWN = 3  # demonstrations named in an answer
_LISTED = 10  # classes that a notebook shows


@dataclass(frozen=True)
class Neighbor:
    """A stored demonstration that is similar to the movement.

    Attributes
    ----------
    index : int
        Its position in the recognizer's `demonstrations_`; in a library, its id.
    name : str or None
        Where it comes from.
    similarity : float
        The averaged kernel K between the two, from 0 to 1.
    """

    index: int
    name: str | None
    similarity: float


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer of a recognizer to one movement.

    Attributes
    ----------
    label : label or None
        The best-ranked class whose p-value is above the error rate, or the best-ranked of all if there is none or
        random convolutions rank; None, unknown, if `p_known` is not above the error rate.
    confidence : float
        Probability that the label is right if the movement is of a known class, see `class_probabilities`: of
        answers with 0.9 about nine in ten are right. From three demonstrations of each class on, it differs from that
        share on average by 0.08 for exercises at a wrist, and by 0.02 or less for others; with one of each by 0.30 for
        long words, 0.12 for signs and up to 0.10 for exercises (``python -m bench --only open_set``). If unknown, 1
        minus `p_known`: the share of known movements that are less novel, and no probability, since it is not known how
        many movements are of no class.
    probabilities : mapping from label to float
        Probability of each class if the movement is of a known one, see `class_probabilities`; they sum to 1.
    p_known : float
        Share of movements of known classes that would be as novel or more; without groups at least what it would be if
        somebody else made the movement, see `Calibration`.
    p_values : mapping from label to float
        Share of the members of the class that would be as far from their nearest demonstration, or farther; see
        `Calibration`.
    rule : {"class", "pooled", "strangers", "guess"}
        Which demonstrations `p_known` was calibrated on; `promise` says what follows.
    calibrated : bool
        Whether there are enough demonstrations for every class that the error rate is kept, see `Calibration`: for
        people who showed some; for others, of whom several times as many may be called unknown, only if `fit` was told
        the groups. If not, as with one demonstration of each class, p-values are a guess. Of a class
        with one demonstration beside classes with more, more movements than that may be called unknown.
    ranked : tuple of labels
        Best first, in the order of the classifier.
    nearest : tuple of Neighbor
        Up to three demonstrations of the answered class, or, if unknown, of the best-ranked one; nearest first.
    transform : Transform
        Maps the first of them onto the movement; computed when it is first asked for.
    responsibilities : mapping from str to float
        Share of each representation in the similarity to the first of them; they sum to 1.
    """

    label: Label | None
    confidence: float
    probabilities: Mapping[Label, float]
    p_known: float
    p_values: Mapping[Label, float]
    rule: str
    calibrated: bool
    ranked: tuple[Label, ...]
    nearest: tuple[Neighbor, ...]
    responsibilities: Mapping[str, float]
    _rests_on: Rationale | None = field(default=None, repr=False)
    _transform: Transform | None = field(default=None, repr=False)

    @property
    def transform(self) -> Transform:
        """Map from the first of `nearest` onto the movement; computed when it is first asked for."""
        if self._transform is None:
            rests_on = self._movements("for its transform")
            object.__setattr__(self, "_transform", rests_on.matches.transforms[rests_on.row])
        return cast(Transform, self._transform)

    @property
    def promise(self) -> str:
        """Promise of the rule about known movements that are called unknown, in one sentence."""
        return RULES[self.rule]

    @property
    def certainty(self) -> Certainty:
        """Certainty of the answer: "sure", "probably", "looks like", or "new" if it is unknown.

        Nothing is more than "looks like" where the rule is "strangers" or "guess", whatever the confidence.
        """
        return certainty(self.confidence, is_new=self.label is None, is_guess=self.rule in GUESSES)

    @property
    def in_words(self) -> str:
        """Certainty and label, such as "sure GShape"; or what the movement is most like if it is new."""
        return in_words(self.certainty, str(self.label), str(self.ranked[0]))

    def to_dict(self, top: int | None = None) -> dict[str, Any]:
        """Return the answer as plain data that JSON can hold; shell, studio and page have this form, too.

        ``recognition/answer.schema.json`` of the package is its JSON Schema (draft 2020-12).

        Parameters
        ----------
        top : int, optional
            How many classes `ranked` lists, best first; by default all.

        Returns
        -------
        dict
            ``label`` (None if unknown), ``certainty``, ``confidence``, ``p_known``, ``rule``, ``promise``,
            ``calibrated``, ``ranked`` (``label``, ``probability`` and ``p_value`` of each class; in a large library
            the numbers of the least like are None), ``nearest`` (``index``, ``name``, ``similarity``), ``transform``
            (``matrix``, ``shift``, ``scale``, ``angle``, ``duration_ratio``) and ``responsibilities``.
            Labels are texts.
        """
        transform = self.transform
        return {
            "label": None if self.label is None else str(self.label),
            "certainty": self.certainty,
            "confidence": self.confidence,
            "p_known": self.p_known,
            "rule": self.rule,
            "promise": self.promise,
            "calibrated": self.calibrated,
            "ranked": [
                {"label": str(label), "probability": self.probabilities.get(label), "p_value": self.p_values.get(label)}
                for label in self.ranked[:top]
            ],
            "nearest": [
                {"index": neighbor.index, "name": neighbor.name, "similarity": neighbor.similarity}
                for neighbor in self.nearest
            ],
            "transform": {
                "matrix": transform.matrix.tolist(),
                "shift": transform.shift.tolist(),
                "scale": transform.scale.tolist(),
                "angle": transform.angle,
                "duration_ratio": transform.duration_ratio,
            },
            "responsibilities": dict(self.responsibilities),
        }

    def to_pandas(self) -> Any:
        """Return the answer as a table of one row: ``pandas.concat(one.to_pandas() for one in answers)`` joins many.

        Returns
        -------
        pandas.DataFrame
            With the columns ``label`` (None if unknown), ``certainty``, ``confidence``, ``p_known``, ``rule``,
            ``calibrated``, ``most_like`` (the best-ranked class), ``nearest`` (index of the nearest demonstration),
            ``nearest_name``, ``similarity``, ``angle`` [rad] and ``duration_ratio``.

        Raises
        ------
        DataError
            The package pandas is not installed.
        """
        nearest = self.nearest[0]
        row = {
            name: getattr(self, name) for name in ("label", "certainty", "confidence", "p_known", "rule", "calibrated")
        }
        row |= {"most_like": self.ranked[0], "nearest": nearest.index, "nearest_name": nearest.name}
        row |= {"similarity": nearest.similarity, "angle": self.transform.angle}
        row["duration_ratio"] = self.transform.duration_ratio
        return data_frame({name: [value] for name, value in row.items()})

    def explain(self) -> Explanation:
        """Explain the answer: the movement over its nearest example, where they differ, and the runner-up.

        ``answer.explain().plot()`` draws it, and ``answer.explain().in_words`` says it in a sentence.

        Raises
        ------
        SpecificationError
            An answer that was sent to another process: it leaves the movements behind.
        """
        return explain(self._movements("and explain that answer"), self.in_words, dict(self.responsibilities))

    def _movements(self, purpose: str) -> Rationale:
        if self._rests_on is None:
            raise SpecificationError(
                "expected an answer as it was given, got one that was sent to another process without its movements; "
                f"recognize the movement again {purpose}"
            )
        return self._rests_on

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_transform": self.transform, "_rests_on": None}

    def plot(self, movement: MovementLike | None = None, demonstrations: MovementsLike | None = None) -> Figure:
        """Draw the probabilities of the first ten classes, and the share of each representation in the similarity.

        Parameters
        ----------
        movement : Trajectory or array, optional
            What was recognized: it is drawn beside the nearest demonstration, which is mapped onto it by `transform`.
        demonstrations : MovementsLike, optional
            Those of the recognizer, ``recognizer.demonstrations_``, which `nearest` counts.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("answer.png")`` writes it to a file; see `Demonstrations.plot` for ``plt.show()``.

        Raises
        ------
        SpecificationError
            One of the two alone, another number of dimensions, or demonstrations of another recognizer.
        """
        from kineme.recognition.answer_figure import Example, Shares, draw_answer

        classes = {label: self.probabilities[label] for label in self.ranked}
        shares = Shares(self.in_words, classes, self.label, self.responsibilities)
        shown = self.ranked[0] if self.label is None else self.label
        return draw_answer(shares, Example(self.nearest[0].index, shown, self.transform), movement, demonstrations)

    def _repr_html_(self) -> str:
        """Show the movement, its nearest examples and the first ten classes in a notebook; names are escaped."""
        shown = self.ranked[:_LISTED]
        rows = [(str(label), f"{self.probabilities[label]:.2f}") for label in shown]
        pictures = []
        if self._rests_on is not None:
            matches, row, examples, _ = self._rests_on
            nearest = matches.references[np.array([index for _, index, _ in examples], dtype=np.intp)]
            drawn = {label: thumbnail(stored.positions) for (label, *_), stored in zip(examples, nearest, strict=True)}
            pictures = [thumbnail(matches.movements[row].positions), *(drawn.get(label, "") for label in shown)]
            rows.insert(0, ("the movement", ""))
        return to_html(Table(self.in_words, ("class", "probability, if it is known"), rows, self.promise, pictures))

    def __repr__(self) -> str:
        sure = f"confidence={self.confidence:.3g}, rule={self.rule!r}, calibrated={self.calibrated}"
        return f"Answer(label={self.label!r}, {sure}, nearest={self.nearest[0]})"


def is_one(X: MovementsLike) -> bool:
    """Tell whether this is one movement: a `Trajectory`, or an array of shape (T,) or (T, d)."""
    given = as_array(X)
    return isinstance(X, Trajectory) or (isinstance(given, np.ndarray) and given.dtype != object and given.ndim <= 2)


def known_labels(
    classifier: Classifier, classes: NDArray[Any], scores: Array, p_values: Array, p_known: Array, error_rate: float
) -> NDArray[np.object_]:
    """Choose the best class of each movement by `scores` (n, C); None, unknown, where `p_known` (n,) is small.

    Kernels choose among the classes whose p-value is above the error rate, if there are any. P-values rest on distances
    to the nearest reference, so random convolutions, which tell classes apart where these do not, choose among all.
    """
    possible = p_values > error_rate
    possible |= ~possible.any(axis=1, keepdims=True) | isinstance(classifier, BY_CONVOLUTIONS)
    labels = classes.astype(object)[np.where(possible, scores, -np.inf).argmax(axis=1)]
    labels[p_known <= error_rate] = None
    return np.asarray(labels)


class Verdict(NamedTuple):
    """An answer without its movements, and what it says of them."""

    answer: Answer
    shares: Array  # (R,), of the representations
    examples: tuple[tuple[Label, int, float], ...]  # of `Rationale`
    by_convolutions: bool


def verdicts_of(
    compared: Compared, classifier: Classifier, calibration: Calibration, error_rate: float
) -> list[Verdict]:
    """Tell what each movement is, from how it compares."""
    scores, similar = classifier.scores(compared), classifier.nearest_logs(compared)
    p = calibration.p_values(similar, error_rate)
    calibrated = bool(calibration.calibrated(error_rate).all())
    references = compared.references
    p_known = calibration.known_p_values(similar, error_rate)
    labels = known_labels(classifier, references.classes, scores, p, p_known, error_rate)
    rules = calibration.rules(similar, error_rate)
    classes = references.classes.tolist()
    ranks = np.argsort(-scores, axis=1, kind="stable")
    index_of = {label: c for c, label in enumerate(classes)}
    shown = np.array([ranks[i, 0] if label is None else index_of[label] for i, label in enumerate(labels)])
    slices = list(references.slices())
    like = [_nearest(references, compared.log_average[i], slices[c]) for i, c in enumerate(shown.tolist())]
    share = compared.shares(np.array([near[0].index for near in like], dtype=np.intp))
    rows_of: dict[str, list[int]] = {}  # those of one name differ in resolution only
    for r, representation in enumerate(compared.comparison.representations):
        rows_of.setdefault(representation.name, []).append(r)
    if isinstance(classifier, BY_CONVOLUTIONS):
        probabilities = classifier.probabilities(scores)
    else:
        by_label = scores if isinstance(classifier, NearestEach) else similar
        probabilities = class_probabilities(by_label, calibration.exponent)
    examples = []  # the nearest of the class that is shown, and of the best-ranked other one
    for i, best in enumerate(like):
        others = [c for c in ranks[i, :2].tolist() if c != shown[i]][:1]
        next_best = [_nearest(references, compared.log_average[i], slices[c])[0] for c in others]
        pairs = zip([shown[i], *others], [best[0], *next_best], strict=True)
        examples.append(tuple((classes[c], near.index, near.similarity) for c, near in pairs))
    confidence = np.where(p_known > error_rate, probabilities[np.arange(len(shown)), shown], 1.0 - p_known).tolist()
    return [
        Verdict(
            Answer(
                labels[i],
                confidence[i],
                dict(zip(classes, probabilities[i].tolist(), strict=True)),
                float(p_known[i]),
                dict(zip(classes, p[i].tolist(), strict=True)),
                rules[i],
                calibrated,
                tuple(classes[c] for c in ranks[i].tolist()),
                like[i],
                {name: float(share[rows, i].sum()) for name, rows in rows_of.items()},
            ),
            share[:, i],
            examples[i],
            isinstance(classifier, BY_CONVOLUTIONS),
        )
        for i in range(len(labels))
    ]


def answers_of(
    verdicts: Sequence[Verdict], comparison: Comparison, references: IndexedMovements, demos: Demonstrations
) -> list[Answer]:
    """Return the answers to movements, which keep the movements and the references that these are most like."""
    example = np.array([verdict.answer.nearest[0].index for verdict in verdicts], dtype=np.intp)
    share = np.stack([verdict.shares for verdict in verdicts], axis=1)
    matches = Matches(comparison, references, demos, example, share)
    return [
        replace(answer, _rests_on=Rationale(matches, row, examples, by_convolutions))
        for row, (answer, _, examples, by_convolutions) in enumerate(verdicts)
    ]


def _nearest(references: References, logs: Array, rows: slice) -> tuple[Neighbor, ...]:
    """Return the nearest references of one class, which are in these rows."""
    best = rows.start + np.argsort(-logs[rows], kind="stable")[:_SHOWN]
    names = references.demonstrations.names
    return tuple(Neighbor(int(i), names[i] if names else None, float(np.exp(logs[i]))) for i in best)


def certainty(confidence: float, *, is_new: bool, is_guess: bool) -> Certainty:
    """Tell how sure it is that a movement is of the class that is said.

    - `confidence`: probability of that class if the movement is of a known one.
    - `is_new`: whether the movement is unlike every known class.
    - `is_guess`: whether too few demonstrations tell what is unlike them: the answer then is what the movement looks
      like.
    """
    if is_new:
        return "new"
    if is_guess or confidence < LEAST_CONFIDENCE["probably"]:
        return "looks like"
    return "sure" if confidence >= LEAST_CONFIDENCE["sure"] else "probably"


def in_words(word: Certainty, name: str, most_like: str) -> str:
    """Return the word with the name that it is about: of what is new, that which it is most like."""
    return f"new, most like {most_like}" if word == "new" else f"{word} {name}"


class FittedRecognizer(Protocol):
    """A fitted `kineme.Recognizer`, as far as it is asked here."""

    comparison_: Comparison
    references_: References
    classifier_: Classifier

    def calibration(self) -> Calibration:
        """Return the calibration of the p-values."""
        ...

    def calibration_of_kernels(self) -> Calibration:
        """Return the calibration of p-values by the kernels alone."""
        ...


@dataclass(frozen=True, eq=False)
class KnownClasses:
    """Everything that recognizes movements as one of C classes, or as unknown."""

    comparison: Comparison
    references: References  # the labeled movements
    classifier: Classifier
    calibration: Calibration  # of the p-values

    def recognize(self, movements: MovementsLike, error_rate: float = 0.05) -> list[Answer]:
        """Return an answer for each movement, see `kineme.Recognizer.recognize`."""
        check_error_rate(error_rate)
        comparison, references = self.comparison, self.references
        demos = comparison.checked(movements)
        parts: dict[int, list[Answer]] = {}

        def answer(rows: slice, compared: Compared) -> None:
            verdicts = verdicts_of(compared, self.classifier, self.calibration, error_rate)
            some = demos[rows]  # a copy, which is kept: callers may use their arrays again
            parts[rows.start] = answers_of(verdicts, comparison, references.demonstrations, some)

        for_compared(comparison, references, demos, answer)
        return [each for start in sorted(parts) for each in parts[start]]

    def labels(self, movements: Demonstrations | Described, error_rate: float) -> tuple[NDArray[Any], Array]:
        """Return labels (n,) as from `known_labels`, and p-values (n, C) of movements in the coordinates learned."""
        check_error_rate(error_rate)
        by = self.classifier.nearest_logs, self.classifier.scores
        similarities, scores = score(self.comparison, self.references, movements, *by)
        p_values = self.calibration.p_values(similarities, error_rate)
        p_known = self.calibration.known_p_values(similarities, error_rate)
        classes = self.references.classes
        return known_labels(self.classifier, classes, scores, p_values, p_known, error_rate), p_values


def known_classes(symbols: FittedRecognizer | MovementsLike) -> KnownClasses:
    """Return the records of a fitted recognizer, or the default kernels fitted to labeled movements.

    Raises `sklearn.exceptions.NotFittedError` (a recognizer that is not fitted) and `TrajectoryError` (movements
    without labels).
    """
    if hasattr(symbols, "calibration"):
        fitted = cast(FittedRecognizer, symbols)
        calibration = fitted.calibration()  # first: it refuses a recognizer that is not fitted
        return KnownClasses(fitted.comparison_, fitted.references_, fitted.classifier_, calibration)
    demos = Demonstrations.of(symbols)
    return fit_known_classes(*fit_comparison(ComparisonSpecification(), demos, check_labels(demos, None)), KERNELS)


def fit_known_classes(
    comparison: Comparison,
    references: References,
    classifier: str,
    groups: NDArray[np.intp] | None = None,
    calibrated: Calibrates = calibrate,
) -> KnownClasses:
    """Fit a classifier to references; `groups` as in `kineme.Recognizer.fit`; `calibrated` may keep calibrations."""
    with single_threaded_blas():  # products of few rows: a second thread waits for most of the time, and in the way
        fitted = fit_classifier(classifier, comparison, references, groups)
        calibration = calibrated(comparison.similarity, references, groups, fitted)
    return KnownClasses(comparison, references, fitted, calibration)


def open_set_labels(classes: KnownClasses, described: Described, error_rate: float) -> tuple[NDArray[Any], Array]:
    """Return `KnownClasses.labels` by those who showed some."""
    return replace(classes, calibration=classes.calibration.of_those_shown()).labels(described, error_rate)
