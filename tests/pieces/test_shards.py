"""Shards: what they hold, that they come back, and that others are refused in words."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pytest
import shard_samples as samples

from kineme.errors import DataError, SpecificationError
from kineme.pieces.search import open_shards
from kineme.pieces.shards import open_shard, read_reduction, shard_table, write_reduction, write_shard
from kineme.similarity.bounds import reduce_features
from kineme.similarity.describe import feature_rows
from soaking import some


@pytest.fixture(scope="module", params=some([1, 2, 3], 1))
def made(request, tmp_path_factory):
    """The reduction of a library, an archive, and the folder of its shards."""
    folder = tmp_path_factory.mktemp("shards")
    reduction = samples.reduction_of(samples.library(folder / "library", request.param))
    paths, labels = samples.movements(50, request.param, seed=3)
    return reduction, paths, labels, samples.shards(folder / "shards", reduction, paths, labels=labels)


def _copy(made, to):
    """The same shards in another folder, which a test may damage."""
    reduction, paths, _, _ = made
    return samples.shards(to, reduction, paths)


def test_a_shard_holds_where_movements_come_from_and_their_features(made):
    reduction, paths, labels, folder = made
    read = [open_shard(path, reduction) for path in sorted(folder.glob("part-*.arrow"))]
    assert sum(map(len, read)) == 50
    rows = np.arange(len(read[0]))
    part = paths[: len(rows)]
    assert read[0].take(rows, "place") == [str(i % 3) for i in rows]
    assert read[0].take(rows, "path") == [f"file {i // 3:04d}.csv" for i in rows]
    assert read[0].take(rows, "label") == labels[: len(rows)].tolist()
    assert read[0].take(rows, "start") == pytest.approx(rows)
    assert read[0].take(rows, "duration") == pytest.approx([1.5] * len(rows))
    blocks = feature_rows(list(part), reduction.specification)
    np.testing.assert_allclose(read[0].take(rows, "rows"), np.concatenate(blocks, axis=1), atol=2e-6)
    reduced = reduce_features(reduction.bases, blocks[: len(reduction.bases)], paths.shape[2])
    for column, features in zip(reduction.columns(), reduced, strict=True):
        expected = np.column_stack(features)
        np.testing.assert_allclose(
            read[0].take(rows, "reduced")[:, column], expected, atol=2e-5 * np.abs(expected).max()
        )


def test_rows_are_taken_in_any_order_across_batches(made, tmp_path, monkeypatch):
    reduction, paths, _, _ = made
    monkeypatch.setattr("kineme.pieces.shards.BATCH", 7)
    write_shard(tmp_path / "part-0.arrow", [reduction.table(samples.recordings(paths[:30]))])
    shard = open_shard(tmp_path / "part-0.arrow", reduction)
    assert len(shard.batches) == 5
    rows = np.array([29, 0, 7, 6, 13, 7])
    assert shard.take(rows, "start") == pytest.approx(rows)
    every = shard.take(np.arange(30), "reduced")
    np.testing.assert_array_equal(shard.take(rows, "reduced"), every[rows])


def test_numbers_are_mapped_and_not_copied(made):
    reduction, _, _, folder = made
    before = pa.total_allocated_bytes()
    shard = open_shard(min(folder.glob("part-*.arrow")), reduction)
    numbers = shard.numbers["rows"][0]
    assert not numbers.flags.writeable
    assert pa.total_allocated_bytes() - before < numbers.nbytes / 4


def test_tables_of_several_files_become_one_shard(made, tmp_path):
    reduction, paths, _, _ = made
    tables = [reduction.table(samples.recordings(paths[i : i + 3], i)) for i in (0, 3)]
    assert write_shard(tmp_path / "part-0.arrow", tables, {"library": reduction.library}) == 6
    shard = open_shard(tmp_path / "part-0.arrow", reduction)
    assert shard.take(np.arange(6), "path") == ["file 0000.csv"] * 3 + ["file 0001.csv"] * 3
    with pa.memory_map(str(tmp_path / "part-0.arrow")) as mapped:
        said = json.loads(pa.ipc.open_file(mapped).schema.metadata[b"kineme"])
    assert said == {"task": "features", "library": reduction.library}


def test_the_same_movements_give_the_same_bytes(made, tmp_path):
    reduction, paths, _, _ = made
    for name in ("a", "b"):
        table = shard_table(reduction.specification, reduction.bases, samples.recordings(paths[:5]))
        write_shard(tmp_path / name, [table])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_bases_and_comparison_come_back(made):
    reduction, paths, _, folder = made
    back = read_reduction(folder)
    assert (back.library, back.digest) == (reduction.library, reduction.digest)
    assert back.comparison.representations == reduction.comparison.representations
    assert back.specification == reduction.specification
    one, other = (each.comparison.describe(each.comparison.checked(paths[:6])) for each in (back, reduction))
    np.testing.assert_array_equal(
        back.comparison.similarity.log_average(one, one), reduction.comparison.similarity.log_average(other, other)
    )


@pytest.mark.parametrize("recognizer", [{"max_angle": 0.5}, {"mean": "geometric"}, {"scale": "none"}])
def test_the_parameters_of_a_recognizer_come_back(recognizer, tmp_path):
    reduction = samples.reduction_of(samples.library(tmp_path / "library", 2, **recognizer))
    write_reduction(tmp_path, reduction)
    assert read_reduction(tmp_path).comparison.specification == reduction.comparison.specification


def test_a_folder_keeps_its_bases(made, tmp_path):
    reduction, _, _, folder = made
    before = (folder / "bases.npz").read_bytes()
    write_reduction(folder, reduction)
    assert (folder / "bases.npz").read_bytes() == before
    other = samples.reduction_of(samples.library(tmp_path / "other", reduction.comparison.n_dims, n=30))
    with pytest.raises(DataError, match="another"):
        write_reduction(folder, other)


def test_a_library_without_symbols_has_no_widths(tmp_path):
    import kineme

    with kineme.ActionLibrary(tmp_path / "library", create=True) as library:
        library.learn(samples.movements(5)[0])
    with pytest.raises(SpecificationError, match="symbol"):
        samples.reduction_of(tmp_path / "library")


def test_a_shard_of_other_bases_is_refused(made, tmp_path):
    reduction, paths, _, _ = made
    other = samples.reduction_of(samples.library(tmp_path / "other", reduction.comparison.n_dims, n=30))
    folder = _copy(made, tmp_path / "shards")
    write_shard(folder / "part-9999.arrow", [other.table(samples.recordings(paths[:4]))])
    with pytest.raises(DataError, match=r"part-9999\.arrow.*other bases or another library"):
        open_shards(folder)


@pytest.mark.parametrize("said", [{"library": "another"}, {"task": "annotate"}])
def test_a_shard_that_says_it_is_another_is_refused(made, tmp_path, said):
    reduction, paths, _, _ = made
    write_shard(tmp_path / "part-0.arrow", [reduction.table(samples.recordings(paths[:4]))], said)
    with pytest.raises(DataError, match=r"another library|the task 'annotate'"):
        open_shard(tmp_path / "part-0.arrow", reduction)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 0.99])
def test_a_truncated_shard_is_refused(made, tmp_path, share):
    folder = _copy(made, tmp_path)
    path = folder / "part-0001.arrow"
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DataError, match=r"part-0001\.arrow to be a shard"):
        open_shards(folder)


@pytest.mark.parametrize("name", ["reduced", "rows"])
def test_damaged_numbers_are_refused(made, tmp_path, name):
    reduction, paths, _, _ = made
    folder = _copy(made, tmp_path)
    path = folder / "part-0001.arrow"
    width = open_shard(path, reduction).numbers[name][0].shape[1]
    data = bytearray(path.read_bytes())
    start = data.find(open_shard(path, reduction).numbers[name][0].tobytes())
    for row in range(len(paths) // 3):
        at = start + 4 * width * row
        data[at : at + 4] = np.float32(12345.0).tobytes()
    path.write_bytes(data)
    opened = open_shards(folder)
    with pytest.raises(DataError, match=r"part-0001\.arrow"):
        opened.prepare() if name == "reduced" else opened.nearest(paths, 5)


@pytest.mark.parametrize("change", ["type", "null", "width", "missing"])
def test_shards_with_other_columns_are_refused(made, tmp_path, change):
    reduction, paths, _, _ = made
    table = reduction.table(samples.recordings(paths[:4]))
    place = table.schema.get_field_index("place")
    width = table.schema.field("rows").type.list_size - 1
    flat = pa.array(np.zeros(4 * width, np.float32))
    changed = {
        "type": lambda: table.set_column(place, "place", pa.array([1, 2, 3, 4])),
        "null": lambda: table.set_column(place, "place", pa.array(["0", None, "1", "2"])),
        "width": lambda: table.drop(["rows"]).append_column("rows", pa.FixedSizeListArray.from_arrays(flat, width)),
        "missing": lambda: table.drop(["start"]),
    }[change]()
    write_shard(tmp_path / "part-0.arrow", [changed])
    with pytest.raises(DataError, match="shard of features"):
        open_shard(tmp_path / "part-0.arrow", reduction)


@pytest.mark.parametrize("damage", ["none", "empty", "arrays", "widths", "basis"])
def test_damaged_bases_are_refused(made, tmp_path, damage):
    folder = _copy(made, tmp_path)
    path = folder / "bases.npz"
    with np.load(path) as arrays:
        held = {name: arrays[name] for name in arrays.files}
    if damage == "none":
        path.unlink()
    elif damage == "empty":
        path.write_bytes(b"")
    else:
        held |= {"arrays": {"about": np.array("{}")}, "widths": {"widths": -held["widths"]},
                 "basis": {"basis 0": 2 * held["basis 0"]}}[damage]  # fmt: skip
        np.savez(path, **held)
    with pytest.raises(DataError, match=r"bases\.npz"):
        open_shards(folder)


def test_a_folder_without_movements_is_refused(made, tmp_path):
    write_reduction(tmp_path, made[0])
    with pytest.raises(DataError, match="expected shards of movements"):
        open_shards(tmp_path)


def test_a_part_of_a_piece_without_movements_is_passed_over(made, tmp_path):
    folder = _copy(made, tmp_path)
    empty = pa.table({})
    with pa.OSFile(str(folder / "part-zzzz.arrow"), "wb") as sink, pa.ipc.new_file(sink, empty.schema):
        pass
    assert len(open_shards(folder)) == 50
