"""Labels and people from the names of files and folders."""

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.errors import SpecificationError
from kineme.io.reading.merge_files import each_person
from kineme.io.reading.recordings import NameRule, match

PATTERN = "{person}_{label}_{n}.csv"
TEXTS = st.text(st.sampled_from("abc-é.*("), min_size=1, max_size=8)


def _write(path, amplitude=1.0, label=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    head, more = ("t,x,y,label", f",{label}") if label else ("t,x,y", "")
    path.write_text("\n".join([head, *(f"{k / 10},{amplitude * k},{k * k}{more}" for k in range(12))]))


def test_a_pattern_says_label_and_person_and_what_does_not_match_is_a_problem(tmp_path):
    for k, name in enumerate(("ann_wave_1.csv", "bob_wave_hand_12.csv", "notes.csv")):
        _write(tmp_path / name, k + 1)
    read = kineme.read_recordings(tmp_path, label_pattern=PATTERN)
    assert read.labels.tolist() == ["wave", "wave_hand"]
    assert read.people == ["ann", "bob"]
    assert [str(problem) for problem in read.problems] == [
        "notes.csv: expected a name like {person}_{label}_{n}.csv, as the label pattern says, got notes.csv"
    ]


def test_a_pattern_with_slashes_is_compared_with_folders_also_of_one_file(tmp_path):
    _write(tmp_path / "ann" / "wave 1.csv")
    for what in (tmp_path, tmp_path / "ann", tmp_path / "ann" / "wave 1.csv"):
        read = kineme.read_recordings(what, label_pattern="{person}/{label} {n}.csv")
        assert (read.labels.tolist(), read.people) == (["wave"], ["ann"])


def test_a_pattern_with_a_person_alone_leaves_the_labels(tmp_path):
    _write(tmp_path / "wave" / "ann-1.csv")
    read = kineme.read_recordings(tmp_path, label_pattern="{person}-{n}.csv")
    assert (read.labels.tolist(), read.people) == (["wave"], ["ann"])


def test_the_person_is_the_folder_beside_that_of_the_label(tmp_path):
    for k, person in enumerate(("ann", "bob")):
        _write(tmp_path / "label first" / "wave" / person / "1.csv", k + 1)
        _write(tmp_path / "person first" / person / "wave" / "1.csv", k + 1)
    for name, by in (("label first", 2), ("person first", None)):
        read = kineme.read_recordings(tmp_path / name, label_by=by)
        assert read.labels.tolist() == ["wave", "wave"]
        assert each_person(tmp_path / name, read.sources) == ["ann", "bob"]


def test_labels_by_level_folder_or_task(tmp_path):
    _write(tmp_path / "wave" / "ann" / "1.csv")
    _write(tmp_path / "wave" / "ann" / "2.csv", 2, "inside")

    def labels(by, path=tmp_path):
        return kineme.read_recordings(path, label_by=by).labels.tolist()

    assert labels(None) == ["ann", "inside"]
    assert labels("folder") == labels(1) == ["ann", "ann"]
    assert labels(2) == ["wave", "wave"]
    assert labels("task") == [None, "inside"]
    assert labels("folder", tmp_path / "wave" / "ann" / "1.csv") == ["ann"]
    assert labels(2, tmp_path / "wave" / "ann") == ["wave", "wave"]


@given(TEXTS, TEXTS, st.integers(0, 10**6))
def test_names_written_by_a_pattern_are_read_by_it(person, label, n):
    assert match(NameRule(PATTERN).parts, PATTERN.format(person=person, label=label, n=n)) == {
        "person": person, "label": label, "n": str(n)
    }  # fmt: skip


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("a.{label}", "axb", None),  # a dot is a dot
        ("({label}|*).csv", "(w|*).csv", {"label": "w"}),
        ("{{{label}}}", "{w}", {"label": "w"}),
        ("{label}_{n}", "w_1x", None),
        ("{label}_{n}", "_1", None),
        ("{label}", "a/b", None),
        ("{label}_{take}", "a_b_c", {"label": "a", "take": "b_c"}),
    ],
)
def test_patterns_are_literal_but_for_their_fields(pattern, name, expected):
    assert match(NameRule(pattern).parts, name) == expected


@pytest.mark.parametrize(
    "pattern",
    [
        "",
        "wave.csv",
        "{n}.csv",
        "{label",
        "{label}{n}",
        "{label}_{label}",
        "{label!r}",
        "{label:3}",
        "{}",
        "{a b}_{label}",
    ],
)
def test_patterns_that_cannot_be_understood_are_refused(pattern):
    with pytest.raises(SpecificationError, match="fields in braces as label_pattern"):
        NameRule(pattern)


@pytest.mark.parametrize("by", [0, -1, True, "level", 1.5, ""])
def test_wrong_levels_are_refused(by):
    with pytest.raises(SpecificationError, match="expected label_by"):
        NameRule(label_by=by)


def test_two_sources_of_labels_are_refused(tmp_path):
    with pytest.raises(SpecificationError, match="not both"):
        NameRule("{label}.csv", 1)
    with pytest.raises(SpecificationError, match="not both"):
        kineme.read_recordings(tmp_path, label="a", label_by="folder")


def test_no_name_takes_long():
    parts = NameRule("_".join(f"{{f{k}}}" for k in range(9)) + "_{label}!").parts
    before = time.process_time()
    assert match(parts, "_" * 255) is None
    assert time.process_time() - before < 2


def test_levels_above_the_root_name_nothing():
    assert NameRule(label_by=400).label_by == 400
    from kineme.io.reading.recordings import _folder

    assert _folder(Path("/a/b.csv"), 2) is None
