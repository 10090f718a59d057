"""The recognizer: a scikit-learn classifier of movements that needs one demonstration of each."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from kineme.errors import TrajectoryError
from kineme.kernels.rotation import RotationPrior
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.labels import spelled_alike
from kineme.movements.trajectories.trajectory import HasDemonstrations, MovementLike, MovementsLike, Trajectory
from kineme.recognition.answer import Answer, is_one, known_classes
from kineme.recognition.classifiers import BY_CONVOLUTIONS, CLASSIFIERS, NearestProfiled, SupportVectors, fit_classifier
from kineme.recognition.conformal import Calibration, calibrate, check_error_rate, check_groups, class_probabilities
from kineme.reporting.table import to_html
from kineme.reporting.text import in_markup
from kineme.runtime.compiled import load_compiled
from kineme.similarity.comparison import Comparison, References, fit_comparison
from kineme.similarity.describe import Described
from kineme.similarity.scores import Compared, Score, for_compared, score
from kineme.similarity.specification import (
    ComparisonSpecification,
    Normalization,
    Representation,
    default_representations,
    softmax,
)
from kineme.validation import Array, check_choice

if TYPE_CHECKING:
    from kineme.recognition.early.hypotheses import Early, Hypotheses
    from kineme.recognition.early.stream import Live
    from kineme.recognition.spotting import Spotted

_NUMBERS = (4, 30, 200)  # of movements: little work and much are compiled apart
_SAMPLES = 1000

_PRIOR = RotationPrior()


class Recognizer(ClassifierMixin, BaseEstimator):
    """Recognize movements by an average of kernels over several representations.

    Parameters
    ----------
    representations : tuple of Representation, optional
        By default positions over arc length, forcing term over time, elastic path, turning angles, and point cloud;
        elastic path and point cloud once more, in detail, see `Representation`; with ``translation=False`` or
        ``scale="none"`` positions over arc length, and the forcing term over arc length and over time.
    max_angle : float, optional
        Largest rotation [rad] between movements of one class, instead of the `rotation_prior`; 0 for none. With pi, N
        and Z become equal; above a right angle, V and caret.
    scale : {"path", "per-dimension", "none"}, default "path"
        Normalization of the size, see `Normalization`. With "path", a dot and a circle become equal.
    translation : bool, default True
        Whether translation is taken out. Of signals and sensors "auto" counts the recorded values apart.
    cutoff : float or None, default 10.0
        Smooth below this many cycles per movement first, see `Smooth`; None for recordings without noise.
    mean : {"arithmetic", "geometric", "harmonic", "quadratic", "min"}, default "arithmetic"
        The A-average over representations.
    weights : {"auto", "own", "equal", "fitted"} or sequence of R numbers, default "auto"
        Of the representations in the arithmetic mean. "own": their own; "fitted": half their own, half fitted to the
        training movements, see `kineme.similarity.similarity.fitted_weights`; "auto": "fitted" where a class has two
        movements and there are two classes, else "own".
    classifier : {"auto", "nearest", "nearest-each", "prototype", "svm", "convolutions"}, default "auto"
        "nearest" stored movement, "nearest-each", where each representation has its own nearest stored movement of a
        class, nearest class "prototype" (its medoid), an "svm" on the averaged kernel, or a ridge regression on random
        "convolutions" of the path. "auto" is "nearest-each", of signals and of more than three columns that are no
        points with profiles of random convolutions and recorded values beside it, see `NearestProfiled`; from two
        demonstrations of each class on all are pooled with "convolutions", see `LogarithmicPool`, unless the kernels
        recognize practically all that are left out. Whether a movement is known is told without what is pooled, see
        `kineme.recognition.answer.known_labels`.
    rotation_prior : RotationPrior or None
        How rare rotations between movements of one class are, in two and three dimensions, where there is no
        `max_angle`: one or the other can be given. By default a rotation by a right angle costs 0.06 of the inner
        product of two equal paths in the plane and 0.2 in space, and none is forbidden; what is compared in detail is
        not rotated, which any other prior and a `max_angle` change. Pass ``RotationPrior(vertical=(0, 0, 1))`` for
        movements that are turned about the vertical, and rarely tilted. None forbids rotations beyond pi/3 and costs
        nothing below.
    points : int, optional
        How many points in the plane or in space the columns are, one after the other: hands, markers, joints of a body.
        They turn and scale as one. By default they are those that the names of columns tell, such as ``left_hand_x,
        left_hand_y, left_hand_z, right_hand_x, ...``; 1 compares columns that are not rotated.

    Attributes
    ----------
    classes_ : ndarray of shape (C,)
        Labels, sorted.
    demonstrations_ : Demonstrations
        The training movements, ordered by class.
    representations_ : tuple of R Representation
        Those with a weight above 0, and positions over arc length if pairs are rotated by them.
    weights_ : ndarray of shape (R,)
        Their weights in the average; they sum to 1.
    widths_ : ndarray of shape (R,)
        Their kernel widths.
    n_dims_ : int
        Dimensions of the movements.
    n_points_ : int
        Points that turn together, by `points` or by the names of columns; 1 of other movements.
    channels_ : tuple of Channel or None
        What was recorded of the movements; None if that is not known. Movements to be recognized are converted by them.
    comparison_ : Comparison
    references_ : References

    Examples
    --------
    >>> import kineme
    >>> demos = kineme.load_lasa()
    >>> one_shot = kineme.Recognizer().fit(demos[::7])
    >>> float(one_shot.score(demos, demos.labels))
    1.0
    """

    def __init__(  # noqa: PLR0913, PLR0917 - one parameter per choice, as scikit-learn's searches need them
        self,
        representations: tuple[Representation, ...] | None = None,
        max_angle: float | None = None,
        scale: str = "path",
        translation: bool = True,
        cutoff: float | None = 10.0,
        mean: str = "arithmetic",
        classifier: str = "auto",
        weights: str | Sequence[float] = "auto",
        rotation_prior: RotationPrior | None = _PRIOR,
        points: int | None = None,
    ) -> None:
        self.representations = representations
        self.max_angle = max_angle
        self.scale = scale
        self.translation = translation
        self.cutoff = cutoff
        self.mean = mean
        self.classifier = classifier
        self.weights = weights
        self.rotation_prior = rotation_prior
        self.points = points

    @property
    def specification(self) -> ComparisonSpecification:
        """Specification of the comparison, by the parameters alone."""
        given, normalization = self.representations, Normalization(self.translation, self.scale)
        return ComparisonSpecification(
            default_representations(normalization) if given is None else given,
            normalization,
            self.cutoff,
            self.max_angle,
            self.mean,
            self.rotation_prior,
            self.points,
        )

    def fit(self, X: MovementsLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Self:
        """Describe and store the demonstrations.

        Parameters
        ----------
        X : movements
            Whatever `Demonstrations.of` accepts.
        y : array_like of shape (n,), optional
            Labels; by default those of the demonstrations.
        groups : array_like of shape (n,), optional
            Who did each movement, or what else makes some more alike than new ones will be. The calibration of the
            unknown then compares no demonstration with another of its group, so that it holds for people who showed
            nothing. Without, it holds for more movements by the same people.

        Raises
        ------
        SpecificationError
            A parameter out of its range, demonstrations that are all the same, or an SVM of one class.
        TrajectoryError
            Not one label, or not one group, for each movement.
        """
        specification = self.specification
        check_choice("classifier", self.classifier, ["auto", *CLASSIFIERS])
        demos = Demonstrations.of(X)
        labels = check_labels(demos, y)
        order = np.argsort(labels, kind="stable")
        numbers = None if groups is None else check_groups(groups, len(demos))[order]
        comparison, references = fit_comparison(specification, demos, labels, self.weights)
        classifier = fit_classifier(self.classifier, comparison, references, numbers)
        # All at once: where a fit is refused, what was fitted before goes on as it was.
        self.comparison_, self.references_, self.classifier_ = comparison, references, classifier
        self._groups: NDArray[np.intp] | None = numbers
        self._calibration: Calibration | None = None  # these three are made when first asked for
        self._of_kernels: Calibration | None = None
        self._hypotheses: tuple[Early, Hypotheses] | None = None
        return self

    def _repr_html_(self) -> str:
        """Show a picture and a row for each class in a notebook; before it is fitted, its parameters."""
        if not hasattr(self, "references_"):
            return f"<pre>{in_markup(repr(self))}</pre>"
        return to_html(self.demonstrations_.by_label(repr(self)))

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        """Show the classes where scikit-learn would show a diagram of one box."""
        return {"text/plain": repr(self), "text/html": self._repr_html_()}

    @property
    def classes_(self) -> NDArray[Any]:
        """Labels, sorted, (C,)."""
        return self._fitted[1].classes

    @property
    def demonstrations_(self) -> Demonstrations:
        """The training movements with their labels, ordered by class."""
        return self._fitted[1].all_movements()

    @property
    def representations_(self) -> tuple[Representation, ...]:
        """The representations that movements are compared in."""
        return self._fitted[0].representations

    @property
    def weights_(self) -> NDArray[Any]:
        """Their weights, (R,), summing to 1."""
        return np.asarray(self._fitted[0].similarity.weights)

    @property
    def widths_(self) -> Array:
        """Their kernel widths, (R,)."""
        return self._fitted[0].similarity.widths

    @property
    def n_dims_(self) -> int:
        """Number of dimensions of the movements."""
        return self._fitted[0].n_dims

    @property
    def n_points_(self) -> int:
        """Number of points that turn together, J."""
        return self._fitted[0].procrustes.n_points

    @property
    def channels_(self) -> Channels | None:
        """Channels of the movements, which are expected of those to be recognized; None if they are not known."""
        return self._fitted[0].channels

    def describe(self, X: MovementsLike) -> Described:
        """Return movements described as the stored ones are, ready to be compared with them."""
        comparison, _ = self._fitted
        return comparison.describe(comparison.checked(X))

    def log_similarity(self, X: MovementsLike) -> Array:
        """Return the logarithms of the averaged kernel to the stored demonstrations, shape (n, m)."""
        comparison, references = self._fitted
        return comparison.similarity.log_average(self.describe(X), references.described)

    def decision_function(self, X: MovementsLike) -> Array:
        """Return the score of each class, shape (n, C): larger is more like it. Scales depend on the classifier.

        Of two classes, shape (n,): the score of ``classes_[1]`` minus that of ``classes_[0]``.
        """
        scores = self._scores(X)
        return scores[:, 1] - scores[:, 0] if scores.shape[1] == 2 else scores

    def predict(self, X: MovementsLike) -> NDArray[Any]:
        """Return the class with the largest score of each movement, shape (n,)."""
        comparison, references = self._fitted
        demos = comparison.checked(X)
        best = np.empty(len(demos), np.intp)

        def fill(rows: slice, compared: Compared) -> None:
            best[rows] = self.classifier_.best(compared)

        for_compared(comparison, references, demos, fill)
        return np.asarray(references.classes[best])

    def predict_proba(self, X: MovementsLike) -> Array:
        """Return the probability of each class for movements of known classes, shape (n, C); rows sum to 1.

        The largest is that of `predict`. By the classifiers "nearest" and "nearest-each" they are those of
        `Answer.probabilities`, see `class_probabilities`; by "prototype" they follow in the same way from the distances
        to the prototypes; by "svm" they are a softmax of its scores, which nothing calibrates; by "convolutions" one as
        sharp as makes demonstrations that are left out most likely; where convolutions join the kernels, the normalized
        product of powers of both, see `LogarithmicPool`. `recognize` tells if a movement is known at all.
        """
        scores = self._scores(X)
        if isinstance(self.classifier_, BY_CONVOLUTIONS):
            return self.classifier_.probabilities(scores)
        if isinstance(self.classifier_, SupportVectors):
            return softmax(scores, axis=1)
        return class_probabilities(scores, self.calibration().exponent)

    def score(self, X: MovementsLike, y: ArrayLike | None = None, sample_weight: Any = None) -> float:
        """Return the share recognized as what they are; labels `y` are by default those of the demonstrations."""
        demos = Demonstrations.of(X)
        labels, answers = check_labels(demos, y), self.predict(demos)
        if isinstance(labels[0], str) != isinstance(answers[0], str):
            raise TrajectoryError(f"expected labels as those of fit, such as {answers[0]!r}, got {labels[0]!r}")
        if isinstance(answers[0], str):
            labels = spelled_alike(np.concatenate((answers, labels)))[len(answers) :]
        return float(np.average(answers == labels, weights=sample_weight))

    @overload
    def recognize(self, X: Trajectory | NDArray[Any], error_rate: float = 0.05) -> Answer: ...
    @overload
    def recognize(self, X: HasDemonstrations | Sequence[Any], error_rate: float = 0.05) -> list[Answer]: ...
    def recognize(self, X: Any, error_rate: float = 0.05) -> Answer | list[Answer]:
        """Recognize movements: label or unknown, confidence, and nearest demonstrations.

        Parameters
        ----------
        X : one movement or many
            A `Trajectory` or an array (T, d) is one; else whatever `Demonstrations.of` accepts.
        error_rate : float, default 0.05
            Share of known movements that may be called unknown. It holds if the answer is `calibrated`, which takes at
            least ``1 / error_rate - 1`` demonstrations of classes with two or more. With one demonstration of each
            class p-values are a guess, and the share may be anything; see `Calibration`. An answer's `rule` and
            `promise` say what it rests on.

        Returns
        -------
        Answer, or list of Answer for many movements
        """
        every = known_classes(self).recognize([X] if is_one(X) else X, error_rate)
        return every[0] if is_one(X) else every

    def p_values(self, X: MovementsLike, error_rate: float = 0.05) -> Array:
        """Return conformal p-value of each movement for each class, shape (n, C), fine enough to tell `error_rate`.

        With one demonstration of each class they are a guess: ``calibration().calibrated(error_rate)`` tells for which
        classes the rate holds, see `Calibration`.
        """
        check_error_rate(error_rate)
        return self.calibration().p_values(self._scores(X, self.classifier_.nearest_logs), error_rate)

    def predict_known(self, X: MovementsLike, error_rate: float = 0.05) -> NDArray[Any]:
        """Return labels as from `predict`, by kernels among the classes whose p-value is above `error_rate`.

        None, for unknown, if the movement is more novel than all but `error_rate` of the known ones, see `Calibration`.
        """
        known = known_classes(self)
        return known.labels(known.comparison.checked(X), error_rate)[0]

    def novelty(self, X: MovementsLike) -> Array:
        """Return the smallest nonconformity to any class, shape (n,): the larger, the less it is any known movement."""
        return np.asarray(self.calibration().scores(self._scores(X, self.classifier_.nearest_logs)).min(axis=1))

    def calibration(self) -> Calibration:
        """Return the calibration of the p-values; computed on first use, since it compares all demonstrations."""
        comparison, references = self._fitted
        calibration, groups = self._calibration, vars(self).get("_groups")
        if calibration is None:
            self._calibration = calibration = calibrate(comparison.similarity, references, groups, self.classifier_)
        return calibration

    def calibration_of_kernels(self) -> Calibration:
        """Return the calibration of p-values by the kernels alone: of what is spotted, and of a page."""
        comparison, references = self._fitted
        if not isinstance(getattr(self.classifier_, "nearest", self.classifier_), NearestProfiled):
            return self.calibration()
        calibration: Calibration | None = vars(self).get("_of_kernels")
        if calibration is None:
            self._of_kernels = calibration = calibrate(comparison.similarity, references, vars(self).get("_groups"))
        return calibration

    def spot(self, recording: MovementLike, error_rate: float = 0.05, max_pieces: int = 8) -> list[Spotted]:
        """Find known movements in one long recording, with unknown between them.

        Windows of the recording, from half the shortest demonstrated duration to three times the longest, are compared
        with all demonstrations. They start and end at rests, at minima of speed and, where these are far apart, at even
        times. Chosen is the chain of windows that do not overlap with the largest summed score; a window scores its
        duration, less the more it differs from the class: in the averaged kernel, and in duration and size, given the
        tempo and the size of the whole recording, which are estimated from what is found. Its class is that to which
        this window, or one that begins and ends nearly there, is nearest, as by ``classifier="nearest-each"``.

        Parameters
        ----------
        recording : Trajectory or array_like of shape (T, d)
            Unlabeled. An array counts as one second and is refused where the demonstrations have time stamps.
        error_rate : float, default 0.05
            The smaller, the more a movement may differ from the demonstrations. Not the share of movements that are
            missed: a movement in a recording is cut by the search itself, see `kineme.recognition.spotting`.
        max_pieces : int, default 8
            Most stretches between rests that one movement may consist of.

        Returns
        -------
        list of Spotted
            ``(start, end, label, confidence, p_known, uncertainty)`` in order of time; label None is motion of no known
            class. `confidence` and `p_known` are those of an `Answer`, the uncertainty is half of the 95 % interval of
            start and end [s]. Rests are left out. Without time stamps in fit,
            movements are looked for between a quarter of the typical stretch between rests and four times it.
        """
        from kineme.recognition.compared_windows import Templates
        from kineme.recognition.spotting import spot

        return spot(Templates(*self._fitted, self.calibration_of_kernels()), recording, error_rate, max_pieces)

    def predict_partial(self, X: MovementsLike, early: Early | None = None) -> NDArray[Any]:
        """Return the most likely class of each movement of which only the beginning is given, shape (n,).

        Each beginning is compared with the beginnings of every stored movement at many values of progress; see `Early`.
        """
        from kineme.recognition.early.evidence import partial_shares

        comparison, references = self._fitted
        shares = partial_shares(comparison, self._beginnings(early), X)
        return np.asarray(references.classes[shares[:, :-1].argmax(axis=1)])

    def stream(self, confidence: float = 0.9, patience: float = 0.05, early: Early | None = None) -> Live:
        """Recognize a movement while it is under way: `Live`, whose ``update(t, x)`` takes each sample.

        Parameters
        ----------
        confidence : float, default 0.9
            Share of the evidence at which a label is decided. At 0.9, about nine in ten of the labels decided before
            the end are right for people without demonstrations, more for people with some.
        patience : float, default 0.05
            How long it must be held, as a share of the time so far.
        early : Early, optional
            How much size, duration and timing may vary.
        """
        from kineme.recognition.early.stream import Decision, Live

        comparison, references = self._fitted
        beginnings = self._beginnings(early)
        # A copy: the answer at the end is that of this fit, also if the recognizer is fitted again meanwhile.
        return Live(comparison, references, beginnings, Decision(confidence, patience), copy(self).recognize)

    @property
    def _fitted(self) -> tuple[Comparison, References]:
        """Comparison and references of `fit`.

        Raises `sklearn.exceptions.NotFittedError`.
        """
        check_is_fitted(self, "comparison_")
        return self.comparison_, self.references_

    def _scores(self, X: MovementsLike, by: Score | None = None) -> Array:
        """Return the score of each class, shape (n, C), by the classifier or by a function of what is compared."""
        comparison, references = self._fitted
        return score(comparison, references, comparison.checked(X), by or self.classifier_.scores)[0]

    def _beginnings(self, early: Early | None) -> Hypotheses:
        """Return the beginnings of the demonstrations, kept from the last time that the same ones were asked for."""
        from kineme.recognition.early.hypotheses import as_early, hypotheses

        options = as_early(early)
        if self._hypotheses is None or self._hypotheses[0] != options:  # one at a time: memory stays linear
            self._hypotheses = options, hypotheses(*self._fitted, options)
        return self._hypotheses[1]


def warm_up(n_dims: Sequence[int] = (2, 3)) -> None:
    """Compile now what recognizing movements needs, instead of in the first call.

    It takes some twenty seconds on a free core, up to a minute on a busy one. Compiled functions are kept on disk, so
    that once a machine is enough, as when an image is built, and once after an update; later processes read them in a
    few seconds. If the environment variable ``KINEME_COMPILED`` is "never", nothing is compiled.

    Parameters
    ----------
    n_dims : sequence of int, default (2, 3)
        Dimensions of the movements that will be recognized; each number is compiled apart.

    Examples
    --------
    >>> import kineme
    >>> kineme.warm_up([2])
    """
    load_compiled()
    rng = np.random.default_rng(0)
    even = np.linspace(0, 1, _SAMPLES)
    waves = np.sin(np.pi * even[:, None] * np.arange(1, 5))
    for d in n_dims:
        for n in _NUMBERS:
            moved = waves[:: _SAMPLES // 50] @ rng.normal(size=(n, 4, d))
            recognizer = Recognizer().fit(moved, np.arange(n) // 2)
            recognizer.recognize(moved[:2])
            recognizer = Recognizer().fit(moved, np.arange(n))  # labels alone skip pairs, see `most_similar`
            recognizer.predict(moved)
        for times in (even, even**2):  # evenly timed and not, as recordings are
            timed = Demonstrations.from_arrays(waves @ rng.normal(size=(20, 4, d)), times=times)
            recognizer = Recognizer().fit(timed, np.arange(len(timed)) // 2)
            recognizer.predict_partial(timed)
            recognizer.spot(timed[0])
            recognizer.recognize(timed[0])
