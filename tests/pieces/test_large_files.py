"""Pieces of one large file, groups of rows or episodes of a file of frames: each movement is in one of them."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from piece_work import lengths, write_rows
from pyarrow import parquet

import kineme
from kineme.pieces import map as map_pieces
from kineme.pieces import plan
from lerobot_sets import change, shard_of, write_lance, write_v2, write_v3


def _movements(outcomes, output):
    tables = [parquet.read_table(output / f"part-{outcome.piece.key}.parquet") for outcome in outcomes]
    return [tuple(row.values()) for table in tables for row in table.to_pylist()]


def told(recordings):
    """Return all that is read of each movement, in few numbers."""
    rows = lengths(recordings)
    return {
        "place": [source.place for source in recordings.sources], "label": rows["label"], "samples": rows["samples"],
        "sum": [float(np.abs(each.positions).sum() + each.times.sum()) for each in recordings.demonstrations],
    }  # fmt: skip


@given(
    counts=st.lists(st.integers(5, 90), min_size=2, max_size=25),
    group=st.integers(20, 120), size=st.integers(200, 3000), as_names=st.booleans(),
)  # fmt: skip
def test_movements_across_row_groups_are_read_once(tmp_path_factory, counts, group, size, as_names):
    folder = tmp_path_factory.mktemp("rows")
    names = [f"run {k:03d}" for k in range(len(counts))] if as_names else None
    write_rows(folder / "archive" / "all.parquet", counts, group, names)
    pieces = plan(str(folder / "archive"), size).pieces
    if len(pieces) > 1:
        numbers = [number for piece in pieces for number in piece.numbers]
        assert numbers == list(range(-(-sum(counts) // group)))
        assert [bool(piece.begun) for piece in pieces] == [False] + [True] * (len(pieces) - 1)
    outcomes = map_pieces(told, folder / "archive", output=folder / "out", size=size)
    assert {outcome.state for outcome in outcomes} == {"done"}
    direct = told(kineme.read_recordings(folder / "archive"))
    assert _movements(outcomes, folder / "out") == list(zip(*direct.values(), strict=True))


def test_a_large_file_is_divided_and_its_pieces_are_named(tmp_path):
    write_rows(tmp_path / "archive" / "all.parquet", [70] * 60)
    (tmp_path / "archive" / "zoo.csv").write_text("t,x,y\n0,0,0\n1,1,1\n2,3,1\n")
    pieces = plan(str(tmp_path / "archive"), 5000).pieces
    assert len(pieces) > 4
    assert str(pieces[0]).startswith("all.parquet, row groups 0 to ")
    assert str(pieces[-1]) == "zoo.csv"
    assert all(piece.sources == pieces[0].sources for piece in pieces[:-1])


@pytest.mark.parametrize(
    "odd", ["scattered", "nulls", "labels alone", "no statistics", "numbers of measurement", "damaged"]
)
def test_files_whose_movements_do_not_follow_each_other_are_one_piece(tmp_path, odd):
    counts = [70] * 60
    path = write_rows(tmp_path / "archive" / "all.parquet", counts)
    table = parquet.read_table(path)
    episode = table.column("episode").to_numpy()
    if odd == "scattered":
        episode = episode % 7
    values = pa.array(episode, mask=episode == 3) if odd == "nulls" else pa.array(episode)
    if odd == "numbers of measurement":
        values = pa.array(episode * 1.5)
    name = "label" if odd == "labels alone" else "episode"
    table = table.set_column(0, name, values.cast(pa.string()) if name == "label" else values)
    parquet.write_table(table, path, row_group_size=100, write_statistics=odd != "no statistics")
    if odd == "damaged":
        path.write_bytes(path.read_bytes()[:-9])
    assert len(plan(str(tmp_path / "archive"), 5000).pieces) == 1


def test_the_column_that_is_asked_for_divides(tmp_path):
    write_rows(
        tmp_path / "archive" / "all.parquet", [70] * 60, take=np.repeat(np.arange(30), 140), t=np.arange(4200) / 50
    )
    outcomes = map_pieces(told, tmp_path / "archive", output=tmp_path / "out", size=4000, movement="take")
    assert len(outcomes) > 3
    direct = told(kineme.read_recordings(tmp_path / "archive", movement="take"))
    assert _movements(outcomes, tmp_path / "out") == list(zip(*direct.values(), strict=True))
    assert len(direct["place"]) == 30


def _in_groups(folder, group=60):
    """Write the frames of a data set in groups of so many rows."""
    for path in folder.glob("data/*/*.parquet"):
        parquet.write_table(parquet.read_table(path), path, row_group_size=group)


def _by_pieces(folder, output, size=3000):
    """Return the movements that pieces read, and all problems."""
    planned = plan(str(folder), size)
    outcomes = map_pieces(told, folder, output=output, size=size)
    assert {outcome.state for outcome in outcomes} == {"done"}
    problems = [*planned.problems, *(problem for outcome in outcomes for problem in outcome.problems)]
    return _movements(outcomes, output), list(map(str, problems))


def test_pieces_of_a_file_of_frames_read_their_own_groups(tmp_path, monkeypatch):
    folder = write_v3(tmp_path / "set", [40 + k for k in range(30)], per_shard=30)
    _in_groups(folder)
    read = []
    iter_batches = parquet.ParquetFile.iter_batches

    def counting(self, *arguments, **options):
        read.extend(options.get("row_groups", ()))
        return iter_batches(self, *arguments, **options)

    monkeypatch.setattr(parquet.ParquetFile, "iter_batches", counting)
    pieces = plan(str(folder), 3000).pieces
    assert len(pieces) > 3
    movements, problems = _by_pieces(folder, tmp_path / "out")
    n_groups = parquet.ParquetFile(shard_of(folder)).num_row_groups
    assert len(read) <= n_groups + 3 * len(pieces) < n_groups * len(pieces)
    assert problems == []
    assert movements == list(zip(*told(kineme.read_recordings(folder)).values(), strict=True))


@pytest.mark.parametrize("number", [3, 7, 99, -1])
def test_episodes_that_the_meta_folder_does_not_declare_are_said_once(tmp_path, number):
    folder = write_v3(tmp_path / "set", [40] * 30, per_shard=15)
    _without(folder, 7)
    change(folder, lambda frames: frames.assign(episode_index=frames.episode_index.replace(7, number)))
    _in_groups(folder)
    movements, problems = _by_pieces(folder, tmp_path / "out")
    direct = kineme.read_recordings(folder)
    assert len(problems) == 1, problems
    assert len(movements) == 29
    if number != 3:  # which is there twice: direct reading takes neither
        assert [place for place, *_ in movements] == [source.place for source in direct.sources]


def test_a_table_of_lance_says_them_too(tmp_path):
    pytest.importorskip("lance")
    folder = write_lance(tmp_path / "set", [40] * 12)
    _without(folder, 7)
    movements, problems = _by_pieces(folder, tmp_path / "out", 1)
    assert len(movements) == 11
    assert problems == ["set: episode 7: expected an episode that the meta folder declares"]


def _without(folder, episode):
    """Leave an episode out of the meta folder."""
    (path,) = folder.glob("meta/episodes/*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(table.filter(pa.compute.not_equal(table.column("episode_index"), episode)), path)


def test_frames_in_another_file_than_declared_are_said(tmp_path):
    folder = write_v3(tmp_path / "set", [40] * 12, per_shard=6)
    change(folder, lambda frames: frames.assign(episode_index=frames.episode_index.replace(5, 8)), 0)
    _, problems = _by_pieces(folder, tmp_path / "out")
    first, second = (f"data/chunk-000/file-00{k}.parquet" for k in (0, 1))
    assert len(problems) == 2
    assert any(f"episode 5: expected frames in {first}, got none" in problem for problem in problems)
    assert any(f"episode 8: expected its frames in {second}, got some in {first}" in problem for problem in problems)


def test_files_that_no_episode_names_and_what_the_meta_folder_lacks_are_said(tmp_path):
    folder = write_v2(tmp_path / "set", [40] * 12)
    lines = folder / "meta" / "episodes.jsonl"
    rows = lines.read_text().splitlines()
    lines.write_text("\n".join([*rows[:4], "{", *rows[5:]]) + "\n")
    movements, problems = _by_pieces(folder, tmp_path / "out", 1)
    assert len(movements) == 11
    assert "meta/episodes.jsonl, line 5" in problems[0]
    assert "expected episodes in data/chunk-000/episode_000004.parquet, the meta folder names none" in problems[1]
    assert len(problems) == 2


def test_an_episode_that_is_declared_twice_is_in_one_piece(tmp_path):
    folder = write_v3(tmp_path / "set", [40] * 12, per_shard=6)
    (path,) = folder.glob("meta/episodes/*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(pa.concat_tables([table, table]), path)
    numbers = [number for piece in plan(str(folder), 1).pieces for number in piece.numbers]
    assert numbers == sorted(set(numbers))
