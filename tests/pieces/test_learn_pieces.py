"""What is learned by pieces is what one process learns: the same rows of all tables, in the same order."""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from kineme import ActionLibrary
from kineme.cli import main, pieces
from kineme.library.storage.connection import FILE
from kineme.library.storage.schema import COLUMNS
from lerobot_sets import write_v3
from soaking import slow

#: Columns that say when and by which call a row was written, not what was learned.
_OTHER = {"id": ("meta",), "read_at": ("source",)}
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


def draw_archive(folder, seed, n_files, heads, uneven, depth):
    """Write recordings of some people, in folders person/label; some are copies."""
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
    assert rows == of_one_process(tmp_path / "one", [archive], *options)
    assert said["added"] + said["duplicates"] >= 13
    with ActionLibrary(tmp_path / "pieces") as library:
        assert library.verify() == []
