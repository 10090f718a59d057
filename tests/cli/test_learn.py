"""``kineme learn`` on real recordings written out as files, as people have them."""

from __future__ import annotations

import shutil
from unicodedata import normalize

import numpy as np
import pytest
from commands import answer, run, start

import kineme
from kineme.io.writing.write_movement import write_movement


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa(["CShape", "GShape"])


@pytest.fixture
def recordings(demos, tmp_path):
    for i, one in enumerate(demos):
        folder = tmp_path / "recordings" / str(one.label)
        folder.mkdir(parents=True, exist_ok=True)
        write_movement(folder / f"{i}.csv", {"times": one.times, "positions": one.positions})
    return tmp_path / "recordings"


def test_a_folder_of_folders_becomes_symbols(recordings, demos, tmp_path):
    learned = answer("learn", recordings, "-l", tmp_path / "actions")
    assert (learned["added"], learned["duplicates"], learned["problems"]) == (14, 0, [])
    assert sorted(learned["symbols"]) == ["CShape", "GShape"]
    with kineme.ActionLibrary(tmp_path / "actions", read_only=True) as library:
        stored = library.movements("GShape")
    expected = demos[demos.labels == "GShape"]
    by_name = dict(zip(stored.names, stored, strict=True))
    for i, one in enumerate(expected, start=7):
        again = by_name[f"GShape/{i}.csv"]
        np.testing.assert_allclose(again.positions, one.positions, atol=1e-5)  # single precision, mm
        np.testing.assert_allclose(again.times, one.times, atol=1e-6)


def test_folders_whose_names_look_the_same_are_one_symbol(recordings, tmp_path):
    """As of two file systems, one of which decomposes names."""
    for name, form in (("CShape", "NFC"), ("GShape", "NFD")):
        (recordings / name).rename(recordings / normalize(form, "café"))
    learned = answer("learn", recordings, "-l", tmp_path / "actions")
    assert (learned["added"], learned["symbols"], learned["kept"]) == (14, [normalize("NFC", "café")], [])


@pytest.mark.parametrize(
    ("columns", "keys"),
    [("label,movement", ["a,0", "a,1", "b,0", "b,1"]), ("movement,trial", ["a/b,c", "a,b/c", "a,b\\/c", "a\\/b,c"])],
)
def test_every_movement_of_a_long_table_is_learned(demos, tmp_path, columns, keys):
    """Also where each action counts its movements from 0."""
    rows = [
        f"{key},{t},{x},{y}"
        for key, one in zip(keys, demos, strict=False)
        for t, (x, y) in zip(one.times.tolist(), one.positions.tolist(), strict=True)
    ]
    (tmp_path / "long.csv").write_text("\n".join([f"{columns},t,x,y", *rows]))
    options = ["--movement", columns] if "label" not in columns else []
    learned = answer("learn", tmp_path / "long.csv", "-l", tmp_path / "actions", *options)
    assert (learned["added"], learned["duplicates"]) == (4, 0)
    again = answer("learn", tmp_path / "long.csv", "-l", tmp_path / "actions", *options)
    assert (again["added"], again["duplicates"]) == (0, 4)


def test_a_movement_tells_the_file_that_it_comes_from(recordings, tmp_path):
    answer("learn", "recordings/GShape/7.csv", "recordings", "--label", "g", "-l", "actions", cwd=tmp_path)
    shown = answer("library", "show", "g", "-l", "actions", cwd=tmp_path)["members"]
    assert {one["source"] for one in shown} == {
        path.relative_to(tmp_path).as_posix() for path in recordings.rglob("*.csv")
    }


def test_learning_again_adds_nothing_also_from_another_place(recordings, tmp_path):
    library = tmp_path / "actions"
    answer("learn", recordings, "-l", library)
    assert answer("learn", recordings, "-l", library)["duplicates"] == 14
    moved = recordings.rename(tmp_path / "elsewhere")
    again = answer("learn", moved, moved / "CShape" / "0.csv", "-l", library)
    assert (again["added"], again["duplicates"], again["movements"]) == (
        0,
        14,
        14,
    )  # a file that is named twice counts once


def test_what_cannot_be_read_is_listed_and_the_rest_is_learned(recordings, tmp_path):
    (recordings / "CShape" / "bad.csv").write_text("time,x,y\n0,1,2\n1,2,oops\n")
    learned = answer("learn", recordings, "-l", tmp_path / "actions")
    assert learned["added"] == 14
    assert learned["problems"] == ["CShape/bad.csv, line 3: expected a number in 'y', got 'oops'"]
    text = run("learn", recordings, "-l", tmp_path / "actions").stdout
    assert "14 stored already" in text
    assert "left out CShape/bad.csv, line 3" in text


def test_a_gripper_beside_which_joints_hardly_count_is_said(tmp_path):
    rows = "".join(f"{k / 20},{k / 20},{k / 10},{4 * k}\n" for k in range(21))
    (tmp_path / "pick.csv").write_text("t,j1,j2,gripper\n" + rows)
    command = ("learn", tmp_path / "pick.csv", "--label", "pick", "-l", tmp_path / "actions")
    (note,) = answer(*command)["notes"]
    assert f"note: {note}" in run(*command)[1]
    assert answer(*command[:-1], tmp_path / "others", "--kind", "gripper=discrete")["notes"] == []


def test_points_that_columns_name_are_said(tmp_path):
    heads = [f"{side}_hand_{axis}" for side in ("left", "right") for axis in "xyz"]
    rows = np.column_stack((np.arange(40) / 20, np.sin(np.arange(40)[:, None] * np.arange(1, 7) / 20)))
    np.savetxt(tmp_path / "wave.csv", rows, delimiter=",", header=",".join(["time", *heads]), comments="")
    words = "2 points that turn together: left_hand, right_hand"
    assert words in run("inspect", tmp_path / "wave.csv").stdout
    assert f"note: {words}" in run("learn", tmp_path / "wave.csv", "-l", tmp_path / "actions").stdout


def test_labels_can_be_given_or_left_out(recordings, tmp_path):
    library = tmp_path / "actions"
    assert answer("learn", recordings / "CShape", "--no-labels", "-l", library)["symbols"] == []
    assert answer("library", "list", "-l", library)["unlabeled"] == 7
    assert answer("learn", recordings / "GShape", "--label", "gee/../", "-l", library)["symbols"] == ["gee/../"]
    listed = answer("library", "list", "-l", library)
    assert [(one["name"], one["movements"]) for one in listed["symbols"]] == [("gee/../", 7)]
    labeled_later = answer("learn", recordings, "-l", library)
    assert (labeled_later["added"], labeled_later["symbols"]) == (0, ["CShape"])
    assert (labeled_later["duplicates"], labeled_later["joined"]) == (14, 7)  # those that had a symbol keep it
    assert answer("learn", recordings, "-l", library)["joined"] == 0
    both = run("learn", recordings, "--label", "x", "--no-labels", "-l", library)
    assert both.returncode == 2


def test_people_are_said_or_read_from_folders(recordings, tmp_path):
    library, plain = tmp_path / "actions", tmp_path / "plain"
    assert answer("learn", recordings, "-l", plain)["people"] == []
    assert "by 1 person; " in run("learn", recordings, "--person", "anna", "-l", library).stdout
    by = tmp_path / "everybody"
    by.mkdir()
    recordings.rename(by / "ben")
    first = next((by / "ben" / "CShape").iterdir())
    (by / "cleo" / "CShape").mkdir(parents=True)
    (by / "cleo" / "CShape" / "0.csv").write_text(first.read_text().replace(",0.", ",1."))
    learned = answer("learn", by, "--by-person", "-l", library)
    assert (learned["added"], learned["people"]) == (1, ["ben", "cleo"])
    assert answer("library", "list", "-l", library)["people"] == {"anna": 14, "cleo": 1}  # who was known stays
    assert answer("library", "list", "-l", plain)["people"] == {}
    assert "15 by 2 people; version" in run("library", "list", "-l", library).stdout
    shown = answer("library", "show", "CShape", "-l", library)["members"]
    assert [one["person"] for one in shown] == ["anna"] * 7 + ["cleo"]
    assert "person" in run("library", "show", "CShape", "-l", library).stdout
    assert "person" not in run("library", "show", "CShape", "-l", plain).stdout


def test_people_of_an_archive_are_those_of_its_array(demos, tmp_path):
    people = np.array(["anna", "ben"])[np.arange(len(demos)) % 2]
    np.savez(
        tmp_path / "all.npz", positions=demos.positions, times=demos.times, offsets=demos.offsets,
        labels=demos.labels.astype(str), people=people,
    )  # fmt: skip
    answer("learn", tmp_path / "all.npz", "--by-person", "-l", tmp_path / "actions")
    with kineme.ActionLibrary(tmp_path / "actions", read_only=True) as library:
        assert library.groups().tolist() == people.tolist()


def test_people_whom_nothing_names_are_asked_for(recordings, tmp_path):
    done = run("learn", recordings, "--by-person", "-l", tmp_path / "actions")
    assert done.returncode == 1
    assert "or an array people in an archive, got neither; name them with --person" in done.stderr
    assert not (tmp_path / "actions").exists()
    assert run("learn", recordings, "--by-person", "--person", "x", "-l", tmp_path / "actions").returncode == 2


def test_the_standard_input_is_a_recording(recordings, tmp_path):
    table = (recordings / "CShape" / "0.csv").read_text()
    learned = answer("learn", "-", "--label", "piped", "-l", tmp_path / "actions", input=table, by=start)
    assert (learned["added"], learned["symbols"]) == (1, ["piped"])


@pytest.mark.parametrize("what", ["nothing", "empty"])
def test_nothing_to_learn_is_a_failure_that_leaves_no_library(what, tmp_path):
    (tmp_path / "empty").mkdir()
    done = run("learn", tmp_path / what, "-l", tmp_path / "actions")
    assert done.returncode == 1
    assert done.stderr.startswith("kineme: expected")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "actions").exists()


def test_movements_of_other_dimensions_are_refused_and_nothing_changes(recordings, tmp_path):
    library = tmp_path / "actions"
    answer("learn", recordings, "-l", library)
    (tmp_path / "space.csv").write_text("time,x,y,z\n" + "".join(f"{t},{t},{t * t},1\n" for t in range(9)))
    done = run("learn", tmp_path / "space.csv", "-l", library)
    assert done.returncode == 1
    assert "expected movements of 2 dimensions as all others of the library" in done.stderr
    assert len(answer("library", "history", "-l", library)) == 1


def test_people_from_a_column_of_a_table(tmp_path):
    rows = [
        f"{who},{label},{k / 10},{k * (1 + 0.1 * n)},{k * k if label == 'wave' else 3 * (k % 4)}"
        for n, who in enumerate(("ann", "bob"))
        for label in ("wave", "nod")
        for k in range(10)
    ]
    (tmp_path / "a.csv").write_text("\n".join(["who,label,t,x,y", *rows]))
    library = tmp_path / "actions"
    learned = answer("learn", tmp_path / "a.csv", "--person-column", "who", "-l", library)
    assert (learned["added"], learned["people"], learned["symbols"]) == (4, ["ann", "bob"], ["wave", "nod"])
    done = run("learn", tmp_path / "a.csv", "--person-column", "who", "--person", "eve", "-l", library)
    assert "expected --person, or people from --person-column or --label-pattern, not both" in done.stderr
    assert "person who" in run("inspect", tmp_path / "a.csv", "--person-column", "who").stdout


def test_what_has_no_symbol_says_what_next(recordings, tmp_path):
    done = run("learn", recordings, "--no-labels", "-l", tmp_path / "library")
    assert "14 movements have no symbol: say it with --label NAME, or find groups with kineme anchor" in done.stdout
    assert answer("learn", recordings, "--label", "a", "-l", tmp_path / "library")["without_symbol"] == 0


def test_a_label_that_is_not_taken_is_said(recordings, tmp_path):
    name = sorted(recordings.glob("*/*"))[0]
    answer("learn", name, "--label", "wave", "-l", tmp_path / "library")
    done = run("learn", name, "--label", "other", "-l", tmp_path / "library")
    assert "1 movement in wave already: the label other is not taken; kineme library" in done.stdout
    again = answer("learn", name, "--label", "other", "-l", tmp_path / "library")
    assert again["kept"] == [{"symbol": "wave", "label": "other", "movements": 1}]
    assert "no symbol" not in done.stdout


def test_a_label_that_is_not_taken_since_the_same_call_has_another_is_said(recordings, tmp_path):
    name = sorted(recordings.glob("*/*"))[0]
    for label in ("apple", "pear"):
        (tmp_path / "fruit" / label).mkdir(parents=True)
        shutil.copy(name, tmp_path / "fruit" / label)
    words = ("learn", tmp_path / "fruit", "-l", tmp_path / "library")
    done = run(*words)
    assert "1 movement in apple already: the label pear is not taken; kineme library" in done.stdout
    assert answer(*words)["kept"] == [{"symbol": "apple", "label": "pear", "movements": 1}]


def test_a_pause_in_which_one_movement_may_end_and_another_begin_is_said(tmp_path):
    """Two demonstrations under one label, as a table has them where no column counts them, are one movement."""

    def write(later):
        rows = "".join(f"wave,{t + k / 50},{k},{k * k}\n" for t in (0, later) for k in range(40))
        (tmp_path / "two.csv").write_text("label,time,x,y\n" + rows)

    write(10)
    (note,) = answer("learn", tmp_path / "two.csv", "-l", tmp_path / "actions")["notes"]
    assert note.startswith("1 movement without samples for up to 9.22 s, the first two.csv; if these are several")
    assert note in answer("inspect", tmp_path / "two.csv")["notes"]
    write(1.6)
    assert answer("learn", tmp_path / "two.csv", "-l", tmp_path / "others")["notes"] == []


def test_units_that_are_converted_and_columns_put_in_order_are_said(tmp_path):
    for name, heads, (x, y) in (("a", "x [m],y [m]", (1, 2)), ("b", "y [mm],x [mm]", (2000, 1000))):
        rows = "".join(f"{k / 50},{k * x},{k * y}\n" for k in range(40))
        (tmp_path / f"{name}.csv").write_text(f"time,{heads}\n{rows}")
    ordered, converted = answer("learn", tmp_path, "--label", "wave", "-l", tmp_path / "actions")["notes"]
    assert ordered.startswith("some files have the columns y [mm], x [mm] in this order")
    assert converted == "units are converted: mm to m"


@pytest.mark.parametrize(
    ("factor", "heads"), [(57.3, "joint1,joint2"), (1000, "x,y"), (20, "x,y"), (1000, "x [mm],y [mm]")]
)
def test_movements_of_a_label_whose_sizes_differ_as_units_do_are_said(tmp_path, factor, heads):
    (tmp_path / "set" / "wave").mkdir(parents=True)
    for name, scale, columns in (("a", 1, heads.replace("mm", "m")), ("b", factor, heads)):
        rows = "".join(f"{k / 50},{scale * k / 40},{scale * (k / 80) ** 2}\n" for k in range(40))
        (tmp_path / "set" / "wave" / f"{name}.csv").write_text(f"time,{columns}\n{rows}")
    for command in (["learn", "-l", tmp_path / "actions"], ["inspect"]):
        said = [one for one in answer(*command, tmp_path / "set")["notes"] if "if these are two units" in one]
        assert len(said) == (factor > 30 and "[" not in heads)
        assert not said or "of wave extend from 0.975, wave/a.csv, to" in said[0]


def test_times_that_may_be_of_another_unit_and_derivatives_are_said(tmp_path):
    rows = "".join(f"{2 * k},{k},{k * k},{2 * k}\n" for k in range(20))
    (tmp_path / "a.csv").write_text("time,x,y,vy\n" + rows)
    learned = answer("learn", tmp_path / "a.csv", "--label", "unknown", "-l", tmp_path / "actions")
    rate, named, aside = learned["notes"]
    assert named.startswith("a symbol named 'unknown' counts as none")
    assert aside.startswith("left aside vy, ")
    assert rate == "0.5 samples per second are unusual; if the unit of time is another, give --units"


def test_a_library_that_was_begun_without_names_says_in_which_order_columns_are_taken(recordings, demos, tmp_path):
    with kineme.ActionLibrary(tmp_path / "unnamed", create=True) as library:
        library.learn([demo.positions for demo in demos[:3]], ["C"] * 3)
    (note,) = answer("learn", recordings / "GShape", "-l", tmp_path / "unnamed")["notes"]
    assert "begun with columns without names: ['x', 'y'] are taken in this order" in note
    assert answer("learn", recordings, "-l", tmp_path / "named")["notes"] == []
    assert answer("learn", recordings, "-l", tmp_path / "named")["notes"] == []
