"""`Demonstrations.of` is the one door: whatever holds movements is taken wherever movements are expected."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.model_selection import cross_val_score

import kineme
from kineme import Demonstrations, Trajectory
from kineme.errors import TrajectoryError

T = np.linspace(0.0, 2.0, 40)
X = np.column_stack([np.sin(T), np.cos(3 * T), T**2])


def _same(one, other):
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_array_equal(one.offsets, other.offsets)
    np.testing.assert_array_equal(one.times, other.times)


@pytest.mark.parametrize("one", [X, X[None], [X], np.asfortranarray(X), [X.tolist()]])
def test_one_array_is_one_movement(one):
    _same(Demonstrations.of(one), Demonstrations.from_arrays([X]))


def test_one_flat_array_is_one_movement_of_one_dimension():
    _same(Demonstrations.of(X[:, 0]), Demonstrations.from_arrays([X[:, :1]]))


class _Tensor:
    """An array as PyTorch has them: it iterates over its rows, and does not convert while it has gradients."""

    def __init__(self, values, has_gradients=True):
        self.values, self.has_gradients = values, has_gradients
        self.ndim, self.shape = values.ndim, values.shape

    def __len__(self):
        return len(self.values)

    def __getitem__(self, i):
        return _Tensor(self.values[i])

    def detach(self):
        return _Tensor(self.values, has_gradients=False)

    def __array__(self, dtype=None, copy=None):
        if self.has_gradients:
            raise RuntimeError("Can't call numpy() on Tensor that requires grad")
        return np.asarray(self.values, dtype)


@pytest.mark.parametrize("convert", [_Tensor, memoryview, lambda x: x.astype(object)])
def test_arrays_of_any_package_are_what_arrays_of_numpy_are(convert, letters, recognizer):
    for array in (X, X[:, 0].copy(), np.stack([X, 2 * X])):
        _same(Demonstrations.of(convert(array)), Demonstrations.of(array))
        _same(Demonstrations.from_arrays(convert(array), times=convert(T)), Demonstrations.from_arrays(array, times=T))
    _same(Demonstrations.of([convert(X)]), Demonstrations.of([X]))
    assert recognizer.recognize(convert(letters[3].positions)).label == letters[3].label


def test_an_array_that_does_not_convert_is_refused_in_words():
    tensor = _Tensor(X)
    tensor.detach = lambda: tensor
    with pytest.raises(TrajectoryError, match="expected an array of numbers, got Can't call numpy"):
        Demonstrations.of(tensor)


def test_a_list_is_always_many_movements():
    assert len(Demonstrations.of([X[:, 0], X[:, 1]])) == 2
    assert len(Demonstrations.of([X[:, 0].tolist(), X[:, 1].tolist()])) == 2


def test_lists_of_what_holds_movements_are_one_after_the_other():
    single = Trajectory(T, X, label="a", name="one")
    pair = Demonstrations([single, Trajectory(T + 5, X[:20].repeat(2, 0), label="b", name="two")])
    held = SimpleNamespace(demonstrations=pair)
    demos = Demonstrations.of([single, pair, held])
    assert demos.labels.tolist() == ["a", "a", "b", "a", "b"]
    assert demos.names == ("one", "one", "two", "one", "two")
    _same(demos[[3, 4]], pair)
    _same(Demonstrations.of(held), pair)


@pytest.mark.parametrize("form", ["collections", "blocks", "lists", "lists of arrays", "objects", "frames"])
def test_lists_may_hold_any_form(form):
    demos = Demonstrations.of(np.stack([X, 2 * X]))
    first, second = demos
    frame = Demonstrations.of([first]).to_pandas()
    given = {
        "collections": [demos, demos],
        "blocks": [np.stack([X, 2 * X])] * 2,
        "lists": [[first, second], (first, second)],
        "lists of arrays": [[X, 2 * X]] * 2,
        "objects": np.array([first, second, first, second], dtype=object),
        "frames": [frame, second, frame, second],
    }
    np.testing.assert_array_equal(Demonstrations.of(given[form]).positions, np.concatenate([X, 2 * X] * 2))


def test_names_of_files_are_no_movements():
    with pytest.raises(TrajectoryError, match=r"got 'new.csv'; read files with kineme.read_recordings"):
        Demonstrations.of(["new.csv"])


def test_a_list_may_hold_arrays_beside_trajectories():
    demos = Demonstrations.of([Trajectory(T, X), X, Demonstrations.of([X]), np.stack((X, X))])
    assert len(demos) == 5
    _same(demos[1:2], Demonstrations.of([X]))
    with pytest.raises(
        kineme.errors.TrajectoryError, match="index 1 of the list: the movement: expected at least 4 samples"
    ):
        Demonstrations.of([Trajectory(T, X), X[:2].repeat(40, 1)])


class Endless:
    """A stand-in, as mocks are, that has every attribute."""

    def __getattr__(self, name):
        return Endless()


def test_a_stand_in_that_has_every_attribute_holds_no_movements():
    circle = SimpleNamespace()
    circle.demonstrations = SimpleNamespace(demonstrations=circle)
    for odd in (Endless(), circle):
        with pytest.raises(
            kineme.errors.TrajectoryError, match=rf"expected movements, got {type(odd).__name__}, whose demo"
        ):
            kineme.DMP().learn(odd)


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (3, "an index below 3, got 3; there are 3 movements"),
        (-4, "an index below 3, got -4"),
        ([0, 3], "indices below 3, got 3; there are 3 movements"),
        ([-4], "indices below 3, got -4"),
        ([True, False], "a mask with an entry for each of the 3 movements, got 2"),
        ("a", "a mask with an entry per movement, got 'a'"),
        (1.5, "a mask with an entry per movement, got 1.5"),
        (None, "a mask with an entry per movement, got None"),
        ((0, 1), r"a mask with an entry per movement, got \(0, 1\)"),
        ([[0, 1]], r"a mask with an entry per movement, got \[\[0, 1\]\]"),
        ([0.0], r"a mask with an entry per movement, got \[0.0\]"),
        (True, "a mask with an entry per movement, got True"),
    ],
)
def test_an_index_that_chooses_nothing_is_refused_alike_everywhere(index, words):
    demos = Demonstrations.of([X, X, X])
    primitives = kineme.DMP(n_basis=10).learn(demos)
    for several in (demos, primitives, primitives.rollout(), kineme.orientation.PoseDMP().learn(_poses())):
        with pytest.raises(IndexError, match=f"^expected .*{words}"):
            several[index]


def _poses():
    return np.stack([np.column_stack([np.cos(T), np.sin(T), 0 * T, 0 * T])] * 3)


@pytest.mark.parametrize("index", [("a", "b") == "a", np.bool_(True)])
def test_a_truth_value_is_no_index(index):
    demos = Demonstrations.of([X, X])
    with pytest.raises(
        IndexError, match="expected an index, a slice, a list of indices or a mask with an entry per movement"
    ):
        demos[index]


def test_more_dimensions_than_samples_are_taken_with_time_stamps():
    wide = np.random.default_rng(0).normal(size=(20, 63))  # a hand of 21 joints, for less than a second
    assert Demonstrations.of(Trajectory(np.arange(20) / 30, wide)).n_dims == 63
    assert Demonstrations.from_arrays([wide], times=[np.arange(20) / 30]).n_dims == 63
    assert Demonstrations.of(wide[:, :20]).n_dims == 20


@pytest.fixture(scope="module")
def letters():
    return kineme.load_lasa(["GShape", "CShape", "Line", "NShape"])


@pytest.fixture(scope="module")
def folder(letters, tmp_path_factory):
    """Four movements of each of four letters in CSV files, a folder for each letter."""
    folder = tmp_path_factory.mktemp("recordings")
    for i, one in enumerate(letters):
        if i % 7 < 4:
            path = folder / one.label / f"{i}.csv"
            path.parent.mkdir(exist_ok=True)
            np.savetxt(
                path, np.column_stack((one.times, one.positions))[::8], "%.17g", ",", header="t,x,y", comments=""
            )
    return folder


@pytest.fixture(scope="module")
def recognizer(folder):
    return kineme.Recognizer().fit(kineme.read_recordings(folder))


def test_recordings_are_learned_recognized_and_described(folder, recognizer):
    recordings = kineme.read_recordings(folder)
    demos = recordings.demonstrations
    assert recognizer.classes_.tolist() == ["CShape", "GShape", "Line", "NShape"]
    assert (recognizer.predict(recordings) == demos.labels).all()
    np.testing.assert_array_equal(kineme.DMP().learn(recordings).weights, kineme.DMP().learn(demos).weights)
    rows = kineme.DMPFeatures().fit_transform(recordings)
    np.testing.assert_array_equal(rows, kineme.DMPFeatures().fit_transform(demos))


def test_recordings_and_segmentations_are_sequences_of_movements(folder):
    recordings = kineme.read_recordings(folder)
    assert len(recordings) == len(list(recordings)) == 16
    assert recordings[3].name == recordings.sources[3].path
    assert recordings[2:5].labels.tolist() == list(recordings.labels[2:5])


def test_a_segmentation_is_recognized(letters, recognizer):
    shown = [letters[4], letters[11], letters[25]]
    pauses, start, parts, times = np.arange(60) / 100, 0.0, [], []
    for one in shown:
        x = one.positions - one.positions[0] + (parts[-1][-1] if parts else 0.0)
        parts += [x, np.repeat(x[-1:], len(pauses), axis=0)]
        times += [start + one.times - one.times[0], start + one.duration + 0.01 + pauses]
        start = times[-1][-1] + 0.01
    pieces = kineme.segment(Trajectory(np.concatenate(times), np.concatenate(parts)))
    assert recognizer.predict(pieces).tolist() == [one.label for one in shown]
    assert [one.name for one in pieces] == list(pieces.demonstrations.names)
    _same(pieces[1:], pieces.demonstrations[1:])


def test_a_rollout_to_another_goal_is_recognized(letters, recognizer):
    primitives = kineme.DMP().learn(letters)
    goals = letters.positions[letters.offsets[1:] - 1] + [10.0, -5.0]
    rollout = primitives.rollout(goal=goals, duration=2.0)
    assert (recognizer.predict(rollout) == letters.labels).mean() > 0.9
    assert recognizer.recognize(rollout[0]).label == recognizer.recognize(rollout)[0].label
    _same(Demonstrations.of(rollout), rollout.demonstrations)


def test_scikit_learn_splits_recordings(folder):
    recordings = kineme.read_recordings(folder)
    assert cross_val_score(kineme.Recognizer(), recordings, recordings.labels, cv=2).tolist() == [1.0, 1.0]


def test_what_was_read_says_so(folder):
    assert repr(kineme.read_recordings(folder)) == (
        "Recordings(Demonstrations(16 movements, 2 dims (x, y), 125 samples each, 4 labels), 16 files, 0 problems)"
    )


def test_a_library_learns_recordings(folder, tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(kineme.read_recordings(folder))
        assert [symbol.name for symbol in library.symbols()] == ["CShape", "GShape", "Line", "NShape"]


def _holds_itself():
    one = SimpleNamespace()
    one.demonstrations = one
    return one


NOT_MOVEMENTS = {
    "a number": SimpleNamespace(demonstrations=5),
    "a method": SimpleNamespace(demonstrations=lambda: [X]),
    "a text": SimpleNamespace(demonstrations="recordings"),
    "itself": _holds_itself(),
}


@pytest.mark.parametrize("holder", NOT_MOVEMENTS.values(), ids=NOT_MOVEMENTS)
def test_what_holds_something_else_than_movements_is_refused_alone_and_in_a_list(holder):
    for movements in (holder, [holder, X], [Trajectory(T, X), holder]):
        with pytest.raises(kineme.errors.TrajectoryError, match=r"expected movements as a list of \(T, d\) arrays"):
            Demonstrations.of(movements)
