"""The recognizers that are compared: one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from kineme.experiments.evaluation.generative import HiddenMarkov
from kineme.experiments.evaluation.machines import AlignmentSVM, MiniRocket
from kineme.experiments.evaluation.neighbors import DTWNeighbor, EuclideanNeighbor, PaperFeatures, PointCloud
from kineme.experiments.evaluation.optional import why_missing
from kineme.experiments.evaluation.ours import Ours
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array


class Contender(Protocol):
    """What the protocols need of a method."""

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        ...

    def answer(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """The class of each movement (n,), and how familiar it is (n,): larger is more like the training movements."""
        ...


class Wishes(NamedTuple):
    """What a protocol tells all methods; those that cannot use it do not."""

    max_angle: float | None = None
    seed: int = 0


@dataclass(frozen=True)
class Method:
    """One row of `METHODS`.

    Attributes
    ----------
    title : str
        As the tables print it.
    make : callable
        Wishes -> contender.
    needs : str
        Module that has to be installed; "" for none.
    only_dims : int or None
        The only number of dimensions that it works in.
    slow : bool
        Takes part at the reference strength only where a protocol has many strengths.
    """

    title: str
    make: Callable[[Wishes], Contender]
    needs: str = ""
    only_dims: int | None = None
    slow: bool = False

    def unavailable(self, n_dims: int) -> str:
        """Why the method cannot take part, or ""."""
        if self.only_dims not in (None, n_dims):
            return f"works in {self.only_dims} dimensions only"
        return why_missing(self.needs) if self.needs else ""


OURS = "kineme"

#: The paper's configuration is 1-NN on the shape-attractor of the original, or on f of the bio-inspired formulation.
METHODS: dict[str, Method] = {
    OURS: Method("kineme, defaults", lambda wishes: Ours(wishes.max_angle)),
    "paper": Method("paper, original form", lambda _: PaperFeatures("original", "shape-attractor")),
    "paper-bio": Method("paper, bio-inspired form", lambda _: PaperFeatures("bio-inspired", "forcing")),
    "euclidean": Method("Euclidean 1-NN", lambda _: EuclideanNeighbor()),
    "dtw": Method("DTW 1-NN", lambda _: DTWNeighbor(), needs="dtaidistance.dtw_ndim"),
    "gak-svm": Method("GAK-SVM", lambda wishes: AlignmentSVM(wishes.seed), needs="tslearn.metrics"),
    "minirocket": Method(
        "MiniRocket + ridge", lambda wishes: MiniRocket(wishes.seed), needs="aeon.classification.convolution_based"
    ),
    "point-cloud": Method("$P point cloud", lambda _: PointCloud(), needs="dollarpy", only_dims=2, slow=True),
    "hmm": Method("HMM", lambda wishes: HiddenMarkov(wishes.seed), needs="hmmlearn.hmm"),
}
