"""The recognizers that are compared: one table."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from kineme.anchoring.proposals import propose
from kineme.kernels.pair_distances import matched_sums
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.early.evidence import cut
from kineme.recognition.recognizer import Recognizer
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array
from kineme_experiments.evaluation.linear_classifiers import AlignmentSVM, MiniRocket
from kineme_experiments.evaluation.neighbors import DTWNeighbor, EuclideanNeighbor, PaperFeatures, average_linkage
from kineme_experiments.evaluation.optional import optional_module, why_missing
from kineme_experiments.evaluation.paths import paths_over_length, smooth_paths
from kineme_experiments.evaluation.spotting import Stretch

_N_POINTS = 100
_N_STATES = 10
_MIN_VARIANCE = 1e-2  # for movements of unit size: one demonstration alone has no variance


_IN_PLANE, _IN_SPACE = 32, 16  # points of $P+: those of the paper, and those that do best beyond the plane
_MATCHED = 32  # points of $P and $Q


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
        arrays, times = [part.positions for part in parts], [part.times for part in parts]
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


def clouds(demonstrations: Demonstrations, n_points: int) -> Array:
    """Points of the smoothed path at even arc length, divided by its largest extent, centered: (n, n_points, d)."""
    points = smooth_paths(demonstrations, n_points)
    extent = np.ptp(points, axis=2).max(axis=1)[:, None, None]
    points = points / np.where(extent > 0, extent, 1.0)
    return np.ascontiguousarray((points - points.mean(axis=2, keepdims=True)).transpose(0, 2, 1))


def turning_angles(points: Array) -> Array:
    """Angle between the steps before and after each point, divided by pi; 0 at both ends. (n, N, d) to (n, N)."""
    steps = np.diff(points, axis=1)
    lengths = np.linalg.norm(steps, axis=2)
    products = lengths[:, 1:] * lengths[:, :-1]
    cosines = (steps[:, 1:] * steps[:, :-1]).sum(axis=2) / np.where(products > 0, products, 1.0)
    angles = np.zeros(points.shape[:2])
    angles[:, 1:-1] = np.where(products > 0, np.arccos(np.clip(cosines, -1.0, 1.0)) / np.pi, 0.0)
    return angles


def plus_distances(A: Array, B: Array) -> Array:
    """$P+ distances of clouds with turning angles, (n, N, d + 1) and (m, N, d + 1), shape (n, m)."""
    if use_compiled(4 * A.shape[1] ** 2 * A.shape[2] * len(A) * len(B)):
        distances = np.empty((len(A), len(B)))
        compiled_module("kineme_experiments.evaluation._clouds").fill_plus(A, B, distances)
        return distances
    return np.stack([matched_sums(np.stack([cdist(one, other) for other in B])) for one in A])


def nearest_by_matching(A: Array, B: Array, squared: bool) -> tuple[NDArray[np.intp], Array]:
    """Index of the nearest of the clouds B (m, N, d) to each of A (n, N, d), and its distance; (n,) each.

    With squared distances between points as in $Q, else with plain ones as in $P.
    """
    step = int(np.sqrt(A.shape[1]))
    if use_compiled(A.shape[1] ** 2 * (A.shape[2] + step) * len(A) * len(B)):
        nearest, distances = np.zeros(len(A), dtype=np.intp), np.empty(len(A))
        module = compiled_module("kineme_experiments.evaluation._clouds")
        module.fill_nearest(A, B, step, squared, nearest, distances)
        return nearest, distances
    metric = "sqeuclidean" if squared else "euclidean"
    costs = np.array([[_matched(cdist(one, other, metric), step) for other in B] for one in A])
    return costs.argmin(axis=1), costs.min(axis=1)


def _matched(squares: Array, step: int) -> float:
    """The least cost of all starts in both directions."""
    starts = range(0, len(squares), step)
    return min(_greedy(each, start) for each in (squares, squares.T) for start in starts)


def _greedy(squares: Array, start: int) -> float:
    """Cost of matching point after point to its nearest unmatched one, the first weighing most."""
    free = squares.copy()
    total, size = 0.0, len(squares)
    for k in range(size):
        i = (start + k) % size
        nearest = free[i].argmin()
        total += (size - k) * free[i, nearest]
        free[:, nearest] = np.inf
    return float(total)


class _Cloud:
    """1-NN classifier of clouds of points."""

    def fit(self, demonstrations: Demonstrations) -> None:
        """Store the training movements."""
        self.labels, self.stored = require_labels(demonstrations), self.describe(demonstrations)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class of the nearest movement, and minus its distance."""
        nearest, distances = self.nearest(self.describe(demonstrations))
        return self.labels[nearest], -distances

    def describe(self, demonstrations: Demonstrations) -> Array:
        """Movements as clouds (n, N, d)."""
        return clouds(demonstrations, _MATCHED)

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the nearest stored cloud to each, and its distance."""
        raise NotImplementedError


class PlusCloud(_Cloud):
    """$P+ of Vatavu (CHI 2017): points may be matched several times, and carry their turning angle.

    32 points in the plane, as in the paper, and 16 in other dimensions, where they do better.
    """

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Cloud
        points = clouds(demonstrations, _IN_PLANE if demonstrations.n_dims == 2 else _IN_SPACE)
        return np.concatenate((points, turning_angles(points)[:, :, None]), axis=2)

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        distances = plus_distances(described, self.stored)
        return distances.argmin(axis=1), distances.min(axis=1)

    def cluster(self, demonstrations: Demonstrations, n_clusters: int | None) -> NDArray[np.intp] | None:
        """Cluster of each movement by average linkage; None where the number is not given."""
        if n_clusters is None:
            return None
        described = self.describe(demonstrations)
        return average_linkage(plus_distances(described, described), n_clusters)


class PointCloud(_Cloud):
    """$P of Vatavu, Anthony and Wobbrock (ICMI 2012): greedy matching of 32 points in any order, from several starts.

    It abandons as $Q does, which changes no answer.
    """

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        return nearest_by_matching(described, self.stored, squared=False)


class QuickCloud(_Cloud):
    """$Q of Vatavu, Anthony and Wobbrock (MobileHCI 2018): $P's matching, squared, with bounds and early abandoning.

    The bounds come from exact nearest points instead of a table over a grid, so that they hold in any dimension.
    """

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        return nearest_by_matching(described, self.stored, squared=True)


class HiddenMarkov:
    """One left-to-right HMM per class on centered, scaled positions and their differences; the likeliest class wins."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn one model per class."""
        self.hmm = optional_module("hmmlearn.hmm")
        logging.getLogger("hmmlearn").setLevel(logging.ERROR)  # it warns when EM steps fall below rounding
        labels = require_labels(demonstrations)
        series = _series(demonstrations)
        self.classes = np.unique(labels)
        self.models = [self._model(series[labels == label]) for label in self.classes]

    def _model(self, series: Array) -> Any:
        n, length, d = series.shape
        model = self.hmm.GaussianHMM(
            _N_STATES, "diag", min_covar=_MIN_VARIANCE, n_iter=10, init_params="", params="tmc", random_state=self.seed
        )
        stay = 1.0 - _N_STATES / length
        model.startprob_ = np.eye(_N_STATES)[0]
        model.transmat_ = stay * np.eye(_N_STATES) + (1.0 - stay) * np.eye(_N_STATES, k=1)
        model.transmat_[-1, -1] = 1.0
        parts = np.array_split(series, _N_STATES, axis=1)  # each state begins as an equal part of the path
        model.means_ = np.array([part.mean(axis=(0, 1)) for part in parts])
        model.covars_ = np.array([part.var(axis=(0, 1)) + _MIN_VARIANCE for part in parts])
        return model.fit(series.reshape(-1, d), [length] * n)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and log-likelihood of each movement."""
        series = _series(demonstrations)
        likelihood = np.array([[model.score(one) for model in self.models] for one in series])
        return self.classes[likelihood.argmax(axis=1)], likelihood.max(axis=1)


def _series(demonstrations: Demonstrations) -> Array:
    """Positions and their differences, scaled to the size of the positions: (n, T, 2 d)."""
    paths = paths_over_length(demonstrations, _N_POINTS)
    steps = np.gradient(paths, axis=2)
    size = np.sqrt((steps**2).sum(axis=1, keepdims=True).mean(axis=2, keepdims=True))
    steps = steps / np.where(size > 0, size, 1.0)
    return np.ascontiguousarray(np.concatenate((paths, steps), axis=1).transpose(0, 2, 1))
