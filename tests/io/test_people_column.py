"""Who showed a movement, from a column of a table."""

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme.errors import DataError, SpecificationError

ROWS = [
    (person, label, k / 10, k * size, k * k)
    for person, label, size in (("ann", "wave", 1), ("ann", "nod", 2), ("bob", "nod", 3), ("ann", "wave", 4))
    for k in range(10)
]


def write_frame(path, columns):
    frame = pd.DataFrame(columns)
    if path.suffix == ".parquet":
        frame.to_parquet(path)
    elif path.suffix == ".npy":
        np.save(path, frame.to_records(index=False))
    elif path.suffix == ".jsonl":
        frame.to_json(path, orient="records", lines=True)
    else:
        frame.to_csv(path, index=False)
    return path


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["who,label,t,x,y", *(",".join(map(str, row)) for row in ROWS)]))
    return path


def test_a_movement_begins_where_the_person_or_the_label_changes(table):
    read = kineme.read_recordings(table, person="who")
    assert read.people == ["ann", "ann", "bob", "ann"]
    assert list(read.labels) == ["wave", "nod", "nod", "wave"]
    assert read.demonstrations.dimensions == ("x", "y")
    assert [source.place for source in read.sources] == ["0", "1", "2", "3"]
    assert read.detected[0][0].person == ("who",)


def test_people_of_movements_that_columns_tell_apart(tmp_path):
    """Rows of one movement stand anywhere; a fault costs its movement alone, with its person."""
    rows = [
        f"{k / 10},{demo},{who},{k + demo},{k * k}" for k in range(10) for demo, who in enumerate(("ann", "bob", ""))
    ]
    rows[3] = "0.1,0,ann,oops,1"
    (tmp_path / "a.csv").write_text("\n".join(["t,demo,who,x,y", *rows]))
    read = kineme.read_recordings(tmp_path / "a.csv", person="who", movement="demo")
    assert read.people == ["bob", None]
    assert len(read.problems) == 1
    assert kineme.read_recordings(tmp_path / "a.csv", movement="demo", columns=["x", "y"]).people is None


def test_a_column_of_subjects_that_tells_movements_apart_names_people_too(tmp_path):
    rows = [f"{subject},{k / 10},{k},{k * subject}" for subject in (1, 2) for k in range(10)]
    (tmp_path / "a.csv").write_text("\n".join(["subject,t,x,y", *rows]))
    read = kineme.read_recordings(tmp_path / "a.csv", person="subject")
    assert (read.people, read.demonstrations.dimensions) == (["1", "2"], ("x", "y"))


@pytest.mark.parametrize("ending", ["csv", "parquet", "jsonl"])
def test_people_may_be_numbers_in_a_column_of_any_name(tmp_path, ending):
    """Their column is no coordinate."""
    columns = {"pid": np.repeat([7, 8], 10), "t": np.tile(np.arange(10) / 10, 2), "x": np.arange(20.0) ** 2}
    path = write_frame(tmp_path / f"a.{ending}", columns)
    assert kineme.read_recordings(path, person="pid").demonstrations.dimensions == ("x",)


@pytest.mark.parametrize("ending", ["csv", "parquet", "jsonl", "npy"])
@pytest.mark.parametrize("last", [2.0, np.nan])
def test_numbers_that_name_movements_labels_and_people_are_the_same_texts_in_every_format(tmp_path, ending, last):
    """A column of floats, as pandas makes it of whole numbers beside empty cells, names them without fractions."""
    columns = {"trial": np.repeat([0.0, 1.0, 2.0], 10), "label": np.repeat([1.0, 2.0, last], 10)}
    columns |= {"who": np.repeat([7.0, 8.0, last], 10), "t": np.tile(np.arange(10) / 10, 3), "x": np.arange(30.0) ** 2}
    read = kineme.read_recordings(write_frame(tmp_path / f"a.{ending}", columns), person="who", movement="trial")
    name = "2" if last == 2.0 else None
    assert [source.place for source in read.sources] == ["0/7", "1/8", f"2/{name or ''}"]
    assert [source.label for source in read.sources] == ["1", "2", name]
    assert read.people == ["7", "8", name]


def test_texts_that_are_no_whole_numbers_stay_as_they_are(tmp_path):
    columns = {"trial": np.repeat(["1.0", "1.5"], 10), "label": np.repeat(["v1.0", "2.0"], 10)}
    columns |= {"t": np.tile(np.arange(10) / 10, 2), "x": np.arange(20.0) ** 2}
    read = kineme.read_recordings(write_frame(tmp_path / "a.csv", columns))
    assert [(source.place, source.label) for source in read.sources] == [("1.0", "v1.0"), ("1.5", "2.0")]


@pytest.mark.parametrize("choice", [{"movement": "subject"}, {"label": "shape"}])
def test_columns_of_movements_and_labels_are_no_coordinates_beside_those_that_are_chosen(tmp_path, choice):
    columns = {"subject": np.repeat([1, 2], 10), "trial": np.repeat([3, 4], 10), "class": np.repeat([5, 6], 10)}
    columns |= {"t": np.tile(np.arange(10) / 10, 2), "x": np.arange(20.0) ** 2, "shape": np.repeat(["o", "l"], 10)}
    del columns["trial" if "label" in choice else "class"]
    read = kineme.read_recordings(write_frame(tmp_path / "a.csv", columns), **choice)
    assert read.demonstrations.dimensions == ("x",)


@pytest.mark.parametrize(("person", "words"), [("nobody", "expected a column 'nobody'")])
def test_a_column_that_is_not_there_is_refused(table, person, words):
    with pytest.raises(DataError, match=words):
        kineme.read_recordings(table, person=person)


def test_a_file_without_columns_has_no_people_in_one(tmp_path, table):
    np.savez(tmp_path / "a.npz", positions=np.random.default_rng(0).normal(size=(3, 10, 2)), people=["a", "b", "c"])
    with pytest.raises(DataError, match="expected a column 'people' of a table that names people"):
        kineme.read_recordings(tmp_path / "a.npz", person="people")
    with pytest.raises(SpecificationError, match="not both"):
        kineme.read_recordings(table, person="who", label_pattern="{person}.csv")
