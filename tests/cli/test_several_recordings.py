"""Commands that read take several files, patterns and the standard input, and labels from names."""

import pytest
from commands import answer, run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    top = tmp_path_factory.mktemp("several")
    for k, name in enumerate(("ann_wave_1", "ann_nod_1", "bob_wave_1", "bob_nod_1")):
        rows = [f"{i / 50},{i * (1 + k)},{i * i if 'wave' in name else -i}" for i in range(30)]
        (top / f"{name}.csv").write_text("\n".join(["t,x,y", *rows]))
    (top / "bad_wave_1.csv").write_text("t,x\n0,1\n")
    pattern = "{person}_{label}_{n}.csv"
    learned = answer("learn", "*.csv", "--label-pattern", pattern, "--trim", "-l", "actions", cwd=top)
    assert (learned["symbols"], learned["people"]) == (["nod", "wave"], ["ann", "bob"])
    assert len(learned["problems"]) == 1
    return top


@pytest.mark.parametrize("command", [("inspect",), ("recognize", "-l", "actions")])
def test_files_patterns_and_the_standard_input_go_together(folder, command):
    data = (folder / "ann_wave_1.csv").read_text()
    read = answer(*command, "bob_*.csv", "ann_nod_1.csv", "-", "bad_wave_1.csv", "none", cwd=folder, input=data)
    assert len(read["problems"]) == 2
    names = [one["recording"] for one in read["movements"]] if command[0] == "recognize" else []
    assert names in ([], ["standard input.csv", "bob_nod_1.csv", "bob_wave_1.csv", "ann_nod_1.csv"])
    assert command[0] == "recognize" or (read["files"], read["movements"]) == (4, 4)


@pytest.mark.parametrize("command", [("inspect",), ("recognize", "-l", "actions"), ("learn", "-l", "new")])
def test_an_empty_name_is_no_folder(folder, command):
    done = run(*command, "", cwd=folder)
    assert done.returncode == 2
    assert "expected a file or a folder, got an empty name" in done.stderr
    assert not (folder / "new").exists()


def test_two_ways_to_say_a_person_are_refused(folder):
    said = ("--label-pattern", "{person}_{label}_{n}.csv", "--person", "eve")
    done = run("learn", "*.csv", *said, "-l", "new", cwd=folder)
    assert done.returncode == 2
    assert "not both" in done.stderr


@pytest.mark.parametrize("level", ["0", "-1", "top", ""])
def test_wrong_levels_are_refused(folder, level):
    assert "expected task, folder or a level from 1" in run("inspect", "*.csv", "--label-by", level, cwd=folder).stderr
