"""The recognizer: a scikit-learn classifier of movements that needs one demonstration of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from kineme.comparison.describe import tile_movements, view, view_tile
from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import DEFAULT_REPRESENTATIONS, Representation, check_representations
from kineme.comparison.similarity import LOG_MEANS, AveragedSimilarity, impostor_widths
from kineme.comparison.weights import CANDIDATES, chosen_weights, given_weights, suffices
from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.classifiers import CLASSIFIERS, Classifier, Nearest, choose
from kineme.recognition.conformal import Calibration, calibrate, check_error_rate
from kineme.recognition.labels import check_labels
from kineme.runtime.parallel import for_tiles, single_threaded_blas
from kineme.validation import Array, check_choice, check_number

_TILE_PAIRS = 1_000_000  # similarities at a time: memory stays linear in the stored movements


class Recognizer(ClassifierMixin, BaseEstimator):
    """Recognize movements by an average of kernels over several representations.

    Parameters
    ----------
    representations : tuple of Representation, optional
        By default positions over arc length, forcing term over arc length, forcing term over time; where `weights`
        are chosen, also positions over time and both over a blend of time and arc length.
    max_angle : float, optional
        Largest rotation [rad] between movements of one kind; by default pi/3 in two and three dimensions, else 0. Each
        invariance merges something: pi merges N and Z, more than a right angle V and caret.
    scale : {"path", "per-dimension", "none"}, default "path"
        What of the size is taken out, see `Normalization`. "path" merges a dot and a circle.
    translation : bool, default True
        Take out the place.
    cutoff : float or None, default 10.0
        Smooth below this many cycles per movement first, see `Smooth`; None for recordings without noise.
    mean : {"arithmetic", "geometric", "harmonic", "quadratic", "min"}, default "arithmetic"
        The A-average over representations.
    weights : {"auto", "equal"} or sequence of R numbers, default "auto"
        Of the representations in the arithmetic mean. "auto" chooses them on the training movements from eight of every
        class on, see `chosen_weights`; with fewer, or with another mean, they are equal.
    classifier : {"auto", "nearest", "prototype", "svm"}, default "auto"
        "nearest" stored movement, nearest class "prototype" (its medoid), or an "svm" on the averaged kernel. "auto" is
        the SVM from eight demonstrations of every class on, up to 4000 in all, else the nearest.

    Attributes
    ----------
    classes_ : ndarray of shape (C,)
        Labels, sorted.
    demonstrations_ : Demonstrations
        The training movements, ordered by class.
    representations_ : tuple of R Representation
        Those that speak.
    weights_ : ndarray of shape (R,)
        How loudly; they sum to 1.
    widths_ : ndarray of shape (R,)
        Kernel width of each representation.
    n_dims_ : int

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
    ) -> None:
        self.representations = representations
        self.max_angle = max_angle
        self.scale = scale
        self.translation = translation
        self.cutoff = cutoff
        self.mean = mean
        self.classifier = classifier
        self.weights = weights

    def fit(self, X: Any, y: Any = None) -> Self:
        """Store the demonstrations as the recognizer sees them.

        Parameters
        ----------
        X : movements
            Whatever `Demonstrations.of` accepts.
        y : array_like of shape (n,), optional
            Labels; by default those of the demonstrations.
        """
        check_choice("mean", self.mean, list(LOG_MEANS))
        check_choice("classifier", self.classifier, ["auto", *CLASSIFIERS])
        Normalization(self.translation, self.scale)  # checks its own parameters
        if self.cutoff is not None:
            Smooth(self.cutoff)  # checks its own parameter
        demos = Demonstrations.of(X)
        labels = check_labels(demos, y)
        self.n_dims_ = demos.n_dims
        self.procrustes_ = Procrustes(demos.n_dims, self._angle(demos.n_dims))
        order = np.argsort(labels, kind="stable")
        self.classes_, first = np.unique(labels[order], return_index=True)
        self.demonstrations_ = demos[order]
        self.labels_ = labels[order]
        self.first_ = first  # of each class, in the order of the demonstrations
        per_class = np.diff(first, append=len(labels))
        with single_threaded_blas():  # products of few rows: a second thread waits for most of the time, and in the way
            self._choose_representations(per_class)
        self.classifier_: Classifier = choose(self.classifier, per_class)
        self.classifier_.fit(self)
        self.calibration_: Calibration | None = None  # these two are made when first asked for
        self.hypotheses_: dict[Any, Any] = {}
        return self

    def log_similarity(self, X: Any) -> Array:
        """Logarithms of the averaged kernel to the stored demonstrations, shape (n, m)."""
        check_is_fitted(self)
        return self.similarity_.log_average(self.look_at(X), self.views_)

    def look_at(self, X: Any) -> tuple[Prepared, ...]:
        """Movements as rows per representation, ready to be compared with the stored ones."""
        return self._view(self._checked(X))

    def decision_function(self, X: Any) -> Array:
        """Score of each class, shape (n, C): larger is more like it; scales depend on the classifier."""
        check_is_fitted(self)
        return self._scored(X, self.classifier_)

    def predict(self, X: Any) -> NDArray[Any]:
        """The most similar class of each movement, shape (n,)."""
        return np.asarray(self.classes_[self.decision_function(X).argmax(axis=1)])

    def predict_proba(self, X: Any) -> Array:
        """Each class's share of the similarity, shape (n, C); rows sum to 1.

        A ranking made comparable, not a calibrated probability; `recognize` gives p-values, and says whether those are
        calibrated.
        """
        scores = self.decision_function(X)
        shares = np.exp(scores - scores.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))

    def score(self, X: Any, y: Any = None, sample_weight: Any = None) -> float:
        """Share of movements recognized as what they are; labels `y` are by default those of the demonstrations."""
        demos = Demonstrations.of(X)
        return float(super().score(demos, check_labels(demos, y), sample_weight))

    def recognize(self, X: Any, error_rate: float = 0.05) -> Any:
        """What each movement is, or that it is unknown, and why.

        Parameters
        ----------
        X : one movement or many
            A `Trajectory` or an array (T, d) is one; else whatever `Demonstrations.of` accepts.
        error_rate : float, default 0.05
            Share of true movements that may be called unknown. It is kept where the answer is `calibrated`, which
            takes at least ``1 / error_rate - 1`` demonstrations of classes shown twice or more. With one demonstration
            of each class p-values are a guess, and the share may be anything; see `Calibration`.

        Returns
        -------
        Answer, or list of Answer for many movements
        """
        from kineme.recognition.answer import answers, is_one

        found = answers(self, [X] if is_one(X) else X, error_rate)
        return found[0] if is_one(X) else found

    def p_values(self, X: Any, error_rate: float = 0.05) -> Array:
        """Conformal p-value of each movement for each class, shape (n, C), fine enough to tell `error_rate`.

        With one demonstration of each class they are a guess, not a promise: ``calibration().calibrated(error_rate)``
        tells which classes keep the rate, see `Calibration`.
        """
        check_error_rate(error_rate)
        return self.calibration().p_values(self._nearest(X), error_rate)

    def predict_known(self, X: Any, error_rate: float = 0.05) -> NDArray[Any]:
        """Labels as from `predict`, among classes with a p-value above `error_rate`; None, unknown, without any."""
        from kineme.recognition.answer import known_labels

        p_values = self.p_values(X, error_rate)
        return known_labels(self.classes_, self.decision_function(X), p_values, error_rate)

    def novelty(self, X: Any) -> Array:
        """Smallest nonconformity to any class, shape (n,): the larger, the less it is any known movement."""
        return np.asarray(self.calibration().scores(self._nearest(X)).min(axis=1))

    def calibration(self) -> Calibration:
        """Of the p-values; made when first asked for, since it compares the demonstrations with each other."""
        check_is_fitted(self)
        if self.calibration_ is None:
            self.calibration_ = calibrate(self)
        return self.calibration_

    def looks(self) -> tuple[Representation, ...]:
        """The representations that speak."""
        check_is_fitted(self)
        return self.representations_

    def spot(self, recording: Any, error_rate: float = 0.05, max_pieces: int = 8) -> list[Any]:
        """Find known movements in one long recording, with unknown between them.

        The recording is cut finely, at rests and at minima of speed; every run of neighbors is a candidate, all
        are recognized in one batch, and the chain of candidates that do not overlap with the largest summed score is
        chosen. A candidate of similarity K scores its duration times ``1 - log K / log K_impostor``, less a fixed cost.

        Parameters
        ----------
        recording : Trajectory or array_like of shape (T, d)
            Unlabeled; pass a `Trajectory`, the time stamps matter.
        error_rate : float, default 0.05
            Share of true movements that may be called unknown. Cutting adds errors of its own, and fewer than
            ``1 / error_rate - 1`` demonstrations cannot tell so small a share.
        max_pieces : int, default 8
            Most pieces that one movement may consist of; cost grows with it.

        Returns
        -------
        list of Spotted
            ``(start, end, label, confidence)`` in order of time; label None is motion of no known kind. Rests are left
            out. A movement is looked for between a third and three times the durations demonstrated for it.
        """
        from kineme.recognition.spotting import spot

        check_is_fitted(self)
        return list(spot(self, recording, error_rate, max_pieces))

    def predict_partial(self, X: Any, early: Any = None) -> NDArray[Any]:
        """The most likely class of each movement of which only the beginning has been seen, shape (n,).

        Each beginning is compared with the beginnings of every stored movement at many values of progress; see `Early`.
        """
        from kineme.recognition.early.early import partial_shares

        check_is_fitted(self)
        return np.asarray(self.classes_[partial_shares(self, X, early)[:, :-1].argmax(axis=1)])

    def stream(self, confidence: float = 0.9, patience: float = 0.05, early: Any = None) -> Any:
        """Recognize a movement while it is under way: `Live`, whose ``update(t, x)`` takes each sample.

        Parameters
        ----------
        confidence : float, default 0.9
            Share of the evidence at which a label is decided.
        patience : float, default 0.05
            How long it must be held, as a share of the time so far.
        early : Early, optional
            How much size, duration and timing may vary.
        """
        from kineme.recognition.early.decision import Decision
        from kineme.recognition.early.hypotheses import as_early
        from kineme.recognition.early.stream import Live

        check_is_fitted(self)
        return Live(self, Decision(confidence, patience), as_early(early))

    def over(self, stored: Any, labels: NDArray[Any], views: tuple[Prepared, ...], calibration: Calibration) -> Self:
        """A recognizer that compares in the same way, by the nearest, with other movements that were seen already.

        Parameters
        ----------
        stored : Demonstrations
            Ordered by class; or what gives them when indexed by an array.
        labels : ndarray of shape (m,)
            Sorted.
        views : tuple of R Prepared
            Their rows.
        calibration : Calibration
            Of their classes, in order.
        """
        new = copy(self)
        new.demonstrations_, new.labels_, new.views_, new.calibration_ = stored, labels, views, calibration
        new.classes_, new.first_ = np.unique(labels, return_index=True)
        new.classifier_ = Nearest()
        new.hypotheses_ = {}
        return new

    def _choose_representations(self, per_class: NDArray[Any]) -> None:
        """Look at the demonstrations, set the widths and the weights, and keep the representations with weight."""
        choosing = self._chooses(per_class)
        given = CANDIDATES if choosing else DEFAULT_REPRESENTATIONS
        looks = given if self.representations is None else check_representations(self.representations)
        self.representations_ = looks
        views = self._view(self.demonstrations_)
        widths = impostor_widths(self.procrustes_, views, self.labels_)
        weights = np.full(len(looks), 1.0 / len(looks))
        if choosing:
            n_usual = len(looks) if self.representations is not None else len(DEFAULT_REPRESENTATIONS)
            equal = AveragedSimilarity(self.procrustes_, widths)
            weights = chosen_weights(equal, views, self.labels_, n_usual)
        elif not isinstance(self.weights, str):
            weights = given_weights(self.weights, len(looks))
        kept = np.flatnonzero(weights)
        self.representations_ = tuple(looks[r] for r in kept)
        self.views_ = tuple(views[r] for r in kept)
        self.widths_, self.weights_ = widths[kept], weights[kept]
        self.similarity_ = AveragedSimilarity(self.procrustes_, self.widths_, self.mean, self.weights_)

    def _chooses(self, per_class: NDArray[Any]) -> bool:
        """Whether the weights are chosen on these movements."""
        if isinstance(self.weights, str):
            check_choice("weights", self.weights, ["auto", "equal"])
        elif self.mean != "arithmetic":
            raise SpecificationError(f"expected weights with mean='arithmetic', got them with mean={self.mean!r}")
        return (
            isinstance(self.weights, str)
            and self.weights == "auto"
            and self.mean == "arithmetic"
            and suffices(per_class)
        )

    def _angle(self, n_dims: int) -> float:
        if self.max_angle is not None:
            check_number("max_angle", self.max_angle, least=0.0)
            return float(self.max_angle)
        return math.pi / 3 if n_dims in (2, 3) else 0.0

    def _view(self, demos: Demonstrations) -> tuple[Prepared, ...]:
        return self._prepared(view(demos, self.looks(), Normalization(self.translation, self.scale), self.cutoff))

    def _prepared(self, seen: tuple[Array, ...]) -> tuple[Prepared, ...]:
        # Single precision: comparing with many stored movements is bound by memory, and widths are far above its error.
        return tuple(self.procrustes_.prepare(block.astype(np.float32)) for block in seen)

    def _nearest(self, X: Any) -> Array:
        """Log similarity to the nearest demonstration of each class, shape (n, C)."""
        return self._scored(X, Nearest())

    def _scored(self, X: Any, classifier: Classifier) -> Array:
        """Scores (n, C), tile by tile: what is seen of a movement is compared before it leaves the core's cache."""
        demos = self._checked(X)
        normalization = Normalization(self.translation, self.scale)
        scores = np.empty((len(demos), len(self.classes_)))

        def score(start: int, stop: int) -> None:
            seen = view_tile(demos, start, stop, self.looks(), normalization, self.cutoff)
            scores[start:stop] = classifier.scores(self, self._prepared(seen))

        for_tiles(score, len(demos), min(tile_movements(demos.n_dims), max(1, _TILE_PAIRS // len(self.labels_))))
        return scores

    def _checked(self, X: Any) -> Demonstrations:
        check_is_fitted(self)
        demos = Demonstrations.of(X)
        if demos.n_dims != self.n_dims_:
            raise TrajectoryError(
                f"expected movements of {self.n_dims_} dimensions as in fit, got {demos.n_dims}; select the dimensions"
            )
        return demos

    def _tiles(self, seen: tuple[Prepared, ...]) -> Iterator[tuple[Prepared, ...]]:
        n, step = len(seen[0].rows), max(1, _TILE_PAIRS // len(self.labels_))
        for start in range(0, n, step):
            yield tuple(one.take(slice(start, start + step)) for one in seen)
