"""The recognizers that are compared: one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring import propose
from kineme.experiments.evaluation.clouds import PlusCloud, PointCloud, QuickCloud
from kineme.experiments.evaluation.generative import HiddenMarkov
from kineme.experiments.evaluation.linear_classifiers import AlignmentSVM, MiniRocket
from kineme.experiments.evaluation.neighbors import DTWNeighbor, EuclideanNeighbor, PaperFeatures
from kineme.experiments.evaluation.optional import why_missing
from kineme.experiments.evaluation.spotting import Stretch
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.early.early import cut
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
    """What a protocol passes to every method; a method ignores what it cannot use.

    `people` (n,) made the training movements, where that is told.
    """

    max_angle: float | None = None
    seed: int = 0
    people: NDArray[Any] | None = None


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
    learns_beginnings : bool
        Whether it is given the beginnings of the training movements too where beginnings are to be classified.
    """

    title: str
    make: Callable[[Options], Contender]
    needs: str = ""
    learns_beginnings: bool = False

    def contender(self, options: Options, task: str = "classify") -> Contender:
        """A contender for a trial of that task."""
        made = self.make(options)
        return LearnsBeginnings(made) if self.learns_beginnings and task == "classify partial" else made

    def unavailable(self) -> str:
        """Why the method cannot take part, or ""."""
        return why_missing(self.needs) if self.needs else ""


class LearnsBeginnings:
    """A contender that also learns the beginnings of its training movements, so that it can classify beginnings."""

    def __init__(self, contender: Contender) -> None:
        self.contender = contender

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements and their beginnings."""
        parts = [one for share in _SHARES for one in cut(demonstrations, share)]
        labels = np.tile(require_labels(demonstrations), len(_SHARES))
        arrays, times = [one.positions for one in parts], [one.times for one in parts]
        self.contender.fit(Demonstrations.from_arrays(arrays, labels, times))

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """The class of each movement, and its familiarity."""
        return self.contender.classify(demonstrations)

    def classify_partial(self, demonstrations: Demonstrations) -> NDArray[Any]:
        """Class of each movement of which only the beginning is given."""
        return self.contender.classify(demonstrations)[0]


class DefaultRecognizer:
    """`Recognizer` with its defaults; the familiarity is its `novelty`, negated."""

    def __init__(self, max_angle: float | None, people: NDArray[Any] | None = None) -> None:
        self.recognizer = Recognizer(max_angle=max_angle)
        self.people = people

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        self.recognizer.fit(demonstrations, groups=self.people)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and familiarity of each movement."""
        return self.recognizer.predict(demonstrations), -self.recognizer.novelty(demonstrations)

    def classify_partial(self, demonstrations: Demonstrations) -> NDArray[Any]:
        """Class of each movement of which only the beginning is given."""
        return self.recognizer.predict_partial(demonstrations)

    def spot(self, recording: Trajectory) -> list[Stretch]:
        """The stretches of known classes in a recording."""
        return [Stretch(*one[:3]) for one in self.recognizer.spot(recording) if one.label is not None]

    def cluster(self, demonstrations: Demonstrations, n_clusters: int | None) -> NDArray[Any]:
        """Cluster of each movement, -1 for none."""
        return propose(demonstrations, n_clusters=n_clusters, like=self.recognizer).clusters


OURS = "kineme"
_SHARES = np.arange(3, 11) / 10  # of the path, of the beginnings that are learned

#: The paper's configuration is 1-NN on the shape-attractor of the original, or on f of the bio-inspired formulation.
METHODS: dict[str, Method] = {
    OURS: Method("kineme, defaults", lambda options: DefaultRecognizer(options.max_angle, options.people)),
    "paper": Method("paper, original form", lambda _: PaperFeatures("original", "shape-attractor")),
    "paper-bio": Method("paper, bio-inspired form", lambda _: PaperFeatures("bio-inspired", "forcing")),
    "euclidean": Method("Euclidean 1-NN", lambda _: EuclideanNeighbor(), learns_beginnings=True),
    "dtw": Method("DTW 1-NN", lambda _: DTWNeighbor(), needs="dtaidistance.dtw_ndim", learns_beginnings=True),
    "dtw-path": Method(
        "DTW 1-NN, arc length",
        lambda _: DTWNeighbor(along_path=True),
        needs="dtaidistance.dtw_ndim",
        learns_beginnings=True,
    ),
    "gak-svm": Method("GAK-SVM", lambda options: AlignmentSVM(options.seed), needs="tslearn.metrics"),
    "minirocket": Method(
        "MiniRocket + ridge",
        lambda options: MiniRocket(options.seed),
        needs="aeon.classification.convolution_based",
        learns_beginnings=True,
    ),
    "point-cloud": Method("$P (our code)", lambda _: PointCloud(), learns_beginnings=True),
    "plus-cloud": Method("$P+ (our code)", lambda _: PlusCloud(), learns_beginnings=True),
    "quick-cloud": Method("$Q (our code)", lambda _: QuickCloud(), learns_beginnings=True),
    "hmm": Method("HMM", lambda options: HiddenMarkov(options.seed), needs="hmmlearn.hmm"),
}  # fmt: skip
