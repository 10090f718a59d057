"""What is learned by pieces is what one process learns: the same rows of all tables, in the same order."""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from kineme import DMP, ActionLibrary
from kineme.cli import main, pieces
from kineme.library.storage.connection import FILE
from kineme.library.storage.schema import COLUMNS
from lerobot_sets import write_v3

#: Columns that say when and by which call a row was written, not what was learned.
_WHEN = {"added", "removed", "created", "crc"}


def kineme(*arguments, status=0):
    """What a command answers in JSON; what it refuses with another status, in words."""
    with contextlib.chdir("/"):
        done = CliRunner().invoke(main, [*map(str, arguments)], catch_exceptions=False)
    assert done.exit_code == status, done.output
    return json.loads(done.stdout) if status == 0 and "--json" in arguments else done.output


def stored(folder):
    """All that a library holds, but for times and numbers of versions, and identifiers drawn at random."""
    rows = {}
    with closing(sqlite3.connect(folder / FILE)) as connection:
        for table, names in COLUMNS.items():
            if table == "version":
                continue
            chosen = [name for name in names if name not in _WHEN and not (table == "source" and name == "read_at")]
            rows[table] = connection.execute(f"SELECT {', '.join(chosen)} FROM {table} ORDER BY 1").fetchall()
    rows["meta"] = [row for row in rows["meta"] if row[0] != "id"]
    rows["symbol"] = [row[0] for row in rows["symbol"]]
    return rows


def assert_same(rows, expected, tolerances=(1e-14, 1e-6)):
    """Equal rows of all tables; of sums over samples to their last digits, which depend on what is summed beside."""
    for table, wanted in expected.items():
        if table not in ("primitive", "feature"):
            assert rows[table] == wanted, table
            continue
        kinds = (np.float64, np.float32) if table == "primitive" else (np.float32,)
        for k, (kind, tolerance) in enumerate(zip(kinds, tolerances[-len(kinds) :], strict=True), start=1):
            ours, theirs = (np.frombuffer(b"".join(row[k] for row in side), kind) for side in (rows[table], wanted))
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


def of_one_process(folder, archives, *options):
    kineme("learn", *archives, "--library", folder, *options)
    return stored(folder)


@pytest.fixture
def small_pieces(monkeypatch):
    """Let pieces be of some files."""
    monkeypatch.setattr(pieces, "_MIB", 2000)


def by_pieces(folder, archives, *options, by=(("--shard", "2/3"), ("--shard", "3/3"), ("--shard", "1/3"))):
    """Learn by pieces, and return what the library holds and what gathering said."""
    parts = folder.with_name(f"{folder.name}-parts")
    for how in by:
        kineme("learn", *archives, "--library", folder, "-o", parts, "--piece-size", 1, *how, *options)
    assert len(list(parts.glob("part-*"))) > 1
    assert not list(parts.glob("failed-*"))
    said = kineme("gather", parts, "--json")
    return stored(folder), said


def write_csv(path, t, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(t, *columns.values(), strict=True)]
    path.write_text("\n".join([",".join(["t", *columns]), *rows]) + "\n")


def draw_archive(folder, seed, n_files, heads, uneven=False, depth=1, copied=False):
    """Write recordings of some people, in folders person/label; the last file may be a copy of the first."""
    rng = np.random.default_rng(seed)
    for k in range(n_files):
        n = int(rng.integers(8, 50))
        t = 3.0 + np.cumsum(rng.uniform(0.01, 0.05, n)) if uneven else np.arange(n) / 50
        u = np.linspace(0, 1, n)
        columns = {}
        for head in heads:
            if head == "gripper":
                columns[head] = np.where(u < rng.uniform(0.2, 0.8), 0.0, 0.08)
            elif head == "yaw_deg":
                columns[head] = (170 + 40 * u + 180) % 360 - 180
            else:
                columns[head] = np.sin(rng.uniform(2, 6) * u + rng.normal()) + u * rng.normal()
        person, label = ("ann", "bob", "eve")[k % 3], ("arc", "line", "wave", "zig")[int(rng.integers(4))]
        names = (person, label)[2 - depth :]
        write_csv(folder.joinpath(*names, f"{person}_{label}_{k:03d}.csv"), t, columns)
    if copied:
        files = sorted(folder.rglob("*.csv"))
        shutil.copy(files[0], files[-1].with_name("zz_copy_900.csv"))
    return folder


@given(st.data())
def test_pieces_learn_what_one_process_learns(tmp_path_factory, data):
    tmp_path = tmp_path_factory.mktemp("learn")
    heads = data.draw(st.sampled_from([("x",), ("x", "y"), ("x", "y", "gripper"), ("x", "yaw_deg", "gripper")]))
    archive = draw_archive(
        tmp_path / "archive",
        data.draw(st.integers(0, 99)),
        data.draw(st.integers(12, 40)),
        heads,
        data.draw(st.booleans()),
        depth=2,
        copied=True,
    )
    options = data.draw(
        st.sampled_from([
            (), ("--by-person",), ("--label", "wave"), ("--no-labels",), ("--person", "ann"),
            ("--label-pattern", "{person}_{label}_{n}.csv"), ("--columns", "x"), ("--label-by", "2"), ("--trim",),
            ("--fill-gaps", "0"),
        ])
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "_MIB", 2000)
        rows, said = by_pieces(tmp_path / "pieces", [archive], *options)
    assert_same(rows, of_one_process(tmp_path / "one", [archive], *options))
    assert said["added"] + said["duplicates"] >= 13
    with ActionLibrary(tmp_path / "pieces") as library:
        assert library.verify() == []


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Recordings with a gripper, of three people."""
    return draw_archive(
        tmp_path_factory.mktemp("archives") / "archive", 5, 30, ("x", "y", "gripper"), True, 2, copied=True
    )


@pytest.fixture(scope="module")
def one(archive):
    """What one process learns of it."""
    return of_one_process(archive.with_name("one"), [archive])


@pytest.mark.soak
def test_processes_learn_it_too(archive, one, tmp_path, small_pieces):
    rows, said = by_pieces(tmp_path / "library", [archive], by=[("--workers", 2)])
    assert_same(rows, one)
    assert (said["added"], said["duplicates"], said["without_symbol"]) == (30, 1, 0)
    assert said["kept"] == [{"symbol": "arc", "label": "zig", "movements": 1}]  # the copy, in a folder read later
    assert sorted(said["symbols"]) == ["arc", "line", "wave", "zig"]


def test_gathering_again_adds_nothing_and_one_undo_takes_back_all(archive, tmp_path, small_pieces, monkeypatch):
    monkeypatch.setattr("kineme.pieces.learned._ROWS", 8)
    folder = tmp_path / "library"
    before, said = by_pieces(folder, [archive], by=[("--shard", "1/1")])
    assert said["version"] == 3
    again = kineme("gather", f"{folder}-parts", "--json")
    assert (again["added"], again["version"], stored(folder)) == (0, said["version"], before)
    with ActionLibrary(folder) as library:
        library.undo()
        assert len(library) == 0
    restored = kineme("gather", f"{folder}-parts", "--json")
    assert restored["added"] == 30


def test_data_sets_of_lerobot_have_the_checksum_of_all_their_files(tmp_path, small_pieces):
    archive = tmp_path / "archive"
    write_v3(archive / "robot", (20, 30, 25, 12, 14, 40, 9), 2)
    write_csv(
        archive / "arc" / "a.csv",
        np.arange(9) / 50,
        {"a": np.arange(9.0), "b": np.arange(9) ** 2, "c": -np.arange(9.0)},
    )
    names = ("--columns", "0,1,2")
    for several, options in (([archive / "robot"], ()), ([archive / "robot"], ("--label-by", "folder"))):
        folder = tmp_path / f"library{len(options)}"
        rows, said = by_pieces(folder, several, *options)
        assert said["added"] == 7
        assert_same(rows, of_one_process(tmp_path / f"one{len(options)}", several, *options))
    rows, _ = by_pieces(tmp_path / "mixed", [archive / "arc", archive / "robot"], *names)
    assert_same(rows, of_one_process(tmp_path / "mixed-one", [archive / "arc", archive / "robot"], *names))


def test_a_file_of_parquet_that_is_divided_is_learned_as_a_whole_one(tmp_path, small_pieces):
    """One source, with the checksum of its bytes, and the places in it."""
    counts = [60 + k % 5 for k in range(60)]
    u = np.concatenate([np.linspace(0, 1, n) for n in counts])
    episode = np.repeat(np.arange(60), counts)
    rows = {"episode": episode, "label": [f"kind {k % 3}" for k in episode], "t": u, "x": np.sin(3 * u + episode % 3)}
    (tmp_path / "archive").mkdir()
    parquet.write_table(pa.table(rows), tmp_path / "archive" / "all.parquet", row_group_size=500)
    rows, said = by_pieces(tmp_path / "pieces", [tmp_path / "archive"])
    assert said["added"] + said["duplicates"] == 60
    assert_same(rows, of_one_process(tmp_path / "one", [tmp_path / "archive"]))


def test_columns_of_the_archive_are_those_of_most_files_whatever_is_in_a_piece(tmp_path, small_pieces):
    """A piece of other files alone, a gripper that does not move in some pieces, other orders and units."""
    archive = draw_archive(tmp_path / "archive", 3, 14, ("x", "y", "gripper"))
    t, u = np.arange(60) / 50, np.linspace(0, 1, 60)
    for k in range(5):
        write_csv(archive / "aaa" / f"{k}.csv", t, {"x": u + k, "y": u**2, "z": np.sin(u)})  # as many columns
        write_csv(archive / "bbb" / f"{k}.csv", t, {"x": u + k, "y": u**2})
        write_csv(archive / "ccc" / f"{k}.csv", t, {"gripper": u > 0.5, "y": u**2 + k, "x": u})
        write_csv(archive / "ddd" / f"{k}.csv", t, {"x [mm]": u + k, "y": u**2, "gripper": u > 0.5})  # x has no unit
    rows, said = by_pieces(tmp_path / "library", [archive])
    assert_same(
        rows, of_one_process(tmp_path / "one", [archive]), (1e-6, 1e-5)
    )  # those in another order: described again
    assert {problem.partition("/")[0] for problem in said["problems"]} == {"aaa", "bbb", "ddd"}
    assert "2 dimensions where most have 3" in "".join(said["problems"])


def test_a_column_that_moves_in_some_pieces_is_not_discrete(tmp_path, small_pieces):
    archive = draw_archive(tmp_path / "archive", 3, 14, ("x", "y", "gripper"))
    t, u = np.arange(60) / 50, np.linspace(0, 1, 60)
    for k in range(5):
        write_csv(archive / "slow" / f"{k}.csv", t, {"x": u + k, "y": u**2, "gripper": 0.08 * u})
    rows, said = by_pieces(tmp_path / "library", [archive])
    one = of_one_process(tmp_path / "one", [archive])
    assert "gripper is discrete or position by pieces, and read as position; say --kind" in said["notes"][0]
    assert (rows["meta"], rows["source"], rows["member"]) == (one["meta"], one["source"], one["member"])
    with ActionLibrary(tmp_path / "library") as ours, ActionLibrary(tmp_path / "one") as theirs:
        np.testing.assert_allclose(ours.movements().positions, theirs.movements().positions, atol=1e-6)
        np.testing.assert_allclose(ours.features(ours.ids()), theirs.features(theirs.ids()), atol=1e-5)
    again = kineme("learn", archive, "--library", tmp_path / "library", "--json")
    assert again["added"] < 5  # what was described again is so from single precision


def test_a_library_that_is_there_keeps_its_columns(archive, tmp_path, small_pieces):
    """In another order, and with other movements; what it holds already is not stored again."""
    t, u = np.arange(60) / 50, np.linspace(0, 1, 60)
    write_csv(tmp_path / "first" / "arc" / "1.csv", t, {"y": u, "gripper": u > 0.5, "x": u**2})
    for name in ("library", "one"):
        kineme("learn", tmp_path / "first", "--library", tmp_path / name)
    rows, said = by_pieces(tmp_path / "library", [archive])
    one = of_one_process(tmp_path / "one", [archive])
    assert said["movements"] == 31
    assert (rows["meta"], rows["source"], rows["member"]) == (one["meta"], one["source"], one["member"])
    with ActionLibrary(tmp_path / "library") as ours, ActionLibrary(tmp_path / "one") as theirs:
        np.testing.assert_allclose(ours.movements().positions, theirs.movements().positions, atol=1e-6)
    write_csv(tmp_path / "other" / "arc" / "1.csv", t, {"a": u, "b": u**2})
    kineme("learn", tmp_path / "other", "--library", tmp_path / "plain")
    kineme("learn", archive, "--library", tmp_path / "plain", "-o", tmp_path / "out", "--shard", "1/1")
    assert "choose the columns" in kineme("gather", tmp_path / "out", status=1)


def test_an_angle_wraps_alike_in_all_pieces(tmp_path, small_pieces):
    """Degrees by the values of some files; those of others alone could be radians."""
    t, u = np.arange(60) / 50, np.linspace(0, 1, 60)
    for k in range(6):
        for label, turn in (("far", 100.0), ("near", 3.0)):
            write_csv(tmp_path / "archive" / label / f"{k}.csv", t, {"x": u**2 + k, "yaw": turn * u + k / 10})
    rows, _ = by_pieces(tmp_path / "library", [tmp_path / "archive"])
    assert_same(rows, of_one_process(tmp_path / "one", [tmp_path / "archive"]))
    assert '"period": 360.0' in dict(rows["meta"])["channels"]


def test_parts_depend_on_how_a_library_describes_not_on_what_it_holds(archive, tmp_path, small_pieces, monkeypatch):
    folder = tmp_path / "library"
    command = ("learn", archive, "--library", folder, "-o", tmp_path / "out", "--piece-size", 1, "--shard", "1/1")
    first = kineme(*command, "--json")
    with monkeypatch.context() as patch:  # gathering describes nothing
        patch.setattr("kineme.library.commit.serialize", None)
        patch.setattr("kineme.pieces.learned.digests", None)
        kineme("gather", tmp_path / "out")
    assert kineme(*command, "--json")["pieces"] == {"skipped": first["pieces"]["done"]}
    assert "other options (label)" in kineme(*command, "--label", "wave", status=1)
    shutil.rmtree(folder)
    assert "no library.sqlite" in kineme("gather", tmp_path / "out", status=1)
    ActionLibrary(folder, create=True, dmp=DMP(n_basis=10)).close()
    assert "other options (specification)" in kineme(*command, status=1)
    assert "another specification" in kineme("gather", tmp_path / "out", status=1)


def test_what_cannot_be_done_by_pieces_is_refused(archive, tmp_path):
    command = ("learn", archive, "--library", tmp_path / "library", "--shard", "1/1")
    (tmp_path / "labels.csv").write_text("start,end,label\n0,1,wave\n")
    for options, words in (
        ((), "expected --output FOLDER"),
        (("-o", tmp_path / "out", "--labels", tmp_path / "labels.csv"), "expected --labels, which cuts one long"),
        (("-o", tmp_path / "out", "--join-files"), "--join-files"),
        (("-o", tmp_path / "out", "--person", "ann", "--person-column", "who"), "not both"),
    ):
        assert words in kineme(*command, *options, status=2)
    assert "found nothing" in kineme("learn", tmp_path / "none", *command[2:], "-o", tmp_path / "none-out", status=1)
    assert not (tmp_path / "library").exists()
    kineme(*command, "-o", tmp_path / "out", "--person-column", "who")
    assert "expected movements in the parts, got none; the first" in kineme("gather", tmp_path / "out", status=1)
    kineme(*command, "-o", tmp_path / "aside", "--exclude", "zz")
    assert "columns like 'zz' to exclude" in kineme("gather", tmp_path / "aside", status=1)
    kineme(*command, "-o", tmp_path / "plain")
    assert "no --output" in kineme("gather", tmp_path / "plain", "-o", tmp_path / "file.csv", status=2)
    with ActionLibrary(tmp_path / "library") as library:
        assert len(library) == 0


def test_people_of_a_column_that_some_files_have(tmp_path, small_pieces):
    archive = draw_archive(tmp_path / "archive", 3, 14, ("x", "y"))
    for path in sorted(archive.rglob("*.csv"))[:6]:
        head, *lines = path.read_text().splitlines()
        path.write_text("\n".join([f"{head},who", *(f"{line},eve" for line in lines)]) + "\n")
    rows, said = by_pieces(tmp_path / "library", [archive], "--person-column", "who")
    assert said["people"] == ["eve"]
    assert len(rows["shown_by"]) == 6
    assert_same(rows, of_one_process(tmp_path / "one", [archive], "--person-column", "who"))


def test_a_movement_that_does_not_move_fails_its_piece(tmp_path, small_pieces):
    archive = draw_archive(tmp_path / "archive", 3, 14, ("x", "y"))
    write_csv(archive / "arc" / "000.csv", np.arange(9) / 50, {"x": np.ones(9), "y": np.ones(9)})
    parts = tmp_path / "out"
    command = ("learn", archive, "--library", tmp_path / "library", "-o", parts, "--piece-size", 1, "--shard", "1/1")
    assert "arc/000.csv" in kineme(*command, status=3)
    kineme("gather", parts, status=3)
    with ActionLibrary(tmp_path / "library") as library:
        assert len(library) == 0
    assert "do not move" in kineme("gather", parts, "--partial", status=3)
    with ActionLibrary(tmp_path / "library") as library:
        assert 0 < len(library) < 14


def test_a_part_of_other_bytes_is_refused(archive, tmp_path):
    parts = tmp_path / "out"
    kineme("learn", archive, "--library", tmp_path / "library", "-o", parts, "--shard", "1/1")
    (path,) = parts.glob("part-*")
    table = parquet.read_table(path)
    short = [blob[:-4] for blob in table.column("weights").to_pylist()]
    parquet.write_table(table.set_column(table.schema.get_field_index("weights"), "weights", [short]), path)
    assert "as kineme learn writes them" in kineme("gather", parts, status=1)


def test_archives_in_a_store_are_learned_too(archive, one, tmp_path, small_pieces):
    system = pytest.importorskip("fsspec").filesystem("memory")
    system.put(str(archive), "/fleet", recursive=True)
    try:
        rows, _ = by_pieces(tmp_path / "library", ["memory://fleet"])
    finally:
        system.rm("/fleet", recursive=True)
    assert sorted(row[1] for row in rows["source"])[0].startswith("memory://fleet/ann/")
    assert [row[4:8] for row in rows["movement"]] == [row[4:8] for row in one["movement"]]
    assert rows["raw"] == one["raw"]
