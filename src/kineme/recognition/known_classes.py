"""Known classes as records: the comparison, the references, a classifier and its calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.answer import Answer, answers, known_labels
from kineme.recognition.classifiers import Classifier, fit_classifier
from kineme.recognition.conformal import Calibration, calibrate, check_error_rate
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.comparison import Comparison, fit_comparison, fit_to_references
from kineme.similarity.described import Described
from kineme.similarity.references import References
from kineme.similarity.scores import nearest, score
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.validation import Array

#: What calibrates references, as `calibrate` does.
Calibrates = Callable[[AveragedSimilarity, References, NDArray[np.intp] | None], Calibration]


class FittedRecognizer(Protocol):
    """A fitted `kineme.Recognizer`, as far as it is asked here."""

    comparison_: Comparison
    references_: References
    classifier_: Classifier

    def calibration(self) -> Calibration:
        """Return the calibration of the p-values."""
        ...


@dataclass(frozen=True, eq=False)
class KnownClasses:
    """Everything that recognizes movements as one of C classes, or as unknown.

    Attributes
    ----------
    comparison : Comparison
    references : References
        The labeled movements.
    classifier : Classifier
    calibration : Calibration
        Of the p-values.
    """

    comparison: Comparison
    references: References
    classifier: Classifier
    calibration: Calibration

    def recognize(self, movements: MovementsLike, error_rate: float = 0.05) -> list[Answer]:
        """Return an answer for each movement, see `kineme.Recognizer.recognize`."""
        check_error_rate(error_rate)
        demos = self.comparison.checked(movements)
        return answers(self.comparison, self.references, self.classifier, self.calibration, demos, error_rate)


def known_classes(symbols: FittedRecognizer | MovementsLike) -> KnownClasses:
    """Return the records of a fitted recognizer, or those fitted to labeled movements with the default parameters.

    Raises `sklearn.exceptions.NotFittedError` (a recognizer that is not fitted) and `TrajectoryError` (movements
    without labels).
    """
    if hasattr(symbols, "calibration"):
        fitted = cast(FittedRecognizer, symbols)
        calibration = fitted.calibration()  # first: it refuses a recognizer that is not fitted
        return KnownClasses(fitted.comparison_, fitted.references_, fitted.classifier_, calibration)
    demos = Demonstrations.of(symbols)
    labels = check_labels(demos, None)
    return _known(*fit_comparison(ComparisonSpecification(), demos, labels), "auto")


def fit_known_classes(  # noqa: PLR0913, PLR0917 - what a recognizer is made of
    specification: ComparisonSpecification,
    references: References,
    weights: str | Sequence[float] = "auto",
    classifier: str = "auto",
    groups: NDArray[np.intp] | None = None,
    channels: Channels | None = None,
    calibrated: Calibrates = calibrate,
) -> KnownClasses:
    """Fit to references that are described already, see `kineme.similarity.comparison.fit_to_references`.

    With `groups`, such as people, each a number, the calibration compares no reference with another of its group.
    `channels` are what was recorded of the movements, where that is known. `calibrated` may keep calibrations.
    """
    return _known(*fit_to_references(specification, references, weights, channels), classifier, groups, calibrated)


def _known(
    comparison: Comparison,
    references: References,
    classifier: str,
    groups: NDArray[np.intp] | None = None,
    calibrated: Calibrates = calibrate,
) -> KnownClasses:
    with single_threaded_blas():  # products of few rows: a second thread waits for most of the time, and in the way
        fitted = fit_classifier(classifier, comparison, references)
        calibration = calibrated(comparison.similarity, references, groups)
    return KnownClasses(comparison, references, fitted, calibration)


def open_set_labels(
    classes: KnownClasses, described: Described, error_rate: float = 0.05
) -> tuple[NDArray[np.object_], Array]:
    """Return the class of each described movement by those who showed some, and its p-values.

    Returns `labels`: the best class with a p-value above `error_rate`; None, unknown, as in
    `Calibration.known_p_values`; `p_values` (n, C).
    """
    check_error_rate(error_rate)
    similarities, scores = score(classes.comparison, classes.references, described, nearest, classes.classifier.scores)
    p_values = classes.calibration.p_values(similarities, error_rate)
    calibration = classes.calibration.of_those_shown()
    labels = known_labels(classes.references.classes, scores, similarities, calibration, error_rate)
    return labels, p_values
