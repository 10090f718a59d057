"""Data sets of LeRobot as its source describes versions 2.1 and 3.0, written by pandas, pyarrow and Lance."""

from __future__ import annotations

import json
import shutil

import numpy as np

NAMES = ["shoulder_pan.pos", "elbow_flex.pos", "gripper.pos"]
TASKS = ["Pick up the cube", "Wave"]
CAMERA = "observation.images.top"
FILM = b"film"  # in place of a video


def episode_rows(k, length, start=0, fps=50):
    """The frames of an episode as pandas takes them."""
    t = np.arange(length) / fps
    state = np.column_stack((np.sin(t + k), t**2, np.cos(3 * t))).astype(np.float32)
    return {
        "observation.state": list(state),
        "action": list(state + 1),
        "next.done": np.arange(length) == length - 1,
        "timestamp": t.astype(np.float32),
        "frame_index": np.arange(length),
        "episode_index": np.full(length, k),
        "index": start + np.arange(length),
        "task_index": np.full(length, k % 2),
    }


def features(names=NAMES):
    vector = {"dtype": "float32", "shape": [len(NAMES)], "names": names}
    counter = {"dtype": "int64", "shape": [1], "names": None}
    return {
        "observation.state": vector,
        "action": vector,
        CAMERA: {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channels"]},
        "next.done": {"dtype": "bool", "shape": [1], "names": None},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), counter),
    }


def write_info(folder, version, lengths, path, fps=50, names=NAMES):
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    info = {
        "codebase_version": version, "robot_type": "so100", "total_episodes": len(lengths),
        "total_frames": int(sum(lengths)), "total_tasks": len(TASKS), "chunks_size": 1000, "fps": fps,
        "splits": {"train": f"0:{len(lengths)}"}, "data_path": path, "video_path": None, "features": features(names),
    }  # fmt: skip
    (folder / "meta" / "info.json").write_text(json.dumps(info))


def write_v3(folder, lengths=(20, 30, 25), per_shard=2, fixed=True, fps=50):
    """Version 3.0: many episodes in a shard; what is known of them in Parquet too."""
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    path = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    write_info(folder, "v3.0", lengths, path, fps, {"motors": NAMES})
    vector = pa.list_(pa.float32(), len(NAMES)) if fixed else pa.list_(pa.float32())
    ends = np.cumsum(lengths)
    for first in range(0, len(lengths), per_shard):
        chosen = range(first, min(first + per_shard, len(lengths)))
        frames = pd.concat([pd.DataFrame(episode_rows(k, lengths[k], ends[k] - lengths[k], fps)) for k in chosen])
        table = pa.Table.from_pandas(frames, preserve_index=False)
        for name in ("observation.state", "action"):
            at = table.schema.get_field_index(name)
            table = table.set_column(at, name, table.column(name).cast(vector))
        target = folder / path.format(chunk_index=0, file_index=first // per_shard)
        target.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table, target)
    episodes = pd.DataFrame(
        {
            "episode_index": range(len(lengths)),
            "tasks": [[TASKS[k % 2]] for k in range(len(lengths))],
            "length": lengths,
            "data/chunk_index": 0,
            "data/file_index": [k // per_shard for k in range(len(lengths))],
            "dataset_from_index": ends - lengths,
            "dataset_to_index": ends,
        }
    )
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    episodes.to_parquet(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    tasks = pd.DataFrame({"task_index": range(len(TASKS))}, index=pd.Index(TASKS, name="task"))
    tasks.to_parquet(folder / "meta" / "tasks.parquet")
    return folder


def shard_of(folder, k=0):
    """The path of a shard in Parquet."""
    return sorted(folder.glob("data/*/*.parquet"))[k]


def change(folder, frames, k=0):
    """Write what a function makes of the frames of a shard."""
    import pandas as pd

    path = shard_of(folder, k)
    frames(pd.read_parquet(path)).to_parquet(path)


def add_videos(folder, path):
    """Declare the videos of a camera in meta/info.json, and write a file for each."""
    place = folder / "meta" / "info.json"
    place.write_text(json.dumps(json.loads(place.read_text()) | {"video_path": path}))
    numbers = {"chunk_index": 0, "file_index": 0, "episode_chunk": 0, "video_key": CAMERA}
    if "episode_index" in path:
        files = [path.format(**numbers, episode_index=k) for k in range(3)]
    else:
        files = [path.format(**numbers)]
        episodes = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
        import pandas as pd

        table = pd.read_parquet(episodes)
        table[f"videos/{CAMERA}/chunk_index"] = table[f"videos/{CAMERA}/file_index"] = 0
        table[f"videos/{CAMERA}/from_timestamp"] = table["dataset_from_index"] / 50
        table.to_parquet(episodes)
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(FILM)
    return folder


def write_lance(folder, lengths=(20, 30, 25), per_fragment=40, fps=50):
    """Version 3.0 in Lance: all frames in one table, dots of names as underscores, and the meta folder as a table."""
    import lance
    import pyarrow as pa
    from pyarrow import parquet

    write_v3(folder, lengths, fps=fps)
    frames = pa.concat_tables([parquet.read_table(path) for path in sorted((folder / "data").glob("*/*.parquet"))])
    frames = frames.rename_columns([name.replace(".", "_") for name in frames.column_names])
    lance.write_dataset(
        frames.replace_schema_metadata(None), str(folder / "frames.lance"), max_rows_per_file=per_fragment
    )
    shutil.rmtree(folder / "data")
    path = folder / "meta" / "info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"storage_format": "lance"}, indent=4))
    files = sorted(path for path in (folder / "meta").rglob("*") if path.is_file())
    schema = pa.schema([("path", pa.string()), ("data", pa.large_binary())])
    rows = [{"path": path.relative_to(folder / "meta").as_posix(), "data": path.read_bytes()} for path in files]
    lance.write_dataset(pa.Table.from_pylist(rows, schema=schema), str(folder / "meta.lance"))
    return folder


def write_v2(folder, lengths=(20, 30, 25), fps=50):
    """Version 2.1: a shard for each episode; what is known of them in JSON lines."""
    import pandas as pd

    path = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    write_info(folder, "v2.1", lengths, path, fps)
    start = 0
    for k, length in enumerate(lengths):
        target = folder / path.format(episode_chunk=0, episode_index=k)
        target.parent.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(episode_rows(k, length, start, fps)).to_parquet(target)
        start += length
    rows = [{"episode_index": k, "tasks": [TASKS[k % 2]], "length": n} for k, n in enumerate(lengths)]
    (folder / "meta" / "episodes.jsonl").write_text("\n".join(map(json.dumps, rows)))
    rows = [{"task_index": k, "task": task} for k, task in enumerate(TASKS)]
    (folder / "meta" / "tasks.jsonl").write_text("\n".join(map(json.dumps, rows)))
    return folder


SO101 = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


def write_so101(folder, states, task, fps=30):
    """Episodes of an SO-101 (T, 6) in the unit of its driver, which no file says."""
    import pandas as pd

    names = [f"{joint}.pos" for joint in SO101]
    lengths = [len(one) for one in states]
    write_info(folder, "v3.0", lengths, "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", fps)
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    for name in ("observation.state", "action"):
        info["features"][name] = {"dtype": "float32", "shape": [6], "names": names}
    path.write_text(json.dumps(info | {"robot_type": "so101_follower"}))
    rows = []
    for k, state in enumerate(states):
        rows.append(pd.DataFrame(episode_rows(k, len(state), sum(lengths[:k]), fps) | {"task_index": 0}))
        for name in ("observation.state", "action"):
            rows[-1][name] = list(state.astype(np.float32))
    for part in ("data", "meta/episodes"):
        (folder / part / "chunk-000").mkdir(parents=True)
    pd.concat(rows).to_parquet(folder / "data/chunk-000/file-000.parquet")
    episodes = {"episode_index": range(len(states)), "length": lengths, "data/chunk_index": 0, "data/file_index": 0}
    pd.DataFrame(episodes).to_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    tasks = pd.DataFrame({"task_index": [0]}, index=pd.Index([task], name="task"))
    tasks.to_parquet(folder / "meta" / "tasks.parquet")
    return folder
