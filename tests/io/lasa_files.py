"""Real recordings written in every format that can be read: one writer per kind of source."""

from __future__ import annotations

import shutil

import numpy as np
import pyarrow as pa
from pyarrow import parquet

import kineme
from kineme.datasets import lasa

SHAPES = ("CShape", "GShape", "Snake")


def demonstrations():
    return kineme.load_lasa(SHAPES)


def _slug(movement):
    return movement.name.replace(" ", "_")


def _columns(demos):
    names = np.repeat([_slug(movement) for movement in demos], demos.lengths)
    labels = np.repeat(demos.labels, demos.lengths)
    return {"demo": names, "label": labels, "time": demos.times, "x": demos.positions[:, 0], "y": demos.positions[:, 1]}


def _rows(columns, separator):
    cells = [[repr(float(cell)) if values.dtype.kind == "f" else str(cell) for cell in values]
             for values in columns.values()]  # fmt: skip
    return "\n".join([separator.join(columns), *(separator.join(row) for row in zip(*cells, strict=True))]) + "\n"


def _per_movement(folder, ending, write):
    for movement in demonstrations():
        (folder / movement.label).mkdir(exist_ok=True)
        write(folder / movement.label / (_slug(movement) + ending), movement)
    return folder


def _of_one(movement):
    return {"time": movement.times, "x": movement.positions[:, 0], "y": movement.positions[:, 1]}


def csv_folder(folder):
    return _per_movement(folder, ".csv", lambda path, movement: path.write_text(_rows(_of_one(movement), ",")))


def tsv_folder(folder):
    return _per_movement(folder, ".tsv", lambda path, movement: path.write_text(_rows(_of_one(movement), "\t")))


def npz_folder(folder):
    return _per_movement(
        folder, ".npz", lambda path, movement: np.savez(path, times=movement.times, positions=movement.positions)
    )


def parquet_folder(folder):
    return _per_movement(
        folder, ".parquet", lambda path, movement: parquet.write_table(pa.table(_of_one(movement)), path)
    )


def matlab_folder(folder):
    for shape in SHAPES:
        shutil.copy(lasa._resources()[shape], folder / f"{shape}.mat")
    return folder


def long_csv(folder):
    (folder / "all.csv").write_text(_rows(_columns(demonstrations()), ","))
    return folder / "all.csv"


def long_semicolons(folder):
    text = _rows(_columns(demonstrations()), ";").replace(".", ",")
    (folder / "all.txt").write_bytes(b"\xef\xbb\xbf# a comment\r\n" + text.replace("\n", "\r\n").encode())
    return folder / "all.txt"


def long_parquet(folder):
    parquet.write_table(pa.table(_columns(demonstrations())), folder / "all.parquet")
    return folder / "all.parquet"


def numbered_npz(folder):
    arrays = {f"x_{k}": movement.positions for k, movement in enumerate(demonstrations())}
    times = {f"t_{k}": movement.times for k, movement in enumerate(demonstrations())}
    np.savez(folder / "all.npz", **arrays, **times, labels=demonstrations().labels.astype(str))
    return folder / "all.npz"


def block_npz(folder):
    demos = demonstrations()
    positions, times = demos.positions.reshape(len(demos), -1, 2), demos.times.reshape(len(demos), -1)
    np.savez(folder / "all.npz", positions=positions, times=times, labels=demos.labels.astype(str))
    return folder / "all.npz"


def joined_npz(folder):
    demos = demonstrations()
    np.savez(
        folder / "all.npz",
        positions=demos.positions,
        times=demos.times,
        offsets=demos.offsets,
        labels=demos.labels.astype(str),
    )
    return folder / "all.npz"


SOURCES = {
    write.__name__: write
    for write in (
        csv_folder, tsv_folder, npz_folder, parquet_folder, matlab_folder,
        long_csv, long_semicolons, long_parquet, numbered_npz, block_npz, joined_npz,
    )
}  # fmt: skip
