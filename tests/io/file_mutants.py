"""Small files of every format, ways to spoil them, and what must hold of whatever is still read from them."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import tempfile
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np

import kineme
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives
from kineme.io.lerobot.copy import copy_with_motions
from kineme.io.lerobot.motions import Motion
from kineme.io.reading.episodes import read_episodes
from kineme.io.reading.read_labels import labeled_pieces, read_labels
from kineme.orientation import PosePrimitives
from lerobot_sets import write_v2, write_v3
from robot_array_sets import write_aloha, write_robomimic, write_umi

N_SAMPLES = 12
WORDS = (
    "nan", "inf", "-inf", "1e308", "-1e400", "1e-320", "null", "", " ", "-0", "wave", "é", "\0", "#", "//", '"', "'",
    ",", ";", "\n", "\r", "\t", "[", "]", "{", "}", "True", "0x1", "1_0", "²", "2024-01-01T00:00:00Z", "9" * 400,
)  # fmt: skip
_TEXTS = (".csv", ".tsv", ".txt", ".ts", ".json", ".jsonl", ".bvh", ".eaf", ".mot", ".sto", ".mvnx")
NUMBERS = (0, 1, 2, 7, 127, 128, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)


def _movement(k=0):
    t = np.linspace(0.0, 1.0, N_SAMPLES + k)
    return t, np.column_stack((np.sin(3 * t + k), t**2))


def _wide(separator, head=True, comma=False):
    t, x = _movement()
    lines = [separator.join(("time", "x", "y"))] if head else []
    lines += [separator.join(map(repr, row)) for row in np.column_stack((t, x)).tolist()]
    text = "\n".join(lines) + "\n"
    return (text.replace(".", ",") if comma else text).encode()


def _long():
    lines = ["movement,label,t,x,y"]
    for k, label in enumerate(("wave", '"nod, twice"', "bow")):
        t, x = _movement(k)
        lines += [f"m{k},{label},{a!r},{b!r},{c!r}" for a, (b, c) in zip(t.tolist(), x.tolist(), strict=True)]
    return "\n".join(lines).encode()


def _dates():
    return ("stamp;x\n" + "".join(f"2024-05-06T07:08:{k:02d}.25Z;{k * k}\n" for k in range(9))).encode()


def _npz(save=np.savez, **arrays):
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


def _npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def _cells():
    cells = np.empty((1, 2), dtype=object)
    for k in range(2):
        cells[0, k] = {"t": _movement(k)[0], "q": _movement(k)[1].T, "label": "wave"}
    return cells


def _optional(*writers):
    """The files whose packages are installed."""
    written = {}
    for name, write in writers:
        with contextlib.suppress(ImportError):
            written[name] = write()
    return written


def _json(**entries):
    return json.dumps({name: np.asarray(value).tolist() for name, value in entries.items()}).encode()


def _parquet(**columns):
    import pyarrow as pa
    from pyarrow import parquet

    buffer = io.BytesIO()
    parquet.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def _bvh():
    head = "HIERARCHY\nROOT Hip\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zrotation\n}\nMOTION\nFrames: 12\n"
    rows = np.column_stack((_movement()[1], _movement()[0])).tolist()
    return (head + "Frame Time: 0.01\n" + "\n".join(" ".join(map(repr, row)) for row in rows)).encode()


def _vicon():
    head = "Trajectories\n100\n,,A:one,,,A:two,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    return (head + "\n".join(f"{k},0,{k},{k * k},1,2,{k},3" for k in range(N_SAMPLES))).encode()


def _motive():
    head = "Format Version,1.23,Export Frame Rate,120,Rotation Type,Quaternion,Length Units,Meters\n\n"
    head += ",,Rigid Body,Rigid Body,Rigid Body\n,,A,A,A\n,,1,1,1\n,,Position,Position,Position\n"
    rows = "\n".join(f"{k},{k / 120},{k},{k * k},1" for k in range(N_SAMPLES))
    return f"{head}Frame,Time (Seconds),X,Y,Z\n{rows}".encode()


def _qualisys():
    head = f"NO_OF_FRAMES\t{N_SAMPLES}\nFREQUENCY\t200\nMARKER_NAMES\tone\ttwo\n"
    return (head + "\n".join(f"{k}\t1\t2\t{k * k}\t0.5\t0" for k in range(N_SAMPLES))).encode()


def _storage():
    head = "DataRate=60\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.4\nendheader\ntime\thip_imu\n"
    return (head + "\n".join(f"{k / 60}\t1,0,{k / 100},0" for k in range(N_SAMPLES))).encode()


def _motion():
    head = f"Coordinates\nversion=1\nnRows={N_SAMPLES}\nnColumns=3\ninDegrees=yes\nendheader\ntime\thip\tpelvis_tx\n"
    return (head + "\n".join(f"{k / 60}\t{k}\t{k * k}" for k in range(N_SAMPLES))).encode()


def _mvnx():
    head = '<?xml version="1.0"?><mvnx><subject frameRate="60"><segments><segment label="Hip"/></segments><frames>'
    frames = "".join(
        f'<frame time="{17 * k}" type="normal"><orientation>1 0 0 0</orientation>'
        f"<position>{k} {k * k} 1</position></frame>"
        for k in range(N_SAMPLES)
    )
    return f"{head}{frames}</frames></subject></mvnx>".encode()


def _trc():
    head = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tUnits\n100\tmm\nFrame#\tTime\tone\t\t\n\t\tX1\tY1\tZ1\n\n"
    return (head + "\n".join(f"{k}\t{k / 100}\t{k}\t{k * k}\t1" for k in range(N_SAMPLES))).encode()


def _hdf5():
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for k in range(2):
            t, x = _movement(k)
            file[f"data/demo_{k}/t"], file[f"data/demo_{k}/obs/pos"] = t, x
            file.create_dataset(f"data/demo_{k}/packed", data=t, compression="gzip")
    return buffer.getvalue()


def _robot(write, name):
    """A set of a robot; of several files the first."""
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / name, lengths=(8, 9, 10))
        return (path if path.is_file() else path / "episode_0.hdf5").read_bytes()


def _c3d():
    import ezc3d

    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100]
    content["parameters"]["POINT"]["LABELS"]["value"] = ("one", "two")
    content["data"]["points"] = np.arange(8.0 * N_SAMPLES).reshape(4, 2, N_SAMPLES)
    with tempfile.TemporaryDirectory() as folder:
        content.write(str(Path(folder) / "a.c3d"))
        return (Path(folder) / "a.c3d").read_bytes()


def _vectors():
    import pyarrow as pa

    t, x = _movement()
    fixed = pa.array(x.tolist(), pa.list_(pa.float32(), 2))
    return _parquet(**{"time": t, "observation.state": fixed, "lists": pa.array([[1.0, 2.0]] * N_SAMPLES)})


def _demos():
    """A list of structures as LASA's."""
    demos = np.empty((1, 3), dtype=object)
    for k in range(3):
        t, x = _movement(k)
        demos[0, k] = {"pos": x.T, "t": t[None], "dt": 0.01}
    return demos


def _mat(compressed, **content):
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, content, do_compression=compressed)
    return buffer.getvalue()


def _saved(cls):
    t, x = np.linspace(0, 3, 120), None
    if cls is RhythmicPrimitives:
        x = np.column_stack((np.sin(7 * t), np.cos(7 * t) ** 3))
        learned = kineme.RhythmicDMP(n_basis=7).learn(kineme.Demonstrations.from_arrays([x, 2 * x], ["a", "b"], [t, t]))
    else:
        learned = kineme.DMP(n_basis=7).learn(kineme.Demonstrations.from_arrays([_movement()[1]] * 2, ["a", "b"]))
    if cls is PosePrimitives:
        from kineme.orientation import PoseDMP, exp

        q = exp(t[:, None] * [0.3, 0.2, 0.1])
        learned = PoseDMP(kineme.DMP(n_basis=7)).learn([np.hstack((np.sin(t[:, None] * [1, 2, 3]), q))])
    with tempfile.TemporaryDirectory() as folder:
        return learned.save(Path(folder) / "saved").read_bytes()


_SAVED = {
    "primitives.kineme": kineme.dmp.Primitives,
    "rhythm.kineme": RhythmicPrimitives,
    "poses.kineme": PosePrimitives,
}


@functools.cache
def _messages():
    from bag_files import write_json_mcap

    with tempfile.TemporaryDirectory() as folder:
        topics = {"/hand": [{"timestamp": {"sec": k, "nsec": 0}, "x": k / 3} for k in range(N_SAMPLES)]}
        return write_json_mcap(Path(folder) / "a.mcap", topics).read_bytes()


def _bag(kind, compress=False):
    """One file with joints, poses and transforms, of which the joints and the transforms are not read by themselves."""
    from bag_files import Maker, stamps, write_bag

    m, messages = Maker(kind), []
    for k, ns in enumerate(stamps(N_SAMPLES)):
        row = [0.1 * k, 0.0, 0.0, 0.0, 0.0, np.sin(k / 9), np.cos(k / 9)]
        messages.append(("/tool", ns, m.pose_stamped(ns, row)))
        messages.append(("/chat", ns, m.string("wave")))
    with tempfile.TemporaryDirectory() as folder:
        path = write_bag(folder, kind, messages, compress=compress)
        files = [path] if path.is_file() else [part for part in path.iterdir() if part.name != "metadata.yaml"]
        return files[0].read_bytes()


@functools.cache
def _lerobot(write):
    """A data set, as an archive of its files: one of them is damaged at a time."""
    buffer = io.BytesIO()
    with tempfile.TemporaryDirectory() as name, zipfile.ZipFile(buffer, "w") as archive:
        folder = write(Path(name) / "set", lengths=(8, 9, 10))
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            archive.writestr(str(path.relative_to(folder)), path.read_bytes())
    return buffer.getvalue()


def _elan():
    slots = "".join(f'<TIME_SLOT TIME_SLOT_ID="t{k}" TIME_VALUE="{200 * k}"/>' for k in range(4))
    rows = "".join(
        f'<ANNOTATION><ALIGNABLE_ANNOTATION TIME_SLOT_REF1="t{k}" TIME_SLOT_REF2="t{k + 1}"><ANNOTATION_VALUE>wave'
        "</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>"
        for k in (0, 2)
    )
    return f'<D><TIME_ORDER>{slots}</TIME_ORDER><TIER TIER_ID="symbol">{rows}</TIER></D>'.encode()


def _label_tables():
    rows = [{"start": 0.1, "end": 0.4, "label": "wave"}, {"start": 0.5, "end": 0.9, "label": "nod, twice"}]
    lines = "\n".join(f'{row["start"]},{row["end"]},"{row["label"]}"' for row in rows)
    tracks = "\n".join(f"{row['start']}\t{row['end']}\t{row['label']}" for row in rows)
    return {
        "named.labels.csv": f"start,end,label\n{lines}\n".encode(),
        "named.labels.txt": f"{tracks}\n\\\t1\t2\n".encode(),
        "named.labels.json": json.dumps(rows).encode(),
        "named.labels.eaf": _elan(),
    }


@functools.cache
def samples():
    """File name -> bytes: at least one of every format and every kind of saved primitives."""
    (t, x), (t2, x2) = _movement(), _movement(1)
    both = {"positions": np.vstack((x, x2)), "times": np.concatenate((t, t2)), "offsets": [0, len(x), len(x) + len(x2)]}
    labels = np.array(["wave", "nod"])
    long_columns = {"id": ["a"] * 12 + ["b"] * 13, "label": ["wave"] * 12 + ["nod"] * 13, "t": both["times"]}
    axes = {"x": both["positions"][:, 0], "y": both["positions"][:, 1]}
    return {
        "wide.csv": _wide(","),
        "decimal.csv": _wide(";", comma=True),
        "wide.tsv": _wide("\t"),
        "bare.txt": _wide(" ", head=False),
        "long.csv": _long(),
        "dates.csv": _dates(),
        "utf16.csv": _wide(",").decode().encode("utf-16"),
        "one.npz": _npz(times=t, positions=x),
        "small.npz": _npz(np.savez_compressed, times=t, positions=x),
        "joined.npz": _npz(**both, labels=labels),
        "block.npz": _npz(positions=np.stack((x, x)), times=t, labels=[1, 2]),
        "numbered.npz": _npz(positions_0=x, positions_1=x2, times_0=t, times_1=t2),
        "joined.json": _json(**both, labels=labels),
        "numbered.json": _json(x_0=x, x_1=x2),
        "keyed.npz": _npz(wave=x, nod=x2),
        "timed.npz": _npz(t=t, q=x, gripper=t),
        "amass.npz": _npz(poses=np.tile(x, (1, 78)), trans=np.tile(t[:, None], 3), betas=t[:5], mocap_framerate=120.0),
        "robot.npz": _npz(qpos=np.tile(x, (1, 4)), qvel=x, joint_names=["a", "b"], fps=np.array([50])),
        "series.ts": b"@timeStamps false\n@classLabel true a b\n@data\n1,2,3,4:4,?,2,1:a\n2,2,3,5,6:1,2,1,2,1:b\n",
        "one.npy": _npy(np.stack((x, x))),
        "samples.json": json.dumps([{"t": a, "x": b} for a, b in zip(t.tolist(), t.tolist(), strict=True)]).encode(),
        "keyed.json": _json(wave=x, nod=x),
        "samples.jsonl": "\n".join(json.dumps({"t": a, "q": [a, 1]}) for a in t.tolist()).encode(),
        "walk.bvh": _bvh(),
        "vicon.csv": _vicon(),
        "motive.csv": _motive(),
        "qualisys.tsv": _qualisys(),
        "markers.trc": _trc(),
        "imu.sto": _storage(),
        "walk.mot": _motion(),
        "suit.mvnx": _mvnx(),
        "units.csv": b"time,x\nms,mm\n" + b"".join(b"%d,%d\n" % (10 * k, k * k) for k in range(N_SAMPLES)),
        **_optional(("robomimic.hdf5", _hdf5), ("points.c3d", _c3d)),
        **_optional(
            ("robot.demos.hdf5", lambda: _robot(write_robomimic, "a.hdf5")),
            ("aloha.demos.hdf5", lambda: _robot(write_aloha, "sets")),
            ("umi.demos.zip", lambda: _robot(functools.partial(write_umi, tall=4), "a.zarr.zip")),
        ),
        "vectors.parquet": _vectors(),
        "cells.mat": _mat(False, trials=_cells(), fs=100.0),
        "wide.parquet": _parquet(time=t, x=x[:, 0], y=x[:, 1]),
        "long.parquet": _parquet(**long_columns, **axes),
        "demos.mat": _mat(False, demos=_demos(), name="wave"),
        "demos_compressed.mat": _mat(True, demos=_demos(), name="wave"),
        "struct.mat": _mat(False, demos={"pos": x.T, "t": t}),
        "others.mat": _mat(
            False, demos=_demos(), cells=[[1, "a"], [np.eye(2) * 1j, {"b": [True]}]], dt=np.int8([1, 2])
        ),
        "others_compressed.mat": _mat(True, demos=_demos(), s={"a": {"b": {"c": "deep"}}}, text=["ab", "cd"]),
        "run.bag": _bag("ros1"),
        "compressed.bag": _bag("ros1", compress=True),
        "run.db3": _bag("sqlite3"),
        "run.mcap": _bag("mcap"),
        "compressed.mcap": _bag("mcap", compress=True),
        "messages.mcap": _messages(),
        "v2.lerobot": _lerobot(write_v2),
        "v3.lerobot": _lerobot(write_v3),
        **_label_tables(),
        **{name: _saved(cls) for name, cls in _SAVED.items()},
    }


def mutant(rng, data, name):
    """The bytes with one to four kinds of damage; inside what is compressed too."""
    if name.endswith(".lerobot"):
        return _zip_mutant(rng, data)
    if name.endswith((".npz", ".kineme", ".zip")) and rng.random() < 0.6:
        data = _zip_mutant(rng, data)
        return data if rng.random() < 0.8 else _damaged(rng, data)
    if "compressed.mat" in name and rng.random() < 0.7:
        return _mat_mutant(rng, data)
    for _ in range(int(rng.integers(1, 5))):
        data = _damaged(rng, data, is_text=name.endswith(_TEXTS))
    return data


def _damaged(rng, data, is_text=False):
    ways = (_flip, _cut, _insert, _remove, _repeat, _overwrite, _number)
    way = _word if is_text and rng.random() < 0.6 else ways[int(rng.integers(len(ways)))]
    return way(rng, data, int(rng.integers(len(data)))) if data else data


def _flip(rng, data, at):
    return data[:at] + bytes((data[at] ^ (1 << int(rng.integers(8))),)) + data[at + 1 :]


def _cut(rng, data, at):
    return data[:at]


def _insert(rng, data, at):
    return data[:at] + rng.bytes(int(rng.integers(1, 17))) + data[at:]


def _remove(rng, data, at):
    return data[:at] + data[at + int(rng.integers(1, 65)) :]


def _repeat(rng, data, at):
    return data[:at] + data[at : at + int(rng.integers(1, 257))] * int(rng.integers(2, 5)) + data[at:]


def _overwrite(rng, data, at):
    return data[:at] + rng.bytes(n := int(rng.integers(1, 9))) + data[at + n :]


def _number(rng, data, at):
    size = int(rng.choice([1, 2, 4, 8]))
    if rng.random() < 0.7:
        at -= at % size
    number = NUMBERS[int(rng.integers(len(NUMBERS)))] % 256**size
    return data[:at] + number.to_bytes(size, "little") + data[at + size :]


def _word(rng, data, at):
    return data[:at] + WORDS[int(rng.integers(len(WORDS)))].encode() + data[at + int(rng.integers(4)) :]


def _zip_mutant(rng, data):
    """One member damaged under a right checksum, or renamed, doubled, dropped."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(member.filename, archive.read(member)) for member in archive.infolist()]
    k = int(rng.integers(len(members)))
    name, content = members[k]
    what = rng.random()
    if what < 0.7:
        members[k] = (
            name,
            _damaged(rng, content[:128], rng.random() < 0.3) + content[128:] if what < 0.4 else _damaged(rng, content),
        )
    elif what < 0.8:
        members.append((name, content))
    elif what < 0.9:
        members[k] = f"{WORDS[int(rng.integers(len(WORDS)))][:50]}{name}".replace("\0", "?"), content
    else:
        del members[k]
    buffer = io.BytesIO()
    packing = zipfile.ZIP_DEFLATED if rng.random() < 0.3 else zipfile.ZIP_STORED
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", packing) as archive:
        warnings.simplefilter("ignore")  # of doubled names
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content)
    return buffer.getvalue()


def _mat_mutant(rng, data):
    """One variable of a compressed MATLAB file damaged before it is compressed."""
    parts, at = [], 128
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        parts.append(zlib.decompress(data[at + 8 : at + 8 + size]))
        at += 8 + size
    k = int(rng.integers(len(parts)))
    for _ in range(int(rng.integers(1, 4))):
        parts[k] = _damaged(rng, parts[k])
    packed = [zlib.compress(part) for part in parts]
    return data[:128] + b"".join(b"\x0f\0\0\0" + len(element).to_bytes(4, "little") + element for element in packed)


def read_mutant(name, data):
    """Read a file of that name through the public door, and check what comes; called in a child process."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = Path(folder) / name
        if name.endswith(".lerobot"):
            return _read_lerobot(path, data)
        path.write_bytes(data)
        if ".labels." in name:
            return _read_labels(path)
        if name in _SAVED:
            _check_saved(_SAVED[name].load(path))
            return 0
        if ".demos." in name:
            with contextlib.suppress(kineme.errors.KinemeError):
                for episode in read_episodes(path):
                    _check_episode(episode)
        return check_recordings(kineme.read_recordings(path))


def _check_episode(episode):
    assert all(values.shape[0] == len(episode) for values in episode.signals.values())
    assert all(values.shape[1] == len(episode.names[name]) for name, values in episode.signals.items())
    assert all(isinstance(problem, str) for problem in episode.problems)
    assert episode.problems or len(episode)
    assert np.isfinite(episode.times).all()


def _read_lerobot(folder, data):
    """Read the data set and its episodes, and copy it with the name of a motion."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for member in archive.infolist():
            path = folder / member.filename
            with contextlib.suppress(OSError):  # of names that are no paths
                if folder.resolve() in path.resolve().parents:
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(archive.read(member))
    with contextlib.suppress(kineme.errors.KinemeError):
        for episode in read_episodes(folder):
            assert {len(values) for values in episode.signals.values()} == {len(episode)}
            assert {name: len(entries) for name, entries in episode.names.items()} == {
                name: values.shape[1] for name, values in episode.signals.items()
            }
    n = check_recordings(kineme.read_recordings(folder))
    target = folder.parent / "copy"
    target.mkdir()
    with contextlib.suppress(kineme.errors.KinemeError):
        copy_with_motions(folder, target, {0: [Motion(0, 0.0, 1.0, "wave")]})
        check_recordings(kineme.read_recordings(target))
    return n


def _read_labels(path):
    """Read the labels, and cut a recording by them."""
    table = read_labels(path)
    assert all(math.isfinite(row.start) and math.isfinite(row.end) for row in table.rows)
    (path.parent / "long.csv").write_bytes(_wide(","))
    return check_recordings(labeled_pieces(kineme.read_recordings(path.parent / "long.csv"), table))


def check_recordings(read):
    """Whatever is read is finite, in order and consistent; how many movements that is."""
    demos = read.demonstrations
    assert len(demos) == len(read.sources) == len(read.labels) == len(demos.names)
    assert demos.offsets[0] == 0
    assert demos.offsets[-1] == len(demos.positions) == len(demos.times)
    assert (demos.lengths >= 4).all()
    assert demos.positions.dtype == demos.times.dtype == np.float64
    assert np.isfinite(demos.positions).all()
    assert np.isfinite(demos.times).all()
    inner = np.delete(np.diff(demos.times), demos.offsets[1:-1] - 1)
    assert (inner > 0).all()
    assert (demos.durations > 0).all()
    assert np.isfinite(demos.durations).all()
    assert all(label is None or (type(label) is str and label) for label in read.labels)
    assert all(isinstance(problem.reason, str) and "\n" not in problem.reason for problem in read.problems)
    assert all(math.isfinite(source.mtime) and len(source.sha256) == 64 for source in read.sources)
    repr(read)
    return len(demos)


def _check_saved(batch):
    n = len(batch)
    if isinstance(batch, PosePrimitives):
        assert np.isfinite(batch.references).all()
        batch = batch.tangent
    for name in batch.ROWS:
        values = getattr(batch, name)
        assert len(values) == n
        assert np.isfinite(values).all()
    assert batch.labels is None or len(batch.labels) == n
    assert batch.names is None or len(batch.names) == n
    repr(batch)
