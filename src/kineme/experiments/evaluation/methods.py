"""The recognizers that are compared: one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from kineme.experiments.evaluation.generative import HiddenMarkov
from kineme.experiments.evaluation.linear_classifiers import AlignmentSVM, MiniRocket
from kineme.experiments.evaluation.neighbors import DTWNeighbor, EuclideanNeighbor, PaperFeatures, PointCloud
from kineme.experiments.evaluation.optional import why_missing
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.recognizer import Recognizer
from kineme.validation import Array


class Contender(Protocol):
    """A method that was made for one trial."""

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        ...

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """The class of each movement, and its familiarity: larger is more like the training movements; (n,) each."""
        ...


class Options(NamedTuple):
    """What a protocol passes to every method; a method ignores what it cannot use."""

    max_angle: float | None = None
    seed: int = 0


@dataclass(frozen=True)
class Method:
    """One row of `METHODS`.

    Attributes
    ----------
    title : str
        Name in the tables.
    make : callable
        Options -> contender.
    needs : str
        Optional module that the method imports; "" for none.
    only_dims : int or None
        The only number of dimensions that it works in.
    slow : bool
        Runs only at the reference strength of protocols that have several strengths.
    """

    title: str
    make: Callable[[Options], Contender]
    needs: str = ""
    only_dims: int | None = None
    slow: bool = False

    def unavailable(self, n_dims: int) -> str:
        """Why the method cannot take part, or ""."""
        if self.only_dims not in (None, n_dims):
            return f"works in {self.only_dims} dimensions only"
        return why_missing(self.needs) if self.needs else ""


class DefaultRecognizer:
    """`Recognizer` with its defaults; the familiarity is its `novelty`, negated."""

    def __init__(self, max_angle: float | None) -> None:
        self.recognizer = Recognizer(max_angle=max_angle)

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        self.recognizer.fit(demonstrations)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and familiarity of each movement."""
        return self.recognizer.predict(demonstrations), -self.recognizer.novelty(demonstrations)

    def classify_partial(self, demonstrations: Demonstrations) -> NDArray[Any]:
        """Class of each movement of which only the beginning is given."""
        return self.recognizer.predict_partial(demonstrations)


OURS = "kineme"

#: The paper's configuration is 1-NN on the shape-attractor of the original, or on f of the bio-inspired formulation.
METHODS: dict[str, Method] = {
    OURS: Method("kineme, defaults", lambda options: DefaultRecognizer(options.max_angle)),
    "paper": Method("paper, original form", lambda _: PaperFeatures("original", "shape-attractor")),
    "paper-bio": Method("paper, bio-inspired form", lambda _: PaperFeatures("bio-inspired", "forcing")),
    "euclidean": Method("Euclidean 1-NN", lambda _: EuclideanNeighbor()),
    "dtw": Method("DTW 1-NN", lambda _: DTWNeighbor(), needs="dtaidistance.dtw_ndim"),
    "gak-svm": Method("GAK-SVM", lambda options: AlignmentSVM(options.seed), needs="tslearn.metrics"),
    "minirocket": Method(
        "MiniRocket + ridge", lambda options: MiniRocket(options.seed), needs="aeon.classification.convolution_based"
    ),
    "point-cloud": Method("$P point cloud", lambda _: PointCloud(), needs="dollarpy", only_dims=2, slow=True),
    "hmm": Method("HMM", lambda options: HiddenMarkov(options.seed), needs="hmmlearn.hmm"),
}
