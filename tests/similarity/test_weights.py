"""Representations and weights chosen on the training movements."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from sklearn.base import clone

from kineme import Recognizer
from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.recognition import Representation
from kineme.similarity.describe import Described, describe
from kineme.similarity.similarity import (
    AveragedSimilarity,
    _nonnegative_least_squares,
    aligned_weights,
    fitted_weights,
    impostor_widths,
)
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, ROW_REPRESENTATIONS
from movement_samples import draw_shapes
from soaking import examples


def _timed(n, seed):
    """One noisy path, done early or late: classes that differ in timing only."""
    random = np.random.default_rng(seed)
    u = np.linspace(0, 1, 80)
    movements, labels = [], []
    for i in range(n):
        bend = 1 + 0.3 * random.normal()
        phase = u ** (2.0 if i % 2 else 0.5)
        movements.append(np.column_stack((phase, bend * np.sin(3 * phase))) + 0.002 * random.normal(size=(80, 2)))
        labels.append("late" if i % 2 else "early")
    return movements, labels


def test_what_differs_in_timing_only_is_left_to_time():
    recognizer = Recognizer(classifier="nearest", weights="fitted").fit(*_timed(24, seed=0))
    over_time = [one.arc_share == 0 for one in recognizer.representations_]
    assert recognizer.weights_[over_time].sum() > 0.5
    fresh, truth = _timed(60, seed=1)
    assert recognizer.score(fresh, truth) == 1.0
    assert recognizer.score(fresh, truth) >= clone(recognizer).set_params(weights="equal").fit(
        *_timed(24, seed=0)
    ).score(fresh, truth)


def test_the_weights_are_those_of_largest_centered_alignment():
    """Against a search over all weights on a grid of twentieths."""
    demos = draw_shapes([9] * 3, seed=4, spread=1.2)
    recognizer = Recognizer(ROW_REPRESENTATIONS, weights="equal").fit(demos)
    weights = aligned_weights(
        recognizer.comparison_.similarity, recognizer.references_.described, recognizer.references_.labels
    )
    kernels = np.exp(
        recognizer.comparison_.similarity.logs(recognizer.references_.described, recognizer.references_.described)
    )
    same = (recognizer.references_.labels[:, None] == recognizer.references_.labels[None]).astype(float)

    def centered(gram):
        off = ~np.eye(len(gram), dtype=bool)
        H = np.eye(len(gram)) - 1.0 / len(gram)
        own = np.where(off, gram, 0.0).sum(axis=1) / (len(gram) - 1)
        return (H @ np.where(off, gram, np.diag(own)) @ H)[off]

    def alignment(w):
        joint, target = centered(np.tensordot(w, kernels, 1)), centered(same)
        return joint @ target / np.linalg.norm(joint) / np.linalg.norm(target)

    grid = [np.array(w) / 20 for w in itertools.product(range(21), repeat=3) if sum(w) == 20]
    assert alignment(weights) >= max(map(alignment, grid)) - 1e-4


OWN = np.array([2, 1, 2, 1, 2, 6, 6]) / 20


@pytest.mark.parametrize("counts", [[1], [1, 1, 1], [7, 9], [30], [8, 8]])
def test_own_weights_are_those_of_the_representations(counts):
    recognizer = Recognizer(weights="own").fit(draw_shapes(counts))
    assert recognizer.representations_ == DEFAULT_REPRESENTATIONS
    np.testing.assert_allclose(recognizer.weights_, OWN)


@pytest.mark.parametrize("counts", [[1], [1, 1, 1], [5], [2, 1], [1, 2, 1], [7, 9]])
def test_by_default_weights_are_fitted_where_two_classes_are_shown_and_one_of_them_twice(counts):
    demos = draw_shapes(counts, spread=0.6)
    weights = Recognizer().fit(demos).weights_
    is_fitted = len(counts) > 1 and max(counts) > 1
    expected = Recognizer(weights="fitted" if is_fitted else "own").fit(demos).weights_
    np.testing.assert_array_equal(weights, expected)
    assert is_fitted == (np.abs(weights - OWN).max() > 0.01)


def test_by_default_other_means_have_equal_weights():
    """Weights are fitted for the arithmetic one."""
    for weights in ("auto", "own"):
        recognizer = Recognizer(mean="geometric", weights=weights).fit(draw_shapes([7, 9]))
        np.testing.assert_allclose(recognizer.weights_, 1 / 7)


def test_own_weights_of_signals_leave_out_what_tells_nothing_of_them():
    """Turning angles have none even where weights are fitted; equal ones count all."""
    demos = draw_shapes([4, 5], d=1, spread=0.6)
    silent = [one.quantity in ("turning", "cloud") for one in DEFAULT_REPRESENTATIONS]
    own, auto, equal = (Recognizer(weights=weights).fit(demos) for weights in ("own", "auto", "equal"))
    kept = tuple(one for one, none in zip(DEFAULT_REPRESENTATIONS, silent, strict=True) if not none)
    assert own.representations_ == kept
    np.testing.assert_allclose(own.weights_, np.array([1, 1, 6, 6]) / 14)
    assert "turning" not in {one.quantity for one in auto.representations_}
    np.testing.assert_allclose(equal.weights_, 1 / 7)
    alone = Recognizer((DEFAULT_REPRESENTATIONS[0], DEFAULT_REPRESENTATIONS[3]), weights="own").fit(demos)
    assert [one.quantity for one in alone.representations_] == ["positions"]


@pytest.mark.parametrize("weights", ["auto", "own", "equal", "fitted"])
def test_weights_sum_to_one_and_every_part_has_one(weights):
    recognizer = Recognizer(weights=weights).fit(draw_shapes([8] * 4, spread=0.8))
    assert (recognizer.weights_ > 0).all()
    assert recognizer.weights_.sum() == pytest.approx(1.0)
    described = recognizer.references_.described
    assert described.n_representations == len(recognizer.widths_) == len(recognizer.representations_)
    answer = recognizer.recognize(recognizer.demonstrations_[0])
    assert set(answer.responsibilities) == {one.name for one in recognizer.representations_}
    assert sum(answer.responsibilities.values()) == pytest.approx(1.0)


def test_given_weights_are_those_of_the_weighted_mean():
    demos, fresh = draw_shapes([3] * 3), draw_shapes([5] * 3, seed=3)
    equal = Recognizer(weights="equal").fit(demos)
    given = Recognizer(weights=(2.0, 1.0, 1.0, 3.0, 1.0, 0.5, 1.5)).fit(demos)
    each = np.exp(equal.comparison_.similarity.logs(equal.describe(fresh), equal.references_.described))
    expected = np.log(np.tensordot(np.array([2.0, 1.0, 1.0, 3.0, 1.0, 0.5, 1.5]) / 10.0, each, 1))
    np.testing.assert_allclose(given.log_similarity(fresh), expected, rtol=1e-4, atol=1e-4)  # single precision
    one = Recognizer(weights=(0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0)).fit(demos)
    alone = Recognizer((DEFAULT_REPRESENTATIONS[1],)).fit(demos)
    np.testing.assert_allclose(one.log_similarity(fresh), alone.log_similarity(fresh), rtol=1e-4, atol=1e-4)


def test_positions_without_weight_still_give_the_rotation():
    demos, fresh = draw_shapes([3] * 3), draw_shapes([5] * 3, seed=3)
    whole = Recognizer(weights="own").fit(demos)
    logs = whole.comparison_.similarity.logs(whole.describe(fresh), whole.references_.described)
    for r, name in ((4, "point cloud"), (5, "elastic path in detail")):
        alone = Recognizer(weights=np.eye(7)[r]).fit(demos)
        np.testing.assert_allclose(alone.log_similarity(fresh), logs[r] - np.log(7 * OWN[r]), rtol=1e-4, atol=1e-4)
        assert alone.recognize(fresh[0]).responsibilities[name] == pytest.approx(1.0)


def test_kernels_that_know_nothing_stay_equal():
    class Blind:
        def logs(self, A, B):
            return np.zeros((2, len(A), len(B)))

    rows = Prepared(np.zeros((20, 1)), np.zeros(20))
    described = Described((rows, rows), Procrustes(1, 0.0))
    np.testing.assert_array_equal(aligned_weights(Blind(), described, np.arange(20) % 2), [0.5, 0.5])


@pytest.mark.parametrize(
    "weights", [(1.0, 2.0), (1.0,) * 5, (0.0,) * 7, (1.0, -1.0, *[1.0] * 5), (1.0, np.nan, *[1.0] * 5)]
)
def test_weights_that_cannot_be_are_refused(weights):
    with pytest.raises(SpecificationError, match="7 numbers from 0, not all 0"):
        Recognizer(weights=weights).fit(draw_shapes([1, 1]))


def test_weights_need_the_arithmetic_mean():
    with pytest.raises(SpecificationError, match="mean='arithmetic', got them with mean='min'"):
        Recognizer(mean="min", weights=(1,) * 7).fit(draw_shapes([1, 1]))
    with pytest.raises(SpecificationError, match=r"weights.*'loud'"):
        Recognizer(weights="loud").fit(draw_shapes([1, 1]))
    with pytest.raises(SpecificationError, match="mean='arithmetic', got it with mean='min'"):
        Recognizer(mean="min", weights="fitted").fit(draw_shapes([8, 8]))
    np.testing.assert_allclose(Recognizer(mean="min").fit(draw_shapes([8, 8])).weights_, 1 / 7)


@pytest.mark.parametrize(
    ("representations", "weights"),
    [
        ((Representation("positions"), Representation("elastic")), (0, 1)),
        ((Representation("positions", n_points=50), Representation("elastic")), (0, 1)),
        ((Representation("positions", n_points=50), Representation("positions"), Representation("cloud")), (0, 1, 1)),
    ],
    ids=["other weight", "other points", "the first of two"],
)
def test_any_positions_without_weight_still_give_the_rotation(representations, weights):
    demos, fresh = draw_shapes([3] * 3), draw_shapes([5] * 3, seed=3)
    some, every = Recognizer(representations, weights=weights).fit(demos), Recognizer(representations).fit(demos)
    assert some.representations_ == representations
    np.testing.assert_array_equal(some.widths_, every.widths_)
    np.testing.assert_array_equal(
        some.describe(fresh).pairs.positions.squares, every.describe(fresh).pairs.positions.squares
    )


def test_positions_are_kept_once_and_compared_once():
    whole = Recognizer().fit(draw_shapes([3] * 3)).references_.described
    for part in (whole, whole.take(slice(0, 2)), whole.empty(2), whole.select([0, 2])):
        assert part.pairs.positions is part.blocks[0]


@settings(max_examples=examples(60, 500), deadline=None)
@given(
    seed=st.integers(0, 10**6), n=st.integers(1, 9), rank=st.integers(1, 9), alike=st.floats(0.0, 0.95),
    scale=st.sampled_from([1e-6, 1.0, 1e6]),
)  # fmt: skip
def test_least_squares_without_negative_weights_are_those_of_scipy(seed, n, rank, alike, scale):
    """Also where columns are nearly the same, or fewer rows than columns leave the weights open: as good a fit."""
    rng = np.random.default_rng(seed)
    A = (1.0 - alike) * rng.normal(size=(rank, n)) + alike * rng.normal(size=(rank, 1))
    A[:, rng.random(n) < 0.1] = 0.0
    b = rng.normal(size=rank)
    A, b = scale * A, scale * b
    w = _nonnegative_least_squares(A.T @ A, A.T @ b)
    expected, residual = nnls(A, b)
    assert (w >= 0).all()
    assert np.isfinite(w).all()
    assert not w[~A.any(axis=0)].any()
    assert np.linalg.norm(A @ w - b) <= residual + 1e-3 * np.linalg.norm(b)
    if np.linalg.matrix_rank(A) == n and np.linalg.cond(A) < 30:
        np.testing.assert_allclose(w, expected, rtol=1e-4, atol=1e-6 * max(1.0, expected.max()))


def test_least_squares_of_columns_that_are_alike_are_solved_exactly():
    """To come as near step by step takes hundreds of sweeps."""
    rng = np.random.default_rng(0)
    for _ in range(40):
        A, b = 0.05 * rng.normal(size=(20, 7)) + rng.normal(size=(20, 1)), rng.normal(size=20)
        expected = nnls(A, b)[0]
        np.testing.assert_allclose(_nonnegative_least_squares(A.T @ A, A.T @ b), expected, rtol=0, atol=1e-10)


def test_half_of_a_fitted_weight_is_the_representations_own():
    demos = draw_shapes([6] * 4, seed=3, spread=0.4)
    described, labels = describe(demos), np.asarray(demos.labels)
    similarity = AveragedSimilarity(described.procrustes, impostor_widths(described, labels))
    aligned = aligned_weights(similarity, described, labels)
    own = np.array([one.weight for one in DEFAULT_REPRESENTATIONS])
    found = fitted_weights(similarity, described, labels)
    assert np.abs(aligned - own / own.sum()).max() > 0.05
    np.testing.assert_allclose(found, 0.5 * aligned + 0.5 * own / own.sum())
