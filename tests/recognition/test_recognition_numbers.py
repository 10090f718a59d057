"""Numbers that the documentation gives for recognition: each falls here if it is changed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kineme
from kineme import Demonstrations, Recognizer, Trajectory
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.movements.preparation.perturbations import Perturbation
from kineme.movements.segmentation.table import observe
from kineme.recognition import spotting
from kineme.recognition.compared_windows import Surroundings, Templates, compare_windows
from kineme.recognition.conformal import Calibration, calibrate, typical_scale
from kineme.recognition.early.evidence import _log_priors, describe_begun
from kineme.recognition.early.hypotheses import Early, hypotheses, smooth_paths
from kineme.recognition.early.stream import Decision
from kineme.recognition.spotting import Manner, expected, score_windows
from kineme.similarity.describe import Described
from kineme.similarity.similarity import aligned_weights
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, ROW_REPRESENTATIONS
from movement_samples import draw_shapes


def test_of_four_demonstrations_the_own_scale_counts_half():
    """Drawn towards that of all classes as if by four more."""
    recognizer = Recognizer(classifier="nearest").fit(draw_shapes([4] * 6, seed=2))
    logs = recognizer.log_similarity(recognizer.demonstrations_)
    np.fill_diagonal(logs, -np.inf)
    own = np.array([logs[i, i // 4 * 4 : i // 4 * 4 + 4].max() for i in range(24)])
    means = np.sqrt(-2.0 * own).reshape(6, 4).mean(axis=1)
    np.testing.assert_allclose(
        calibrate(recognizer.comparison_.similarity, recognizer.references_).scales,
        0.5 * means + 0.5 * means.mean(),
        rtol=1e-3,
    )


def test_what_is_not_calibrated_is_unknown_beyond_three_quarters_of_the_way_to_another_class():
    none = (np.empty(0),)
    guess = Calibration(np.array([typical_scale(np.array([1.0, 2.0, 3.0]))]), none, none, none, none)
    logs = -0.5 * (2.0 * np.array([[0.74], [0.75], [0.76]])) ** 2
    p = guess.p_values(logs, 0.05)[:, 0]
    assert p[1] == pytest.approx(0.05)
    assert p[0] > 0.05 > p[2]


@pytest.mark.parametrize("compiled", ["never", "always"])
def test_copies_of_one_movement_have_a_scale(monkeypatch, compiled):
    """A tenth of the distance to other classes: what is off by 1 % of its extent is known, by 10 % it is not."""
    monkeypatch.setenv("KINEME_COMPILED", "never")
    demos = draw_shapes([1] * 3, seed=3)
    copies = demos[[0, 0, 1, 1, 2, 2]]
    recognizer = Recognizer(classifier="nearest", weights="equal").fit(copies, list("aabbcc"))
    similarity, references = recognizer.comparison_.similarity, recognizer.references_
    apart = np.sqrt(-2 * similarity.log_average(references.described, references.described)[::2, ::2])
    others = np.sort(apart, axis=1)[:, 1]  # to the nearest of the two other classes
    np.testing.assert_allclose(calibrate(similarity, references).scales, 0.1 * np.median(others), rtol=1e-6)
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    own = range(6), [0, 0, 1, 1, 2, 2]
    near, off = (
        [one.positions + by * np.sin(4 * one.times / one.duration)[:, None] for one in copies] for by in (0.05, 0.4)
    )
    assert (recognizer.p_values(copies)[own] > 0.05).all()
    assert (recognizer.p_values(near)[own] > 0.05).all()
    assert (recognizer.p_values(off) < 0.05).all()


def test_a_typical_impostor_counts_exp_of_minus_three():
    recognizer = Recognizer(weights="equal").fit(draw_shapes([3] * 6, seed=1))
    logs = recognizer.comparison_.similarity.logs(recognizer.references_.described, recognizer.references_.described)
    logs[:, recognizer.references_.labels[:, None] == recognizer.references_.labels] = -np.inf
    typical = np.median(logs.max(axis=2), axis=1)
    np.testing.assert_allclose(typical[:5], -3.125, atol=0.05)
    assert (np.abs(typical[5:] + 3.125) > 0.5).all()  # in detail the widths are those of the rotated ones


def test_representations_keep_half_of_their_own_weight():
    """Whatever is fitted to movements that differ in timing only; the new ones may differ in anything."""
    u, random = np.linspace(0.0, 1.0, 80), np.random.default_rng(0)
    movements = []
    for power in (2.0, 0.5):
        for _ in range(10):
            bend = 1 + 0.3 * random.normal()
            movements.append(np.column_stack((u**power, bend * np.sin(3 * u**power))))
    recognizer = Recognizer(weights="fitted").fit(movements, np.repeat(["late", "early"], 10))
    share = dict(zip(recognizer.representations_, recognizer.weights_, strict=True))
    assert all(share[one] >= one.weight / 40 - 1e-12 for one in DEFAULT_REPRESENTATIONS)
    assert sum(one.weight for one in DEFAULT_REPRESENTATIONS) == 20


def test_shares_that_say_less_than_a_fiftieth_are_left_out_and_larger_ones_kept():
    shares = []
    for seed in range(40):
        recognizer = Recognizer((*DEFAULT_REPRESENTATIONS, ROW_REPRESENTATIONS[1]), weights="equal").fit(
            draw_shapes([8] * 4, seed=seed, spread=0.8)
        )
        shares.append(
            aligned_weights(
                recognizer.comparison_.similarity, recognizer.references_.described, recognizer.references_.labels
            )
        )
    nonzero = np.concatenate(shares)[np.concatenate(shares) > 0]
    assert 0.02 <= nonzero.min() < 0.05


class _Known:
    """Two kernels of which the labels are 0.99 and 0.01 parts."""

    def __init__(self, labels):
        random = np.random.default_rng(0)
        noise = random.uniform(0.1, 0.9, (len(labels), len(labels)))
        same = (labels[:, None] == labels).astype(float)
        other = noise + noise.T
        self._logs = np.log(np.stack(((same - 0.01 * other + 0.1) / 0.99, other)))

    def logs(self, A, B):
        return self._logs


def test_a_hundredth_is_left_out():
    labels = np.repeat(["a", "b"], 10)
    rows = Prepared(np.zeros((20, 1)), np.zeros(20))
    described = Described((rows, rows), Procrustes(1, 0.0))
    np.testing.assert_array_equal(aligned_weights(_Known(labels), described, labels), [1.0, 0.0])


def test_three_percent_of_noise_are_smoothed_away_and_shapes_are_not():
    """A cutoff of 30 cycles leaves 85 % of the movements recognized, one of 3 cycles 96 %."""
    demos = kineme.load_lasa()
    noisy = Perturbation(noise=0.03, scale=1, rotation=0.3, warp=0.35).apply(demos, 0)
    assert Recognizer().fit(noisy[::7]).score(noisy, demos.labels) >= 0.975


def _scored(factor, manner=Manner(), around=(0.0, 1e-9, 0.0)):  # noqa: B008 - a frozen record
    """Score of a window that holds a demonstration done slower, and its cost for not being the demonstration itself.

    It does not quite reach from rest to rest: else a short one would pay less.
    """
    demos = draw_shapes([1, 1, 1])
    demos = Demonstrations([Trajectory(np.linspace(0, 2, 80), x.positions, x.label) for x in demos])
    recognizer = Recognizer().fit(demos)
    known = Templates(recognizer.comparison_, recognizer.references_, recognizer.calibration())
    whole = Trajectory(np.linspace(0.0, 2.0 * factor, 80), demos[0].positions)
    compared = compare_windows(known, observe(whole, 0.04), np.array([[0, 79]]))
    edges, far, inside = (np.array([value]) for value in around)
    surrounded = Surroundings(edges, far, np.zeros(1), inside)
    scored = score_windows(compared, expected(recognizer.references_), surrounded, manner, spotting.far(0.05))
    assert scored.best.tolist() == [0]
    unlike = float(compared.scores[0, 0]) / (0.975 * math.sqrt(4.0 / math.pi * math.log(20.0)))
    assert unlike < 0.02
    return float(scored.score[0]), 1.0 - unlike


def test_a_window_counts_its_duration_in_typical_ones_less_a_sixth():
    score, closeness = _scored(1.0)
    assert score == pytest.approx(closeness - 0.165)


@pytest.mark.parametrize("factor", [1.05, 1.5, 2.0, 2.9, 1 / 2.9])
def test_another_duration_costs_the_squared_logarithm_of_the_ratio(factor):
    """Half as much, and a tenth for nothing, while the tempo of the recording is unknown."""
    score, closeness = _scored(factor)
    cost = 0.025 * max(abs(math.log(factor)) - 0.1, 0.0) ** 2
    assert score == pytest.approx(factor * (closeness - cost) - 0.165)
    score, closeness = _scored(factor, Manner(tempo=math.log(1.5)))
    cost = 0.05 * math.log(factor / 1.5) ** 2
    assert score == pytest.approx(factor / 1.5 * (closeness - cost) - 0.165)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_another_size_than_that_of_the_recording_costs_the_squared_logarithm_of_the_ratio(ratio):
    score, closeness = _scored(1.0, Manner(size=math.log(ratio)))
    assert score == pytest.approx(closeness - 0.2 * math.log(ratio) ** 2 - 0.165, abs=1e-3)


def test_ends_in_motion_and_far_from_rests_and_rests_inside_cost():
    score, closeness = _scored(1.0, around=(1.5, 2.0, 3.0))
    assert score == pytest.approx(closeness - 0.14 * 1.5 - 0.03 * 2.0 - 0.02 * 3.0 - 0.165)


def test_what_is_spotted_takes_from_half_the_shortest_duration_to_three_times_the_longest(monkeypatch):
    demos = draw_shapes([1, 1, 1])
    lasting = (1.0, 2.0, 4.0)
    demos = Demonstrations(
        [Trajectory(np.linspace(0, t, 80), x.positions, x.label) for t, x in zip(lasting, demos, strict=True)]
    )
    asked = []
    inner = spotting.candidate_windows

    def noted(recording, durations, most_bouts):
        asked.append((durations, inner(recording, durations, most_bouts)))
        return asked[-1][1]

    monkeypatch.setattr(spotting, "candidate_windows", noted)
    positions = np.concatenate([demos[i].positions for i in (0, 1, 2, 0, 1)])
    at = np.linspace(0.0, len(positions) - 1, 2000)
    positions = np.column_stack([np.interp(at, np.arange(len(positions)), x) for x in positions.T])
    Recognizer().fit(demos).spot(Trajectory(np.linspace(0.0, 40.0, 2000), positions))
    [(durations, windows)] = asked
    assert durations == (0.5, 12.0)
    start, end = windows.motion.times[windows.rows].T
    assert 0.5 <= (end - start).min() < 0.8
    assert 11.0 < (end - start).max() <= 12.0 + 1e-6


def _evidence(recognizer, early, size=1.0, slower=1.0, late=0.0):
    """How much the same movement loses when it is larger, slower or late on its way, in logarithms."""
    stored = hypotheses(recognizer.comparison_, recognizer.references_, early)
    first = recognizer.demonstrations_[:1]
    paths, durations = smooth_paths(first, None), first.durations
    start = np.zeros((1, first.n_dims))
    plain = describe_begun(stored, paths, start, durations, (paths, paths))
    moved = describe_begun(stored, size * paths, start, slower * durations, (size * paths, size * paths))
    timing = moved.prefixes.timing + late / math.sqrt(moved.prefixes.timing.shape[1])
    moved = moved._replace(prefixes=moved.prefixes._replace(timing=timing))
    whole = len(stored.progress) - 1  # the hypothesis that it is this movement, all of it
    return float(_log_priors(stored, moved)[0, whole] - _log_priors(stored, plain)[0, whole])


def test_how_much_size_duration_and_timing_may_vary_by_default():
    """A size four times as large and a duration twice as long are two standard deviations; 0.05 is one of timing."""
    recognizer = Recognizer(cutoff=None).fit(draw_shapes([1, 1, 1]))
    assert _evidence(recognizer, Early(), size=4.0) == pytest.approx(-0.5 * (math.log(4.0) / 0.7) ** 2, abs=1e-3)
    assert _evidence(recognizer, Early(), slower=0.5) == pytest.approx(-0.5 * (math.log(2.0) / 0.35) ** 2, abs=1e-3)
    assert _evidence(recognizer, Early(), late=0.05) == pytest.approx(-math.log(1.5), abs=1e-3)
    sized = Recognizer(cutoff=None, scale="none").fit(draw_shapes([1, 1, 1]))
    assert _evidence(sized, Early(), size=1.2) == pytest.approx(-0.5 * (math.log(1.2) / 0.1) ** 2, abs=1e-3)


def test_a_label_is_decided_when_nine_tenths_were_held_for_a_twentieth_of_the_time():
    live = Recognizer().fit(draw_shapes([1, 1])).stream()._decision
    for decision in (Decision(), live):
        decision.clear()
        assert decision.update(1.0, 0, 0.89) is None
        assert decision.update(1.02, 0, 0.91) is None
        assert decision.update(1.06, 0, 0.91) is None  # 0.04 of 1.06
        assert decision.update(1.08, 0, 0.91) == 0
        assert decision.update(1.10, 1, 0.95) == 0  # another needs twice as long
        assert decision.update(1.20, 1, 0.95) == 0
        assert decision.update(1.25, 1, 0.95) == 1


def test_the_svm_lets_no_movement_between_two_classes_decide_alone():
    """Where a movement of one class is a copy of another's, multipliers end at 1000."""
    demos = draw_shapes([8, 8], seed=2, spread=0.6)
    arrays = [one.positions for one in demos]
    recognizer = Recognizer(classifier="svm").fit([*arrays, arrays[0]], [*demos.labels, demos.labels[-1]])
    multipliers = np.abs(recognizer.classifier_.model.dual_coef_)
    assert multipliers.max() == pytest.approx(1000.0)


def test_copies_under_two_names_say_nothing_of_how_far_classes_are_apart():
    """Rounding alone tells a copy that was moved and sized from the original: nearer than a thousandth is the same."""
    shapes = [one.positions for one in draw_shapes([1] * 12, seed=3)]
    plain = Recognizer().fit(shapes, range(12))
    copied = Recognizer().fit([*shapes, *(1e3 * x / 7.0 + 5.0 for x in shapes[:8])], range(20))
    assert (copied.widths_ > 0.5 * plain.widths_).all()


def test_a_movement_that_explains_a_beginning_does_so_at_one_in_twenty_values_of_progress():
    """Two of forty perfect ones are evidence 1; unknown is 1.5 impostors away, and three typical differences off."""
    recognizer = Recognizer().fit(draw_shapes([1, 1]))
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early(n_progress=40))
    evidence = np.full((1, 2 * 40), -np.inf)
    evidence[0, :2] = 0.0
    known, other, unknown = stored.log_classes(evidence)[0]
    assert known == pytest.approx(0.0)
    assert other == -np.inf
    assert unknown == pytest.approx(-0.5 * (1.5 / 0.4) ** 2 - 1.5)
