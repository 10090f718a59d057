"""Commands with --workers and --shard answer as they do without, once their parts are gathered."""

from __future__ import annotations

import json
import shutil

import pytest
from commands import answer, run

from kineme.cli import pieces as cli_pieces
from robot_array_sets import write_aloha, write_robomimic
from robot_work import write_episodes, write_library

SMALL = 60_000  # bytes of a piece, instead of MiB


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Three data sets with episodes of an arm, and a library of its symbols."""
    folder = tmp_path_factory.mktemp("work")
    for k in range(3):
        write_episodes(folder / "archive" / f"set {k}", 3 + k)
    write_library(folder / "actions")
    return folder


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(cli_pieces, "_MIB", SMALL // 16)
    monkeypatch.setenv("KINEME_COMPILED", "always")  # as pieces do, so that all digits are equal


def _shards(output, *command, count=3):
    for k in range(count, 0, -1):
        done = run(*command, "-o", output, "--shard", f"{k}/{count}")
        assert (done.returncode, done.stderr) == (0, "")


def test_annotations_of_shards_are_those_of_one_process(work, tmp_path):
    command = ("annotate", work / "archive", "-l", work / "actions")
    run(*command, "-o", tmp_path / "here.csv")
    _shards(tmp_path / "out", *command)
    done = run("gather", tmp_path / "out", "-o", tmp_path / "there.csv")
    assert done.returncode == 0
    assert "3 of 3 pieces done" in done.stdout
    assert (tmp_path / "there.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
    # A copy of a data set, too.
    _shards(tmp_path / "one", "annotate", work / "archive" / "set 0", "-l", work / "actions", count=1)
    run("gather", tmp_path / "one", "-o", tmp_path / "copy")
    assert (tmp_path / "copy" / "meta" / "kineme" / "motions.parquet").is_file()


@pytest.mark.soak
def test_processes_answer_as_shards_do(work, tmp_path):
    command = ("annotate", work / "archive", "-l", work / "actions")
    _shards(tmp_path / "shards", *command)
    said = answer(*command, "-o", tmp_path / "workers", "--workers", 2)
    assert said["pieces"] == {"done": 3}
    assert said["recordings"] == 12
    shards, workers = ({p.name: p.read_bytes() for p in (tmp_path / n).glob("part-*")} for n in ("shards", "workers"))
    assert shards == workers
    assert answer(*command, "-o", tmp_path / "workers", "--shard", "1/1")["pieces"] == {"skipped": 3}


def test_a_version_that_another_one_has_replaced_makes_its_parts_stale(work, tmp_path):
    """A backup is put back, and the next version gets the number of the one that it discarded."""
    command = ("annotate", work / "archive" / "set 0", "-l", tmp_path / "actions", "-o", tmp_path / "out")
    for name in ("first", "second"):
        shutil.rmtree(tmp_path / "actions", ignore_errors=True)
        shutil.copytree(work / "actions", tmp_path / "actions")
        assert run("library", "rename", "tap", name, "-l", tmp_path / "actions").returncode == 0
        assert answer(*command, "--shard", "1/1")["pieces"] == {"done": 1}
    run("gather", tmp_path / "out", "-o", tmp_path / "gathered.csv")
    assert "second" in (tmp_path / "gathered.csv").read_text()


@pytest.mark.soak
def test_hits_are_those_of_find(work, tmp_path):
    command = ("find", "tap", work / "archive", "-l", work / "actions")
    run(*command, "-o", tmp_path / "here.csv")
    _shards(tmp_path / "out", *command)
    run("gather", tmp_path / "out", "-o", tmp_path / "there.csv")
    here, there = (sorted((tmp_path / name).read_text().splitlines()) for name in ("here.csv", "there.csv"))
    assert len(here) > 1
    assert [line.partition("set ")[2] for line in here] == [line.partition("set ")[2] for line in there]


def test_an_audit_is_that_of_one_process(work, tmp_path):
    write_episodes(tmp_path / "set", 24)
    direct = run("audit", tmp_path / "set", "-o", tmp_path / "here.html")
    _shards(tmp_path / "out", "audit", tmp_path / "set")
    done = run("gather", tmp_path / "out", "-o", tmp_path / "there.html", "--train-mask", tmp_path / "keep.json")
    assert (tmp_path / "there.html").read_bytes() == (tmp_path / "here.html").read_bytes()
    assert direct.stdout.splitlines()[0] in done.stdout
    assert json.loads((tmp_path / "keep.json").read_text())


def test_inspect_summarizes_all_parts(work, tmp_path):
    _shards(tmp_path / "out", "inspect", work / "archive")
    there, here = answer("gather", tmp_path / "out"), answer("inspect", work / "archive")
    assert there["labels"] == here["labels"]


def test_files_of_other_columns_are_left_out_as_without_pieces(tmp_path):
    """Each is named with its reason: other columns, dimensions, a sensor, units."""
    heads = {f"{k}": "t,x,y" for k in range(5)} | {
        "five": "t,p,q", "six": "t,x", "seven": "t,x,y,z", "eight": "t,x [mm],y [mm]", "left wrist": "t,x,y",
    }  # fmt: skip
    for k, (name, head) in enumerate(heads.items()):
        path = tmp_path / "archive" / ("wave", "nod")[k % 2] / f"{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        rows = [[i / 50, *(10 * (i + j) ** 0.5 for j in range(head.count(",")))] for i in range(30)]
        path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    direct = answer("inspect", tmp_path / "archive")
    _shards(tmp_path / "out", "inspect", tmp_path / "archive", "--piece-size", 1)
    gathered = answer("gather", tmp_path / "out")
    left_out = {problem["file"] for problem in direct["problems"]}
    names = sorted(problem.partition(":")[0] for problem in gathered["problems"])
    assert names == sorted({*left_out, "wave/eight.csv"})
    assert gathered["columns"] == {"x, y": 10 - len(names)}
    assert sum(label["movements"] for label in gathered["labels"]) == 10 - len(names)
    assert len(left_out) >= 3


def test_gather_says_what_is_missing_stale_failed_and_strange(work, tmp_path):
    shutil.copytree(work / "archive", tmp_path / "archive")
    command = ("inspect", tmp_path / "archive", "-o", tmp_path / "out")
    run(*command, "--shard", "1/3")
    done = run("gather", tmp_path / "out")
    assert done.returncode == 3
    assert "1 of 3 pieces done" in done.stdout
    assert "2 missing: set 1" in done.stdout
    assert json.loads(run("gather", tmp_path / "out", "--partial", "--json").stdout)["recordings"] == 3
    run(*command, "--shard", "1/1")
    assert run("gather", tmp_path / "out").returncode == 0
    info = tmp_path / "archive" / "set 1" / "meta" / "info.json"
    info.write_text(info.read_text() + " ")
    done = run("gather", tmp_path / "out")
    assert (done.returncode, "1 stale: set 1" in done.stdout) == (3, True)
    shutil.rmtree(tmp_path / "archive" / "set 2")
    assert "1 part of no piece" in run("gather", tmp_path / "out").stdout


def test_a_poisoned_piece_ends_with_3_and_is_named(work, tmp_path):
    shutil.copytree(work / "archive", tmp_path / "archive")
    next((tmp_path / "archive" / "set 1" / "data").rglob("*.parquet")).write_bytes(b"PAR1 and nothing more")
    (tmp_path / "archive" / "set 2" / "meta" / "info.json").write_text("{}")
    done = run("annotate", tmp_path / "archive", "-l", work / "actions", "-o", tmp_path / "out", "--shard", "1/1")
    assert "not read: set 2" in done.stdout
    assert "set 1" in done.stdout
    assert "damaged" in done.stdout


@pytest.mark.soak
def test_a_piece_that_takes_too_long_ends_with_3(work, tmp_path):
    done = run("inspect", work / "archive", "-o", tmp_path / "out", "--workers", 1, "--time-limit", 1e-6)
    assert (done.returncode, done.stdout.count("was not done within 1e-06 min")) == (3, 3)


def test_a_folder_is_for_one_command(work, tmp_path):
    command = ("annotate", work / "archive", "-l", work / "actions", "-o", tmp_path / "out", "--shard", "1/9")
    run(*command)
    done = run("inspect", work / "archive", "-o", tmp_path / "out", "--shard", "1/9")
    assert (done.returncode, "those of kineme annotate" in done.stderr) == (1, True)
    done = run(*command, "--error-rate", 0.2)
    assert (done.returncode, "other options (error_rate)" in done.stderr) == (1, True)
    assert run(*command, "--error-rate", 0.2, "--force").returncode == 0
    assert json.loads((tmp_path / "out" / "run.json").read_text())["options"]["error_rate"] == 0.2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--workers", 2), "expected --output FOLDER"),
        (("--workers", 2, "-o", "labels.csv"), "expected --output FOLDER"),
        (("--workers", 2, "--scheduler", "tcp://127.0.0.1:9", "-o", "out"), "not both"),
        (("--shard", "4/3", "-o", "out"), "expected a shard as 3/64"),
        (("--shard", "1/3", "-o", "out", "--time-limit", 9), "expected --workers with --time-limit"),
        (("--workers", 2, "-o", "out", "--time-limit", 0), "0.0 is not in the range"),
        (("--workers", 2, "-o", "out", "--join-files"), "join them first"),
        (("--workers", 2, "-o", "out", "--csv"), "with kineme gather"),
        (("-", "--workers", 2, "-o", "out"), "got the standard input"),
    ],
)
def test_options_that_do_not_fit_are_refused(work, tmp_path, arguments, words):
    done = run("annotate", work / "archive", "-l", work / "actions", *arguments, cwd=tmp_path)
    assert (done.returncode, words in done.stderr) == (2, True)
    assert not list(tmp_path.iterdir())


def test_a_file_of_other_columns_is_a_problem_of_its_piece(work, tmp_path):
    archive = tmp_path / "archive"
    shutil.copytree(work / "actions-shown", archive)
    (archive / "other.csv").write_text("t,x\n" + "".join(f"{k / 50},{k}\n" for k in range(60)))
    (archive / "none.csv").write_text("words\n")
    command = ("annotate", archive, "-l", work / "actions")
    run(*command, "-o", tmp_path / "here.csv")
    said = answer(*command, "-o", tmp_path / "out", "--shard", "1/1")
    assert [problem.partition(":")[0] for problem in said["problems"]] == ["none.csv", "other.csv"]
    assert said["problems"][0].startswith("none.csv: expected one column of times")
    run("gather", tmp_path / "out", "-o", tmp_path / "there.csv")
    assert (tmp_path / "there.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
    run(*command, "-o", tmp_path / "here.json")
    run("gather", tmp_path / "out", "-o", tmp_path / "there.json")
    assert (tmp_path / "there.json").read_bytes() == (tmp_path / "here.json").read_bytes()


@pytest.mark.parametrize("size", [16, 1])
@pytest.mark.parametrize("write", [write_robomimic, write_aloha])
def test_an_audit_of_files_numbers_episodes_as_one_process_does(tmp_path, monkeypatch, write, size):
    monkeypatch.setattr(cli_pieces, "_MIB", 1000)
    folder = tmp_path / "set"
    if write is write_robomimic:
        folder.mkdir()
        for name in ("part_10", "part_2", "part_1"):
            write(folder / f"{name}.hdf5", (60, 80))
    else:
        write(folder, (60,) * 11)
    (folder / "unread_5.hdf5").write_text("no HDF5")
    (folder / "README.md").write_text("words")
    command = ("audit", folder)
    run(*command, "-o", tmp_path / "here.html")
    run(*command, "-o", tmp_path / "out", "--shard", "1/1", "--piece-size", size)
    there, here = answer("gather", tmp_path / "out", "-o", tmp_path / "there.html"), answer(*command)
    assert there["findings"] == here["findings"]
    assert there["problems"] == []
    assert (tmp_path / "there.html").read_bytes() == (tmp_path / "here.html").read_bytes()


def test_rows_that_are_none_of_the_command_are_refused(work, tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    for command in (
        ("annotate", work / "actions-shown", "-l", work / "actions"),
        ("audit", work / "archive" / "set 0"),
    ):
        output = tmp_path / command[0]
        run(*command, "-o", output, "--shard", "1/1")
        (path,) = output.glob("part-*")
        table = parquet.read_table(path)
        for rows in (pa.table({"x": [1]}), pa.table({name: [1] for name in table.column_names})):
            parquet.write_table(rows.replace_schema_metadata(table.schema.metadata), path)
            done = run("gather", output, "-o", tmp_path / "labels.csv")
            assert (done.returncode, f"expected the rows of kineme {command[0]}" in done.stderr) == (1, True)
    assert not (tmp_path / "labels.csv").exists()


def test_an_audit_of_several_sets_is_refused(work, tmp_path):
    done = run("audit", work / "archive", "-o", tmp_path / "out", "--shard", "1/1")
    assert (done.returncode, "say the folder of one" in done.stderr) == (1, True)
    assert not (tmp_path / "out").exists()


def test_parts_are_gathered_from_any_folder_and_partly(work, tmp_path):
    shutil.copytree(work / "actions-shown", tmp_path / "archive")
    command = ("inspect", "archive/", "-o", "run_1.5")
    assert run(*command, "--shard", "2/2", cwd=tmp_path).returncode == 0
    done = run("gather", tmp_path / "run_1.5", "--partial", cwd=work)
    assert (done.returncode, done.stdout.splitlines()[0]) == (3, "0 of 1 piece done")
    assert run(*command, "--workers", 1, cwd=tmp_path).returncode == 0
    assert run("gather", tmp_path / "run_1.5", cwd=work).returncode == 0
    done = run("gather", tmp_path / "run_1.5", "--train-mask", "keep.csv", cwd=tmp_path)
    assert (done.returncode, "--train-mask with the parts of kineme audit" in done.stderr) == (2, True)


def test_a_folder_of_parts_within_the_archive_is_refused(work, tmp_path):
    shutil.copytree(work / "actions-shown", tmp_path / "archive")
    done = run("inspect", ".", "-o", "out", "--shard", "1/1", cwd=tmp_path / "archive")
    assert (done.returncode, "outside of the archive ." in done.stderr) == (1, True)
    assert not (tmp_path / "archive" / "out").exists()


def test_an_archive_that_is_not_there_is_said_and_leaves_nothing(tmp_path):
    done = run("inspect", tmp_path / "archive", "-o", tmp_path / "out", "--shard", "1/1")
    assert (done.returncode, "found nothing at" in done.stderr) == (1, True)
    assert not (tmp_path / "out").exists()


def test_a_folder_without_parts_is_said(tmp_path):
    done = run("gather", tmp_path)
    assert done.returncode == 1
    assert "--workers, --scheduler or --shard" in done.stderr


def test_an_archive_elsewhere_needs_a_folder_of_parts(work):
    done = run("annotate", "s3://fleet/sets", "-l", work / "actions")
    assert (done.returncode, "an archive in a store" in done.stderr) == (2, True)


def test_commands_that_read_at_once_refuse_an_archive_elsewhere(work):
    done = run("recognize", "s3://fleet/sets", "-l", work / "actions")
    assert (done.returncode, "of this machine, got s3://fleet/sets" in done.stderr) == (2, True)
    done = run("audit", "s3://fleet/sets")
    assert (done.returncode, "an archive in a store" in done.stderr) == (2, True)
