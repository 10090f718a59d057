"""Who made each movement: an array in an archive, or the folder above that of the label."""

import numpy as np
import pytest

import kineme
from kineme.io.reading.merge_files import each_person
from kineme.io.writing.write_movement import write_movement
from kineme_experiments.evaluation.data import load_data


@pytest.fixture
def archive(tmp_path, make_movement):
    """Writes movements of unequal length, one after the other, with the arrays given."""
    movements = [make_movement([k % 2, k], n_samples=40 + k) for k in range(8)]

    def write(name="gestures.npz", **arrays):
        lengths = [len(t) for t, _ in movements]
        np.savez(
            tmp_path / name,
            positions=np.concatenate([x for _, x in movements]),
            times=np.concatenate([t for t, _ in movements]).astype(np.float32),
            offsets=np.concatenate(([0], np.cumsum(lengths))),
            labels=np.array(["wave", "point"] * 4),
            **arrays,
        )
        return tmp_path / name

    return write


@pytest.mark.parametrize("name", ["people", "person", "subjects", "subject"])
def test_an_archive_says_who_made_each_movement(archive, name):
    read = load_data(str(archive(**{name: np.repeat(["1", "2"], 4)})))
    assert read.name == "gestures"
    assert read.people.tolist() == ["1"] * 4 + ["2"] * 4
    assert read.demonstrations.labels.tolist() == ["wave", "point"] * 4
    assert read.demonstrations.lengths.tolist() == list(range(40, 48))


def test_a_movement_that_is_left_out_takes_no_person_along(archive):
    path = archive(people=np.arange(8))
    with np.load(path) as arrays:
        content = dict(arrays)
    content["positions"][40:81] = np.nan  # movement 1
    np.savez(path, **content)
    read = load_data(str(path))
    assert len(read.demonstrations) == 7
    assert read.people.tolist() == ["0", "2", "3", "4", "5", "6", "7"]


def test_nothing_is_known_without_the_array_or_of_one_person(archive):
    assert load_data(str(archive())).people is None
    assert load_data(str(archive(people=np.array(["?"] * 8)))).people is None


@pytest.mark.parametrize("people", [["1", "", "2", "1"] * 2, [1.0, np.nan, 2.0, 1.0] * 2])
def test_a_person_who_is_empty_is_not_told(archive, people):
    path = archive(people=np.array(people))
    assert each_person(path, kineme.read_recordings(path).sources) == ["1", None, "2", "1"] * 2


def test_too_few_people_are_refused(archive):
    with pytest.raises(kineme.errors.DataError, match=r"expected a person for each movement in gestures\.npz, got 3"):
        load_data(str(archive(people=np.array(["a", "b", "c"]))))


def test_the_folder_above_the_label_is_the_person(tmp_path, make_movement):
    for person in ("ann", "bob"):
        for label in ("wave", "point"):
            (tmp_path / person / label).mkdir(parents=True)
            for k in range(2):
                t, x = make_movement([len(label), k])
                write_movement(tmp_path / person / label / f"{k}.csv", {"times": t, "positions": x})
    read = load_data(str(tmp_path))
    assert read.people.tolist() == ["ann"] * 4 + ["bob"] * 4
    assert read.demonstrations.labels.tolist() == (["point"] * 2 + ["wave"] * 2) * 2
    t, x = make_movement(9)
    (tmp_path / "wave").mkdir()
    write_movement(tmp_path / "wave" / "9.csv", {"times": t, "positions": x})
    assert load_data(str(tmp_path)).people is None  # of one movement, nobody knows


def test_the_recordings_for_development_carry_people(development_data):
    gestures = load_data(str(development_data / "gestures3d.npz"))
    assert (len(gestures.demonstrations), gestures.demonstrations.n_dims) == (1000, 3)
    assert sorted(set(gestures.people)) == list("12345")
    letters = load_data(str(development_data / "letters2d.npz"))
    assert len(letters.demonstrations) == 340
    assert letters.people is None  # one writer
