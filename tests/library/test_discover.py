"""Kinds of movements in episodes without examples, their names, and proposals of a library."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from kineme.anchoring.clustering import adjusted_rand
from kineme.errors import DataError, TrajectoryError
from kineme.library.discover import annotations_of, discover, propose_names, state_of, store_discovery, times_of
from kineme.library.library import ActionLibrary
from kineme.library.proposals import stored_proposals
from kineme.library.storage.verify import _version as strange_versions
from kineme.recognition.recognizer import Recognizer
from work_samples import NAMES, TASKS, work_episode, work_episodes

KEPT = Recognizer(translation=False, scale="none", max_angle=0.0)


def _beside(discovery, truth):
    """Kind in truth and kind discovered of each movement of the truth, by the longest overlap; and spans by episode."""
    spans = {}
    for segment in discovery.segments:
        spans.setdefault(segment.episode, []).append((segment.start, segment.end, segment.kind))
    pairs = [
        (name, max(spans[number], key=lambda span: min(end, span[1]) - max(start, span[0]))[2])
        for number, own in enumerate(truth)
        for start, end, name in own
    ]
    names, kinds = zip(*pairs, strict=True)
    return np.unique(names, return_inverse=True)[1], np.array([-1 if kind is None else kind for kind in kinds]) + 1


@pytest.fixture(scope="module")
def worked():
    episodes, truth = work_episodes(16)
    return episodes, truth, discover(episodes)


def test_kinds_are_those_of_the_truth_though_each_episode_holds_each_once(worked):
    _, truth, discovery = worked
    assert len(discovery.kinds) == sum(map(len, TASKS.values()))
    assert adjusted_rand(*_beside(discovery, truth)) >= 0.95


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(5))
def test_kinds_are_those_of_the_truth_for_other_noise(seed):
    episodes, truth = work_episodes(24, seed=seed + 10, noise=0.003)
    assert adjusted_rand(*_beside(discover(episodes), truth)) >= 0.9


def test_kinds_say_what_they_follow_and_how_long_they_last(worked):
    _, _, discovery = worked
    first, *others = (kind for kind in discovery.kinds if kind.tasks == ("pick the cube",))
    assert dict(first.follows) == {"begin": 1.0}
    before = [first, *others]
    for kind, previous in zip(others, before, strict=False):
        assert max(kind.follows, key=lambda pair: pair[1])[0] == previous.name
        assert kind.times == 8
    assert 1.2 < first.seconds < 2.0
    assert discovery.grammar.symbols == tuple(kind.name for kind in discovery.kinds)


def test_the_result_is_plain_data(worked):
    _, _, discovery = worked
    data = json.loads(json.dumps(discovery.to_dict(), allow_nan=False))
    names = {kind["name"] for kind in data["kinds"]}
    assert {segment["kind"] for segment in data["segments"]} <= names | {None}
    assert data["episodes"] == 16
    notes = annotations_of(discovery, "set")
    assert [note.symbol for note in notes] == [segment["kind"] for segment in data["segments"]]
    assert all(0 < note.p_value <= 1 and 0 <= note.confidence <= 1 for note in notes)


def test_kinds_of_a_part_are_given_to_all(worked):
    episodes, truth, _ = worked
    discovery = discover(episodes, n_learned=60)
    assert {segment.episode for segment in discovery.segments} == set(range(16))
    assert adjusted_rand(*_beside(discovery, truth)) >= 0.9


def test_names_are_those_of_tasks():
    tasks = ("pick the red cube", "pick the blue cube", "wipe the table")
    assert propose_names([tasks, tasks[:2], tasks[2:], tasks[2:], ()], tasks) == (
        "motion 1", "pick cube", "wipe the table 1", "wipe the table 2", "motion 2",
    )  # fmt: skip
    assert propose_names([("pour",), ("pour",)], ["pour"]) == ("pour 1", "pour 2")
    assert propose_names([("",), ("",)], [""]) == ("motion 1", "motion 2")


def test_stamps_that_go_back_are_replaced_by_the_declared_rate():
    episode, _ = work_episode(0, "pick the cube")
    stuck = replace(episode, times=np.minimum(episode.times, 1.0))
    np.testing.assert_allclose(times_of(stuck), episode.times, atol=1e-9)
    np.testing.assert_array_equal(times_of(episode), episode.times)
    rounded = replace(episode, times=episode.times.astype(np.float32).astype(float))  # as LeRobot stores them
    np.testing.assert_array_equal(times_of(rounded), np.arange(len(episode)) / episode.fps)
    with pytest.raises(DataError, match="stamps that increase"):
        times_of(replace(stuck, fps=float("nan")))


def test_the_state_is_a_feature_without_its_empty_columns():
    episode, _ = work_episode(0, "pick the cube")
    heads, state = state_of(episode)
    assert heads == tuple(NAMES)  # as `kineme learn` and `kineme annotate` call them
    holed = episode.signals["observation.state"].copy()
    holed[:, 1] = np.nan
    heads, state = state_of(replace(episode, signals={"observation.state": holed}))
    assert state.shape[1] == len(heads) == len(NAMES) - 1
    assert state_of(episode, "action")[0][0].startswith("action.")
    assert state_of(replace(episode, signals={"action": holed}))[0][0].startswith("action.")
    parts = {"observation.robot0_joint_pos": holed[:, 2:4], "observation.robot0_gripper_qpos": holed[:, 6:]}
    several = replace(
        episode,
        signals=parts | {"observation.robot0_joint_vel": holed, "action": holed},
        names={name: [str(k) for k in range(values.shape[1])] for name, values in parts.items()},
    )
    heads, state = state_of(several)
    assert heads[-1] == "observation.robot0_gripper_qpos.0"
    np.testing.assert_array_equal(state, holed[:, [2, 3, 6]])
    with pytest.raises(DataError, match="--feature"):
        state_of(episode, "wrist")


def test_episodes_that_cannot_be_used_are_problems(worked):
    episodes, _, discovery = worked
    short = replace(episodes[0], number=98, place="episode 98", times=episodes[0].times[:2], fps=float("nan"))
    other = replace(episodes[0], number=99, place="episode 99", names={"observation.state": [*NAMES[1:], "tail"]})
    with_bad = discover([*episodes, short, other])
    assert [problem.partition(":")[0] for problem in with_bad.problems] == ["episode 98", "episode 99"]
    assert [kind.times for kind in with_bad.kinds] == [kind.times for kind in discovery.kinds]
    with pytest.raises(DataError, match="episodes with movements"):
        discover([short])
    signals = {"observation.state": episodes[0].signals["observation.state"][:50]}
    with pytest.raises(DataError, match="give more episodes"):
        discover([replace(episodes[0], times=episodes[0].times[:50], signals=signals)])


def test_kinds_become_proposals_that_a_person_accepts(worked, tmp_path):
    episodes, _, discovery = worked
    with ActionLibrary(tmp_path / "actions", create=True, recognizer=KEPT) as library:
        done = []
        store_discovery(library.store, iter(episodes), discovery, progress=done.append)
        assert done[-1] == len(episodes)
        proposals = library.propose()
        assert [proposal.name for proposal in proposals] == [kind.name for kind in discovery.kinds]
        assert [len(proposal) for proposal in proposals] == [kind.times for kind in discovery.kinds]
        assert all(proposal.medoid in proposal.members for proposal in proposals)
        assert all(0 <= proposal.cohesion <= 1 and proposal.nearest is not None for proposal in proposals)
        name = library.movements(ids=proposals[0].members[:1]).names[0]
        assert name.startswith("episode")

        library.accept(proposals[0], "reach")
        library.reject(proposals[1])
        assert [proposal.name for proposal in library.propose()] == [kind.name for kind in discovery.kinds[2:]]
        assert library["reach"].prototype == proposals[0].medoid
        assert library.verify() == []
    with ActionLibrary(tmp_path / "actions", read_only=True) as library:
        assert len(library.propose()) == len(discovery.kinds) - 2


def test_other_movements_are_clustered_behind_what_is_stored(worked, tmp_path):
    episodes, _, discovery = worked
    with ActionLibrary(tmp_path / "actions", create=True, recognizer=KEPT) as library:
        store_discovery(library.store, episodes, discovery)
        n, rng = len(discovery.kinds), np.random.default_rng(0)
        t = np.linspace(0.0, 1.0, 40)[:, None]
        others = [5.0 + (k % 2) * t + 3.0 * t**2 + 0.01 * rng.normal(size=(1, len(NAMES))) for k in range(12)]
        ids = library.learn(others).ids
        proposals = library.propose()
        assert [proposal.name for proposal in proposals][:n] == [kind.name for kind in discovery.kinds]
        behind = [proposal for proposal in proposals if proposal.name is None]
        assert behind
        assert set(np.concatenate([proposal.members for proposal in behind])) <= set(ids)
        assert all(proposal.nearest >= n for proposal in behind if proposal.nearest is not None)


def test_storing_again_replaces_what_was_proposed_and_undo_takes_it_back(worked, tmp_path):
    episodes, _, discovery = worked
    with ActionLibrary(tmp_path / "actions", create=True, recognizer=KEPT) as library:
        store_discovery(library.store, episodes, discovery)
        renamed = replace(discovery, kinds=tuple(kind._replace(name=f"again {kind.name}") for kind in discovery.kinds))
        n = len(library)
        store_discovery(library.store, episodes, renamed)
        assert len(library) == n
        assert {proposal.name for proposal in library.propose()} == {kind.name for kind in renamed.kinds}
        library.undo()
        assert [proposal.name for proposal in library.propose()] == [kind.name for kind in discovery.kinds]
        library.undo(to=0)
        assert stored_proposals(library.store) == []


def test_discovering_again_leaves_no_pieces_of_the_run_before(worked, tmp_path):
    episodes, _, discovery = worked
    again = replace(discovery, segments=tuple(each._replace(end=each.end - 0.1) for each in discovery.segments))
    with ActionLibrary(tmp_path / "other", create=True, recognizer=KEPT) as other:
        store_discovery(other.store, episodes, discovery)
        shown = other.movements()
    with ActionLibrary(tmp_path / "actions", create=True, recognizer=KEPT) as library:
        held = library.learn(shown[[0]], [None]).ids  # a movement that discoveries did not bring
        store_discovery(library.store, episodes, discovery)
        library.accept(library.propose()[-1], "kept")
        kept, version = {*library["kept"].members}, library.version

        def check():
            store_discovery(library.store, episodes, again)
            proposed = {key for each in stored_proposals(library.store) for key in each.members}
            assert {*library.ids()} == {*proposed, *kept, *held}
            assert len(proposed) == len(discovery.segments)
            assert not proposed & {*kept, *held}

        check()
        library.undo()
        assert library.history()[-1].detail["to"] == version
        assert [each.name for each in library.propose()] == [kind.name for kind in discovery.kinds[:-1]]
        check()  # what came back by the undo has other ids
        assert library.verify() == []


def test_a_library_of_other_columns_is_refused(worked, tmp_path):
    episodes, _, discovery = worked
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn([np.random.default_rng(0).normal(size=(20, 2)) for _ in range(3)])
        with pytest.raises(TrajectoryError, match="dimensions"):
            store_discovery(library.store, episodes, discovery)
        assert library.version == 1


@pytest.mark.soak
def test_discovered_movements_do_not_join_symbols_that_merely_look_alike(worked, tmp_path):
    episodes, _, discovery = worked
    with ActionLibrary(tmp_path / "actions", create=True) as library:  # that takes out place and size
        store_discovery(library.store, episodes, discovery)
        library.accept(library.propose()[0], "reach")
        assert library.join() == {}


@pytest.mark.parametrize(
    "wrong",
    [
        {"sizes": [1]},
        {"sizes": [0, 2]},
        {"movements": ["1", "2"]},
        {"names": ["a"]},
        {"medoids": None},
        {"sizes": [2, 1]},
    ],
)
def test_damaged_proposals_are_problems(wrong):
    detail = {
        "names": ["a", "b"], "sizes": [1, 1], "medoids": [1, 2], "certainties": [1.0, 0.5], "movements": [1, 2],
    }  # fmt: skip
    assert not list(strange_versions([(1, "", "discover", json.dumps(detail))]))
    assert list(strange_versions([(1, "", "discover", json.dumps(detail | wrong))]))


def test_linear_algebra_of_few_numbers_runs_in_one_thread(worked):
    """A second thread waits actively: discovering an hour took nine times as many core-seconds with two."""
    from threadpoolctl import threadpool_info, threadpool_limits

    threads = []

    def watched():
        for episode in worked[0]:
            threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
            yield episode

    with threadpool_limits(limits=2, user_api="blas"):
        discover(watched())
    assert set(threads) == {1}
