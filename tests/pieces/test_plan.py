"""Pieces cover an archive once, whoever plans it, and few of them change where files are added."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from piece_work import write_archive

from kineme.errors import DataError, SpecificationError
from kineme.pieces import plan
from lerobot_sets import write_v2, write_v3


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    return write_archive(tmp_path_factory.mktemp("archive"), 120)


def _names(pieces):
    return [unit.name for piece in pieces for unit in piece.units]


@given(st.integers(1, 400_000))
def test_pieces_of_any_size_hold_each_file_once_in_order(archive, size):
    pieces = plan(str(archive), size).pieces
    names = _names(pieces)
    assert names == sorted(str(path.relative_to(archive)) for path in archive.rglob("*.csv"))
    assert len({piece.key for piece in pieces}) == len(pieces)
    assert all(piece.size <= 2 * size + 3000 for piece in pieces)
    assert all((piece.first, piece.last) == (piece.units[0].name, piece.units[-1].name) for piece in pieces)


def test_a_file_of_half_a_piece_is_the_last_of_its_piece(tmp_path):
    for k in range(30):
        (tmp_path / f"{k:02d}.csv").write_text("t,x\n" + "0,0\n" * (1000 if k % 3 else 10))
    pieces = plan(str(tmp_path), 8000).pieces
    assert len(pieces) == 20
    assert all(unit.files[0].size < 3000 for piece in pieces for unit in piece.units[:-1])


@given(st.integers(1, 9))
def test_shards_share_the_pieces(archive, count):
    whole = plan(str(archive), 8000)
    shards = [whole.shard(rank, count).pieces for rank in range(1, count + 1)]
    assert sorted(piece.key for shard in shards for piece in shard) == sorted(piece.key for piece in whole.pieces)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


def test_an_added_file_changes_few_pieces(tmp_path):
    folder = write_archive(tmp_path / "archive", 300)
    before = {(piece.key, piece.sources) for piece in plan(str(folder), 20_000).pieces}
    (folder / "arc" / "0000b.csv").write_text((folder / "arc" / "0000.csv").read_text())
    after = {(piece.key, piece.sources) for piece in plan(str(folder), 20_000).pieces}
    assert len(before) > 10
    assert 1 <= len(after - before) <= 3


def test_a_piece_is_the_same_wherever_the_archive_lies(tmp_path):
    folder = write_archive(tmp_path / "archive")
    before = plan(str(folder), 8000).pieces
    folder.rename(tmp_path / "elsewhere")
    after = plan(str(tmp_path / "elsewhere"), 8000).pieces
    assert [(one.key, one.sources) for one in before] == [(one.key, one.sources) for one in after]


@pytest.mark.parametrize("write", [write_v2, write_v3])
def test_episodes_are_divided_along_files(tmp_path, write):
    lengths = [40 + k for k in range(12)]
    write(tmp_path / "set", lengths)
    for size in (1, 3000, 10_000_000):
        pieces = plan(str(tmp_path / "set"), size).pieces
        assert [number for piece in pieces for number in piece.numbers] == list(range(12))
        assert all(any(file.name.startswith("data/") for file in piece.units[0].files) for piece in pieces)
    assert len(pieces) == 1
    inside = plan(str(tmp_path), 3000).pieces
    assert [unit.name for piece in inside for unit in piece.units[:1]] == ["set"] * len(inside)


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(DataError, match="found nothing"):
        plan(str(tmp_path / "nowhere"))
    with pytest.raises(DataError, match="found none"):
        plan(str(tmp_path))
    with pytest.raises(SpecificationError, match="without a name and password"):
        plan("s3://me:secret@bucket/fleet")
    (tmp_path / "a.csv").write_text("t,x\n0,0\n1,1\n")
    with pytest.raises(SpecificationError, match="1/3 to 3/3"):
        plan(str(tmp_path)).shard(4, 3)
    with pytest.raises(SpecificationError, match="at least one byte"):
        plan(str(tmp_path), 0)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "meta").mkdir()
    (tmp_path / "set" / "data").mkdir()
    (tmp_path / "set" / "meta" / "info.json").write_text("{}")
    planned = plan(str(tmp_path))
    assert [problem.file for problem in planned.problems] == ["set"]
    assert _names(planned.pieces) == ["a.csv"]
