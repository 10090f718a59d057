"""The open set: conformal p-values of a movement, for each class and for all together, from the demonstrations.

Source: V. Vovk, A. Gammerman, G. Shafer, "Algorithmic Learning in a Random World", Springer 2005, chapters 2 and 4
(conformal and class-conditional, or Mondrian, predictors).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import References
from kineme.similarity.scores import Classifier
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import softmax
from kineme.validation import Array, check_number

_PRIOR = 4.0  # demonstrations that the common scale counts for beside those of the class
DIMENSIONS = 8  # in which members of a class vary, about: even, for the closed form of the law of distances
MEAN_LENGTH = (
    math.sqrt(2.0) * math.gamma((DIMENSIONS + 1) / 2) / math.gamma(DIMENSIONS / 2)
)  # of normal vectors in these
#: Smallest scale, in kernel widths: rounding of single precision puts copies up to 0.002 apart.
LEAST = 5e-3
ROUNDING = 1e-5  # of log similarities, in single precision
#: Share of the typical distance to another class within which 95 % of members are expected, with one demonstration of
#: each class: of movements by the same people, and by others.
REACH, REACH_OF_OTHERS = 0.75, 1.0
#: Of movements by somebody who showed none, the same share of the typical distance, and of their own distance to the
#: next class, see `Calibration`.
REACH_OF_STRANGERS, REACH_TO_NEXT = 0.9, 2 / 3
#: Distance of movements of other kinds from one movement that is known alone, about: their median on four sets is 3.0
#: to 4.0. At 0.75 of 3.5, 3 to 10 in 100 of them are taken for it, and 0 to 7 of 100 repetitions by the same hand are
#: not. Two sets differ: of LASA's shapes 29 in 100 are taken for another, and of the words of a sign language 40 in 100
#: repetitions are not taken for their own.
FOREIGN = 3.5

#: Power of the ratio of distances before anything is known of it. The right classes of 20 gestures in space by five
#: people, one demonstration of each, are most likely at 14.4 with demonstrations by the same person and at 15.4 with
#: those by others (``python -m bench --only open_set``).
EXPONENT = 15.0
#: By how much the logarithms of the power differ between sets of movements, about: 5 to 36 were most likely on seven.
_SPREAD = 0.35
_BOUNDS = (2.0, 60.0)
_ROWS = 2000  # demonstrations that the power is fitted to, at most, evenly spaced

_REPEATED = 0.1  # of the median distance to other classes: the least scale
_CALIBRATED = 100  # demonstrations of a class that calibrate it, at most, evenly spaced

#: Rule by which a movement is called known or unknown -> what it promises.
RULES = {
    "class": "Of known movements most like this class, by people who showed some, about the error rate or less are "
    "called unknown; by other people, on average, only if groups told apart who showed what.",
    "pooled": "Of known movements of all classes with two or more demonstrations together, by people who showed some, "
    "about the error rate or less are called unknown; by other people, on average, only if groups told apart who "
    "showed what.",
    "strangers": "More novel than about the error rate of the movements that were shown, but much nearer to one class "
    "than to the next, as movements by other people are: a guess, unless groups tell who showed what.",
    "guess": "Too few demonstrations tell the error rate: any share of known movements may be called unknown.",
}
#: Rules that promise nothing.
GUESSES = ("strangers", "guess")


def check_error_rate(error_rate: float) -> None:
    """Refuse what is not a share between 0 and 1."""
    check_number("error_rate", error_rate, above=0.0)
    if error_rate >= 1:
        raise SpecificationError(f"expected error_rate below 1, got {error_rate!r}; 0.05 is one member in twenty")


@dataclass(frozen=True, eq=False)
class Calibration:
    """Distances of members of each class from their nearest demonstration, estimated from the demonstrations.

    With one demonstration of each class they cannot be estimated: p-values are then a guess, see 3. below.

    The nonconformity of a movement to class c is ``a_c = d_c / s_c``: its distance d_c to the nearest demonstration of
    the class, ``d = sqrt(-2 log K)``, over the scale s_c of the class. Its novelty is the smallest, ``a = min_c a_c``.
    Each demonstration gets the same scores with itself left out, and with everything of its group, where groups are
    given. There are two kinds of p-value:

    - of a class, ``p_c = (1 + #{scores of members >= a_c}) / (number of scores + 1)``. Whatever the distribution,
      p_c <= e happens to a share of at most about e of the members of class c.
    - of all known classes together, ``p = (1 + #{novelties >= a}) / (number of novelties + 1)``. p <= e happens to a
      share of about e of the movements of known classes, whichever they are, and as many as possible of the others: a
      movement with p <= e is called unknown. As a demonstration that is left out has one fewer of its class to be near
      to, its distance to the class counts ``((n - 1) / n)^(1/8)`` times, see `score_classes`.

    Which scores count depends on how many there are, for p cannot fall below 1 / (number + 1):

    1. "class": those of the class (for novelties, of demonstrations most like it), where they suffice for the error
       rate; 19 do for 0.05. The rate holds for each class.
    2. "pooled": those of all classes. The rate holds for movements of all classes with two or more demonstrations
       together; one alone gives no score, and of movements of its class more may be unknown. Each is scored against as
       many demonstrations of its class as class c has, so that unequal classes compare; and scaled by a mean from
       which it is left out.
    3. "guess": none. ``p_c = exp(-pi/4 a_c^2)``, the law (Rayleigh) of a distance in the plane whose mean is s_c;
       broad, since little is known. Where some novelties are known, p follows the law of a distance in eight dimensions
       with the same mean as they, else p is the largest p_c. With one demonstration of each class this takes how much
       members differ from how far the classes are apart. `calibrated` tells which classes this is about.

    The scale s_c is the mean left-out distance of the class, shrunk towards that of all classes as if by four more,
    since the mean of two or three is little known. With one demonstration of every class no distance within a class is
    known; s_c is then set so that the law reaches 0.05 at three quarters of the median distance from a demonstration to
    the nearest other class, or at the whole of it if the demonstrations are of several groups.

    It is at least a tenth of the median of these distances. A machine that repeats a movement exactly varies less than
    the first and the last samples of two recordings do, and its own next movement would be unknown. Movements of people
    vary by more: by 0.19 of that median at the least, in LASA, handwritten letters and gestures in space.

    With groups, such as people, the rates hold for movements of other groups, on average over groups. Without groups
    repetitions by one person tell nothing of how much people differ. A movement by somebody else is still much nearer
    to its class than to any other, so the p of all known classes together is then at least ``exp(-pi/4 (d / u)^2)``,
    with d the distance to the nearest class. u is set so that this is 0.05 at 0.9 of the median distance from a
    demonstration to the nearest other class, or at two thirds of the movement's own distance to the second nearest
    class, if that is less. ``python -m bench --only open_set`` measures all this.

    - `pooled`: for each class, the scores of all demonstrations, each scored against as many as the class has.
    - `own_novelties`, `pooled_novelties`: the same of novelties; of `sampled_calibration` the scores of members, which
      are not smaller.
    - `between`: the median distance, in kernel widths, from a demonstration to the nearest other class; 0 where groups
      tell how much people differ, and where each class has one demonstration.
    """

    scales: Array  # (C,), the s_c
    own: tuple[Array, ...]  # of each class, the scores of its demonstrations
    pooled: tuple[Array, ...]
    own_novelties: tuple[Array, ...]
    pooled_novelties: tuple[Array, ...]
    between: float = 0.0
    exponent: float = EXPONENT  # power of the ratio of distances by which classes are likely, see `class_probabilities`

    def of_those_shown(self) -> Calibration:
        """Return the calibration for movements by those who showed some, whatever the groups."""
        return replace(self, between=0.0)

    def scores(self, nearest: Array) -> Array:
        """Return the nonconformity (n, C) of movements with these log similarities to each class's nearest one."""
        return distances(nearest) / self.scales

    def p_values(self, nearest: Array, error_rate: float) -> Array:
        """Return p-values of each class (n, C), from as few classes as suffice to reach `error_rate`."""
        scores = self.scores(nearest)
        result = broad_law(scores)
        for calibrating, columns in self._counting(error_rate).sharing:
            result[:, columns] = _shares(calibrating, scores[:, columns])
        return result

    def known_p_values(self, nearest: Array, error_rate: float) -> Array:
        """Return p-values (n,) of all known classes together: unknown is what has one of at most `error_rate`."""
        return np.maximum(self._by_those_shown(nearest, error_rate), self._by_strangers(nearest))

    def _by_those_shown(self, nearest: Array, error_rate: float) -> Array:
        scores = self.scores(nearest)
        like = scores.argmin(axis=1)
        novelty = scores[np.arange(len(scores)), like]
        result = np.empty(len(scores))
        counted = self._counting(error_rate).novelties
        for c in np.unique(like):
            own, chosen, few = novelty[like == c], counted[c], self.pooled_novelties[c]
            if chosen is not None:
                result[like == c] = _shares(chosen[1], own)
            else:
                result[like == c] = law(own / max(few.mean(), LEAST)) if len(few) else broad_law(own)
        return result

    def _by_strangers(self, nearest: Array) -> Array:
        """Return p-values (n,) if somebody else made the movements; 0 where groups tell how much people differ."""
        if not self.between:
            return np.zeros(len(nearest))
        away = np.sort(distances(nearest), axis=1)
        reach = np.full(len(away), REACH_OF_STRANGERS * self.between)
        if away.shape[1] > 1:
            reach = np.minimum(reach, REACH_TO_NEXT * away[:, 1])
        return broad_law(away[:, 0] / np.maximum(reaching(reach), LEAST))

    def rules(self, nearest: Array, error_rate: float) -> list[str]:
        """Name the rule of each movement's `known_p_values`: "class", "pooled", "strangers" or "guess", see `RULES`."""
        counted = self._counting(error_rate).novelties
        chosen = [counted[c] for c in self.scores(nearest).argmin(axis=1)]
        by_strangers = (self._by_those_shown(nearest, error_rate) <= error_rate) & (
            self._by_strangers(nearest) > error_rate
        )
        return [
            "guess" if scores is None else "strangers" if strange else scores[0]
            for scores, strange in zip(chosen, by_strangers.tolist(), strict=True)
        ]

    def calibrated(self, error_rate: float) -> NDArray[np.bool_]:
        """Tell whether p-values of each class keep `error_rate`, shape (C,); elsewhere they are a guess.

        They keep it where at least ``1 / error_rate - 1`` left-out scores count. One demonstration has none.
        """
        return np.array([counted is not None for counted in self._counting(error_rate).members])

    def with_least_scales(self, least: Array) -> Calibration:
        """Raise scales to at least (C,); where that is more, a demonstration is as novel as that makes it: 1."""
        raised = (least > self.scales).tolist()
        if not any(raised):
            return self

        def novel(novelties: tuple[Array, ...]) -> tuple[Array, ...]:
            raised_to_one = {
                id(scores): np.maximum(scores, 1.0) for scores in novelties
            }  # classes share what is pooled
            return tuple(
                raised_to_one[id(scores)] if more else scores for scores, more in zip(novelties, raised, strict=True)
            )

        return replace(
            self,
            scales=np.maximum(self.scales, least),
            own_novelties=novel(self.own_novelties),
            pooled_novelties=novel(self.pooled_novelties),
        )

    def select(self, classes: NDArray[np.intp]) -> Calibration:
        """Return the calibration of some of the classes, in rising order."""
        if len(classes) == len(self.scales):
            return self
        parts = ("own", "pooled", "own_novelties", "pooled_novelties")
        of_some: dict[str, Any] = {name: tuple(getattr(self, name)[c] for c in classes) for name in parts}
        return replace(self, scales=self.scales[classes], **of_some)

    def _counting(self, error_rate: float) -> Counting:
        """Return what counts; stored for the last error rate."""
        last = vars(self).get("_last_counting")
        if last is None or last[0] != error_rate:
            members = _counted(self.own, self.pooled, error_rate)
            sharing: dict[int, tuple[Array, list[int]]] = {}  # classes share what is pooled
            for c, counted in enumerate(members):
                if counted is not None:
                    sharing.setdefault(id(counted[1]), (counted[1], []))[1].append(c)
            novelties = _counted(self.own_novelties, self.pooled_novelties, error_rate)
            last = error_rate, Counting(members, novelties, list(sharing.values()))
            vars(self)["_last_counting"] = last
        return last[1]


Counted = tuple[str, Array]  # a rule, and scores in rising order


class Counting(NamedTuple):
    """What counts at an error rate: for each class of the scores and of the novelties, None where too few do."""

    members: list[Counted | None]
    novelties: list[Counted | None]
    sharing: list[tuple[Array, list[int]]]  # scores in rising order, and the classes of which they count


def _counted(own: Sequence[Array], pooled: Sequence[Array], error_rate: float) -> list[Counted | None]:
    """Return the rule of each class and the scores that count: its own, else those of all, else None."""
    ordered: dict[int, Array] = {}  # classes share what is pooled

    def enough(scores: Array) -> bool:
        return (len(scores) + 1) * error_rate > 1 - 1e-12

    def of_all(scores: Array) -> Array:
        if id(scores) not in ordered:
            ordered[id(scores)] = np.sort(scores)
        return ordered[id(scores)]

    return [
        ("class", np.sort(scores)) if enough(scores) else ("pooled", of_all(every)) if enough(every) else None
        for scores, every in zip(own, pooled, strict=True)
    ]


def _shares(calibrating: Array, scores: Array) -> Array:
    """Return ``(1 + #{calibrating >= score}) / (number of calibrating + 1)``, of sorted ones."""
    above = len(calibrating) - calibrating.searchsorted(scores)
    return np.asarray((1.0 + above) / (len(calibrating) + 1.0))


def calibrate(
    similarity: AveragedSimilarity,
    references: References,
    groups: NDArray[np.intp] | None = None,
    classifier: Classifier | None = None,
) -> Calibration:
    """Score references against the others, at most a hundred of each class.

    With `groups`, the number of each reference's group, none is compared with another of its group; references of one
    group alone count as without. By the similarity, or as a `classifier` tells what is known, see `logs_among` there.
    """
    counts = references.counts
    groups = comparable_groups(groups)
    blocks, others, impostors = [], [], []
    for own_class, count in zip(references.slices(), counts, strict=True):
        chosen = own_class.start + evenly_spaced(count, _CALIBRATED)
        logs = similarity.log_average(references.described.take(chosen), references.described)
        away = distances(logs if classifier is None else classifier.logs_among(logs, chosen))
        away[np.arange(len(chosen)), chosen] = np.inf
        of_others = away.copy()
        of_others[:, own_class] = np.inf
        impostors.append(of_others.min(axis=1))
        if groups is not None:
            away[groups[chosen][:, None] == groups] = np.inf
        shown_by = None if groups is None else groups[own_class]
        blocks.append(ClassDistances(away[:, own_class].copy(), chosen - own_class.start, shown_by))
        away[:, own_class] = np.inf
        others.append(np.minimum.reduceat(away, references.first, axis=1))
    to_others = np.concatenate(impostors)
    typical = typical_scale(to_others, groups)
    by_size = {int(size): score_classes(blocks, int(size), typical) for size in np.unique(counts)}
    scales = np.array([by_size[int(size)].scales[c] for c, size in enumerate(counts)])
    novelties = {size: _novelties(scored, others, scales) for size, scored in by_size.items()}
    pooled = {size: scored.pooled() for size, scored in by_size.items()}
    # The exponent is fitted to what is left out: to as many of its own class, about, as of the others.
    away, nearest_of = np.concatenate(others), np.repeat(np.arange(len(blocks)), [len(block) for block in others])
    own = np.concatenate(
        [block.nearest(n)[0] * block.shares(n) for block, n in zip(blocks, counts.tolist(), strict=True)]
    )
    away[np.arange(len(away)), nearest_of] = own
    return Calibration(
        scales,
        tuple(finite(block.nearest(int(n))[0] / s) for block, n, s in zip(blocks, counts, scales, strict=True)),
        tuple(pooled[int(size)] for size in counts),
        tuple(novelties[int(size)][0][novelties[int(size)][1] == c] for c, size in enumerate(counts)),
        tuple(novelties[int(size)][0] for size in counts),
        between_classes(to_others, blocks, groups),
        fit_exponent(away[np.isfinite(own)], nearest_of[np.isfinite(own)]),
    ).with_least_scales(np.full(len(counts), least_scale(to_others)))


def between_classes(to_others: Array, blocks: Sequence[ClassDistances], groups: NDArray[np.intp] | None) -> float:
    """Return `Calibration.between`, from distances of demonstrations to the nearest other class and to their own."""
    if groups is not None or not any(np.isfinite(block.distances).any() for block in blocks):
        return 0.0
    return typical_distance(to_others)


def least_scale(to_others: Array) -> float:
    """Return a tenth of the median distance of demonstrations to the nearest other class; 0 where there is no other."""
    apart = to_others[np.isfinite(to_others)]
    return _REPEATED * float(np.median(apart)) if len(apart) else 0.0


def _novelties(scored: Scored, others: list[Array], scales: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return novelties of all demonstrations that have others of their class, and which class each is most like."""
    scores = [away / scales for away in others]  # (k, C), infinite for the own class
    for c, (block, own, share) in enumerate(zip(scores, scored.scores, scored.shares, strict=True)):
        block[:, c] = own * share
    every = np.concatenate(scores)[np.isfinite(np.concatenate(scored.scores))]
    like = every.argmin(axis=1)
    return every[np.arange(len(every)), like], like


def class_probabilities(similar: Array, exponent: float = EXPONENT) -> Array:
    """Return the probability of each class for movements that are of one of them, (n, C); rows sum to 1.

    ``P(c) = d_c^(-m) / sum_j d_j^(-m)`` with d_c the distance to the nearest demonstration of class c, or to the
    nearest in each representation, in kernel widths, and m the exponent: of two classes, the odds are the ratio of the
    distances to the power of m. This is the estimate of densities by nearest neighbors, ``1 / d^m`` in m dimensions;
    only m is fitted, see `fit_exponent`.

    `similar` (n, C): log similarity to each class, by which its label is chosen.
    """
    return softmax(_log_odds(distances(similar), exponent), axis=1)


def log_class_probabilities(similar: Array, exponent: float) -> Array:
    """Return the logarithms of `class_probabilities`, (n, C), which are finite where these underflow."""
    logs = _log_odds(distances(similar), exponent)
    return np.asarray(logs - np.log(np.exp(logs).sum(axis=1, keepdims=True)))


def fit_exponent(away: Array, classes: NDArray[np.intp], prior: float = EXPONENT) -> float:
    """Return the exponent by which demonstrations are most likely of their own classes.

    It maximizes ``sum_i log P(c_i) - (log(m / prior) / 0.35)^2 / 2``, each demonstration left out of what it is
    compared with; the last term is a log-normal prior. Without demonstrations it is the `prior`.

    - `away` (n, C): distance of each demonstration to the nearest other one of each class; infinite where there is
      none.
    - `classes` (n,): the class of each.
    """
    if not len(away):
        return prior
    chosen = evenly_spaced(len(away), _ROWS)
    away, classes = away[chosen], classes[chosen]
    rows = np.arange(len(away))

    def loss(log_exponent: float) -> float:
        logs = _log_odds(away, math.exp(log_exponent))
        likelihood = logs[rows, classes] - np.log(np.exp(logs).sum(axis=1))
        return 0.5 * ((log_exponent - math.log(prior)) / _SPREAD) ** 2 - float(likelihood.sum())

    low, high = (math.log(bound) for bound in _BOUNDS)
    return math.exp(_golden_section(loss, low, high))


def _golden_section(loss: Callable[[float], float], low: float, high: float) -> float:
    """Return the argument with the least loss, to 1e-4: golden-section search (Kiefer 1953).

    `scipy.optimize` finds the same; its import takes as long as recognizing hundreds of recordings.
    """
    ratio = (math.sqrt(5) - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    left_loss, right_loss = loss(left), loss(right)
    while high - low > 1e-4:
        if left_loss <= right_loss:
            high, right, right_loss = right, left, left_loss
            left = high - ratio * (high - low)
            left_loss = loss(left)
        else:
            low, left, left_loss = left, right, right_loss
            right = low + ratio * (high - low)
            right_loss = loss(right)
    return (low + high) / 2


def _log_odds(away: Array, exponent: float) -> Array:
    """Return the logarithms of ``d^(-m)``, less the largest of each row."""
    logs = -exponent * np.log(np.maximum(away, LEAST))
    return np.asarray(logs - logs.max(axis=1, keepdims=True))


def distances(logs: Array) -> Array:
    """Return ``sqrt(-2 log K)``: the distance, in kernel widths, whose Gaussian is the averaged similarity K.

    0 between copies: what rounding makes of them would make some more novel than others.
    """
    return np.sqrt(np.where(logs < -ROUNDING, -2.0 * logs, 0.0))


def broad_law(scores: Array) -> Array:
    """Return ``exp(-pi/4 a^2)``, the share of distances above a times their mean, of vectors in a plane (Rayleigh)."""
    return np.asarray(np.exp(-0.25 * math.pi * scores**2))


def law(scores: Array) -> Array:
    """Return the share of distances above `scores` times their mean, of normal vectors in eight dimensions.

    ``P(chi_8 >= x) = exp(-y) (1 + y + y^2 / 2 + y^3 / 6)`` with ``y = x^2 / 2``; x is the score times the mean of
    chi_8, 2.74. It is 0.05 at 1.44 times the mean; measured were 1.36 to 1.47 times, of people's movements.
    """
    y = 0.5 * (MEAN_LENGTH * scores) ** 2
    terms = sum(y**k / math.factorial(k) for k in range(DIMENSIONS // 2))
    return np.asarray(np.exp(-y) * terms)


def typical_scale(impostors: Array, groups: NDArray[np.intp] | None = None) -> float:
    """Return the scale of classes shown once, from distances of demonstrations to the nearest other class."""
    return reaching((REACH if groups is None else REACH_OF_OTHERS) * typical_distance(impostors))


def typical_distance(impostors: Array) -> float:
    """Return the median distance to the nearest other class, without copies; with one class, without any, `FOREIGN`."""
    apart = impostors[np.isfinite(impostors) & (impostors > 0)]
    return float(np.median(apart)) if len(apart) else FOREIGN


@overload
def reaching(away: float) -> float: ...
@overload
def reaching(away: Array) -> Array: ...
def reaching(away: float | Array) -> float | Array:
    """Return the scale by which `broad_law` is 0.05 at these distances."""
    return away * math.sqrt(math.pi / 4 / math.log(20))


def check_groups(groups: ArrayLike, n: int) -> NDArray[np.intp]:
    """Return numbers of the groups, one for each of n movements.

    Raises `TrajectoryError`: not one group for each movement, or texts beside numbers.
    """
    given = np.asarray(groups)
    if given.shape != (n,):
        raise TrajectoryError(
            f"expected groups to be one name or number for each of the {n} movements, such as who did it, got an array "
            f"of shape {given.shape}"
        )
    if given.dtype.kind == "f" and np.isnan(given).any():
        raise TrajectoryError(
            "expected a group for each movement, got nan; give a name of its own to whoever is unknown"
        )
    try:
        return np.asarray(np.unique(given, return_inverse=True)[1], dtype=np.intp)
    except TypeError:
        kinds = " and ".join(sorted({type(value).__name__ for value in given.tolist()}))
        raise TrajectoryError(f"expected groups to be all texts or all numbers, got {kinds}") from None


def comparable_groups(groups: NDArray[np.intp] | None) -> NDArray[np.intp] | None:
    """Return the groups; None where there is one alone, in which nothing could be compared: it counts as no groups."""
    return None if groups is None or len(np.unique(groups)) == 1 else groups


@dataclass(frozen=True, eq=False)
class ClassDistances:
    """Distances (k, n) of k calibrating demonstrations, at `indices`, to the n demonstrations of their class.

    Infinite where the two are not to be compared: of a demonstration to itself, or to another of its group. `groups`
    are those of the n demonstrations; None if each is a group of its own.
    """

    distances: Array
    indices: NDArray[np.intp]
    groups: NDArray[np.intp] | None = None

    def nearest(self, size: int) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return distances to the nearest and second nearest of the next `size` others, in a circle, and the index."""
        k, n = self.distances.shape
        circle = (self.indices[:, None] + np.arange(n)) % n
        away = np.take_along_axis(self.distances, circle, axis=1)
        away[np.cumsum(np.isfinite(away), axis=1) > size] = np.inf
        order = np.sort(away, axis=1)
        which = circle[np.arange(k), away.argmin(axis=1)]
        return order[:, 0], order[:, 1] if n > 1 else np.full(k, np.inf), which

    def counted(self, size: int) -> NDArray[np.intp]:
        """Return the number of others that `nearest` compares each with, at most `size`."""
        return np.minimum(np.isfinite(self.distances).sum(axis=1), size)

    def shares(self, size: int) -> Array:
        """Return shares by which distances to the nearest shrink, about, with `size` others, not those `counted`."""
        return np.asarray((np.maximum(self.counted(size), 1) / size) ** (1 / DIMENSIONS))

    def left_out(self, size: int) -> Array:
        """Return distances (k, k) to the nearest, row i as if i and its group did not exist; NaN if there is none."""
        if self.groups is None:
            first, second, which = self.nearest(size)
            without = np.where(which[None, :] == self.indices[:, None], second, first)
            np.fill_diagonal(without, np.inf)
        else:
            own, without = self.groups[self.indices], np.empty((len(self.indices), len(self.indices)))
            for group in np.unique(own):
                remaining = np.where(self.groups == group, np.inf, self.distances)
                nearest = ClassDistances(remaining, self.indices).nearest(size)[0]
                without[own == group] = np.where(own == group, np.inf, nearest)
        return np.where(np.isfinite(without), without, np.nan)


@dataclass(frozen=True, eq=False)
class Scored:
    """Classes compared as if each had `size` demonstrations.

    `scores`: of each class, its calibrating demonstrations' distances to the nearest other of the class, over the scale
    from which they are left out; infinite where there is no other.
    """

    scales: Array  # (C,), of the classes
    scores: tuple[Array, ...]
    shares: tuple[Array, ...]  # by which these shrink, about, if there are `size` others instead of the number at hand

    def pooled(self) -> Array:
        """Return finite scores of all classes."""
        return finite(np.concatenate(self.scores))

    def pooled_novelties(self) -> Array:
        """Return these as they would be with `size` others, as far as they are known without the other classes."""
        return finite(np.concatenate([own * share for own, share in zip(self.scores, self.shares, strict=True)]))


def score_classes(blocks: list[ClassDistances], size: int, typical: float) -> Scored:
    """Return scales of all classes and scores of all demonstrations, each against at most `size` others of its class.

    The nearest of n movements that vary in m dimensions is at a distance that falls as n^(-1/m). With eight dimensions
    a second demonstration brings the nearest 8 % closer; measured were 5 to 13 % (``python -m bench --only open_set``).
    """
    nearest = [block.nearest(size)[0] for block in blocks]
    finite_distances = np.concatenate(nearest)
    finite_distances = finite_distances[np.isfinite(finite_distances)]
    if not finite_distances.size:
        return Scored(np.full(len(blocks), typical), tuple(nearest), tuple(map(np.ones_like, nearest)))
    common, scales, scores = float(finite_distances.mean()), [], []
    for block, own in zip(blocks, nearest, strict=True):
        among = np.where(np.isfinite(own), own, np.nan)[None]
        scales.append(max(_shrunk(among, common)[0], LEAST))
        scores.append(own / np.maximum(_shrunk(block.left_out(size), common), LEAST))
    return Scored(np.array(scales), tuple(scores), tuple(block.shares(size) for block in blocks))


def finite(scores: Array) -> Array:
    """Return scores of what has others to be compared with."""
    return np.asarray(scores[np.isfinite(scores)])


def _shrunk(values: Array, common: float) -> Array:
    """Return means of rows, NaN left out, shrunk towards the common one."""
    return np.asarray((np.nansum(values, axis=1) + _PRIOR * common) / (np.isfinite(values).sum(axis=1) + _PRIOR))
