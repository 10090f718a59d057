"""What the protocols ask, and that they ask all methods the same."""

from dataclasses import replace

import numpy as np
import pytest

from kineme.cli.evaluate import _QUICK_SHOTS
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition.early.evidence import cut
from kineme.recognition.recognizer import Recognizer
from kineme_experiments.evaluation import person_protocols
from kineme_experiments.evaluation import score_split as scoring
from kineme_experiments.evaluation.conditions import STRENGTHS, TOGETHER, robustness_conditions
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.methods import METHODS, DefaultRecognizer, Method, Options
from kineme_experiments.evaluation.protocols import PROTOCOLS, usable_shots
from kineme_experiments.evaluation.score_split import does, score_split
from kineme_experiments.evaluation.spotting import Stretch, concatenate_all
from kineme_experiments.evaluation.trials import TASKS, Settings
from soaking import SOAK, slow

SETTINGS = Settings(splits=2, seed=3, shots=(1, 2))
AVAILABLE = [name for name, one in METHODS.items() if not one.unavailable()]


def data(demonstrations):
    return DataSet("small", demonstrations, {})


class Recording:
    """A contender that records what it was given and knows the right class of every movement."""

    def __init__(self, log):
        self.log = log

    def fit(self, demonstrations):
        self.log.append((demonstrations.positions.copy(), demonstrations.labels.tolist()))

    def classify(self, demonstrations):
        self.log.append((demonstrations.positions.copy(), demonstrations.labels.tolist()))
        return demonstrations.labels, np.arange(len(demonstrations), dtype=float)

    def classify_partial(self, demonstrations):
        return self.classify(demonstrations)[0]

    def spot(self, recording):
        self.log.append((recording.positions.copy(), []))
        return []

    def cluster(self, demonstrations, n_clusters):
        self.log.append((demonstrations.positions.copy(), demonstrations.labels))
        return np.arange(len(demonstrations))


@pytest.fixture
def logs(monkeypatch):
    """Method name -> what it was given; two methods of those names exist."""
    given = {"one": [], "other": []}
    made = {name: Method(name, lambda _, log=log: Recording(log)) for name, log in given.items()}
    monkeypatch.setattr(scoring, "METHODS", made)
    return given


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("index", [0, 1])
def test_every_method_sees_the_same_movements(small, of_people, logs, protocol, index):
    one = of_people if PROTOCOLS[protocol].by_person else data(small)
    scores = [score_split(one, protocol, method, index, SETTINGS) for method in logs]
    assert len(logs["one"]) == len(logs["other"]) >= 2
    for (x, labels), (y, others) in zip(logs["one"], logs["other"], strict=True):
        np.testing.assert_array_equal(x, y)
        assert labels == others
    assert [one._replace(seconds=0) for one in scores[0]] == [one._replace(seconds=0) for one in scores[1]]


@pytest.mark.parametrize(
    "protocol", [name for name, one in PROTOCOLS.items() if name[:4] != "open" and one.task.startswith("classify")]
)
def test_who_knows_everything_is_always_right(of_people, logs, protocol):
    scores = score_split(of_people, protocol, "one", 0, SETTINGS)
    assert scores
    assert all(one.values == {"accuracy": 1.0} for one in scores)


def test_recordings_with_rests_and_without_are_spotted(of_people, monkeypatch):
    """Who finds every movement where it is has precision and recall 1, by oneself and by others."""
    made = []

    def noted(movements, labels, seed, *, rests):
        made.append((rests, concatenate_all(movements, labels, seed, rests=rests)))
        return made[-1][1]

    class Oracle(Recording):
        def spot(self, recording):
            return next(one.truth for one in made[-1][1] if one.recording is recording)

    monkeypatch.setattr(scoring, "concatenate_all", noted)
    monkeypatch.setattr(scoring, "METHODS", {"one": Method("one", lambda _: Oracle([]))})
    scores = score_split(of_people, "spotting", "one", 0, SETTINGS)
    assert [one.values for one in scores] == [{"precision": 1.0, "recall": 1.0}] * 4
    assert [rests for rests, _ in made] == [True, False] * 2
    assert [one.condition.label for one in scores] == [
        "own, with rests", "own, without rests", "others, with rests", "others, without rests",
    ]  # fmt: skip
    assert all(bool(one.transits) is rests for rests, several in made for one in several)


def test_who_made_the_templates_is_told_where_others_did(of_people, monkeypatch):
    """Without, repetitions by one of the others understate how much people differ."""
    told = []
    method = Method("one", lambda options: told.append(options.people) or Recording([]))
    monkeypatch.setattr(scoring, "METHODS", {"one": method})
    score_split(of_people, "spotting", "one", 0, SETTINGS)
    train = [trial.split.train for trial in PROTOCOLS["spotting"].trials(of_people, SETTINGS, 0)]
    *own, one, other = told  # of each trial by oneself, and before, when asked whether it can spot
    assert own == [None] * 3
    np.testing.assert_array_equal(one, of_people.people[train[2]])
    np.testing.assert_array_equal(other, of_people.people[train[3]])
    fitted = DefaultRecognizer(None, of_people.people)
    fitted.fit(of_people.demonstrations)
    # On some processors rounding in single precision depends on where arrays lie in memory.
    expected = Recognizer().fit(of_people.demonstrations, groups=of_people.people).calibration()
    np.testing.assert_allclose(fitted.recognizer.calibration().scales, expected.scales, rtol=1e-6)


def test_movements_of_unknown_classes_must_not_be_found(of_people, monkeypatch):
    trial = next(iter(PROTOCOLS["spotting"].trials(of_people, SETTINGS, 0)))
    known = np.arange(len(trial.split.test)) % 2 == 0
    half = replace(trial, split=trial.split._replace(known=known))

    class FindsAll(Recording):
        def spot(self, recording):
            return [Stretch(*one[:2], one.label or "class 0") for one in made[0].truth]

    made = []
    inner = concatenate_all
    monkeypatch.setattr(scoring, "concatenate_all", lambda *args, rests: made.extend(inner(*args, rests=rests)) or made)
    [scores] = scoring._spot(FindsAll([]), half, [0, 0])
    assert scores.values == {"precision": known.mean(), "recall": 1.0}


#: Each protocol by kineme, each method in one protocol, and what a method does not do; `make soak` tries all.
THROUGH = [
    (protocol, method)
    for protocol in PROTOCOLS
    for method in AVAILABLE
    if SOAK or method == "kineme" or protocol == "few-shot" or (protocol, method) == ("earliness", "paper")
]


@pytest.mark.parametrize(("protocol", "method"), THROUGH)
def test_every_method_goes_through_every_protocol_and_recognizes_what_is_easy(of_people, protocol, method):
    scores = score_split(of_people, protocol, method, 0, SETTINGS)
    if not does(method, PROTOCOLS[protocol].task):
        assert not scores
        return
    assert scores
    if protocol == "anchoring":
        assert 0 <= scores[0].values["adjusted_rand_given"] <= 1
        return
    assert all(0 <= value <= 1 for one in scores for value in one.values.values())
    if protocol in {"few-shot", "cross-validation", "leave-one-out", "user-dependent", "user-independent"}:
        assert np.mean([one.values["accuracy"] for one in scores]) > 0.9


@pytest.mark.parametrize("method", AVAILABLE)
def test_two_classes_one_movement_each(make_small, method):
    two = make_small(n_classes=2, n_each=2)
    assert score_split(data(two), "few-shot", method, 0, Settings(1, 0, (1,)))[0].values["accuracy"] >= 0.5


@pytest.mark.parametrize("method", AVAILABLE)
def test_familiarity_is_higher_for_what_was_trained_on(small, method):
    contender = METHODS[method].make(Options())
    known = small.labels != "class 3"
    contender.fit(small[known])
    _, familiarity = contender.classify(small)
    assert np.median(familiarity[known]) > np.median(familiarity[~known])


def test_robustness_grows():
    conditions = robustness_conditions(2)
    assert len(conditions) == 1 + 3 * len(STRENGTHS) + len(TOGETHER)
    for kind in [*STRENGTHS, "together"]:
        own = [one.strength for one, _ in conditions if one.varied == kind and one.strength > 0]
        assert own == sorted(own)
        assert len(own) == 3
    assert len({one for one, _ in conditions}) == len(conditions)


@pytest.mark.soak
@pytest.mark.parametrize("d", [slow(1), 5])
def test_other_dimensions_are_not_turned(make_small, d, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for these alone would take longer than all else
    conditions = robustness_conditions(d)
    assert all(perturbation.rotation == 0 for _, perturbation in conditions)
    demos = make_small(n_dims=d)
    assert "2 or 3 dimensions, these have" in PROTOCOLS["any-angle"].unsuitable(data(demos))
    for protocol in ("robustness", "open-set"):
        assert score_split(data(demos), protocol, "kineme", 0, SETTINGS)


def test_an_open_set_needs_two_known_and_two_unknown_classes(make_small):
    assert PROTOCOLS["open-set"].unsuitable(data(make_small(3))) == "needs at least 4 classes, these are 3"
    assert PROTOCOLS["open-set"].unsuitable(data(make_small(4))) == ""


def test_shots_leave_every_class_something_to_test(small):
    assert usable_shots(small, (5, 1, 9)) == (1, 3)


def test_beginnings_end_where_that_share_of_the_path_does(small):
    whole = Perturbation().apply(small, 0)
    for fraction in (0.2, 0.5, 1.0):
        for part, full in zip(cut(small, fraction), whole, strict=True):
            n = len(part)
            np.testing.assert_allclose(part.positions, full.positions[:n] - full.positions[0], atol=1e-9)
            np.testing.assert_allclose(part.times, full.times[:n] - full.times[0], atol=1e-12)
            steps = np.linalg.norm(np.diff(full.positions, axis=0), axis=1)
            share = steps[: n - 1].sum() / steps.sum()
            assert fraction - 0.03 < share <= fraction + 2e-3
    np.testing.assert_array_equal(cut(small, 0.5).labels, small.labels)


def test_who_answers_early():
    assert all(does("kineme", task) for task in TASKS)
    early = {name for name in AVAILABLE if does(name, "classify partial")}
    assert {"kineme", "euclidean", "plus-cloud"} <= early
    assert not early & {"paper", "paper-bio", "gak-svm", "hmm"}


@pytest.mark.parametrize("method", ["euclidean", "plus-cloud"])
def test_rivals_learn_the_beginnings_to_answer_early(small, method):
    contender = METHODS[method].contender(Options(), "classify partial")
    contender.fit(small[::4])
    for share in (0.5, 0.7):
        assert contender.classify_partial(cut(small[::4], share)).tolist() == small.labels[::4].tolist()


@pytest.mark.parametrize("name", ["earliness-by-person", "spotting"])
def test_captions_say_how_many_movements_train(name):
    words = f"{max(person_protocols._SOME_SHOTS)} by default and {max(_QUICK_SHOTS)} with --quick"
    assert words in PROTOCOLS[name].description.replace("\n", " ")
