"""Data sets of LeRobot whose episodes are drawings with rests between them, also with videos."""

from __future__ import annotations

import json

import numpy as np
from studio_samples import drawing

FPS = 40
CAMERA = "observation.images.top"


def drawn(*kinds, rest=0.6, seed=50):
    """Positions (T, 2) of some drawings one after the other, and when each begins and ends [s]."""
    rows, spans, at = [], [], np.zeros(2)
    for k in kinds:
        _, x = drawing(k, seed=seed + k)
        still = np.repeat(at[None], round(rest * FPS), axis=0)
        begin = (sum(map(len, rows)) + len(still)) / FPS
        rows += [still, at + x - x[0]]
        spans.append((begin, begin + (len(x) - 1) / FPS))
        at = rows[-1][-1]
    return np.concatenate([*rows, np.repeat(at[None], round(rest * FPS), axis=0)]), spans


def write_drawings(folder, *episodes, **options):
    """Write a data set with an episode for each sequence of kinds."""
    return write_episodes(folder, [drawn(*kinds)[0] for kinds in episodes], **options)


def write_episodes(folder, episodes, tasks=("Draw", "Wave"), video=None, codec="vp9"):
    """Write a data set of version 2.1 with these positions (T, 2); `video` are the bytes of each video."""
    import pyarrow as pa
    from pyarrow import parquet

    (folder / "meta").mkdir(parents=True)
    vector = {"dtype": "float32", "shape": [2], "names": ["x", "y"]}
    counter = {"dtype": "int64", "shape": [1], "names": None}
    features = {
        **{
            "observation.state": vector,
            "action": vector,
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        },
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), counter),
    }
    video_path = None
    if video is not None:
        about = {"video.codec": codec, "video.height": 48, "video.width": 64}
        features[CAMERA] = {
            "dtype": "video",
            "shape": [48, 64, 3],
            "names": ["height", "width", "channels"],
            "info": about,
        }
        video_path = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
    lengths, first = [], 0
    for number, x in enumerate(episodes):
        n = len(x)
        table = {
            "observation.state": list(x.astype(np.float32)),
            "action": list((x + 0.1).astype(np.float32)),
            "timestamp": (np.arange(n) / FPS).astype(np.float32),
            "frame_index": np.arange(n),
            "episode_index": np.full(n, number),
            "index": first + np.arange(n),
            "task_index": np.full(n, number % len(tasks)),
        }
        target = folder / f"data/chunk-000/episode_{number:06d}.parquet"
        target.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(pa.table(table), target)
        if video is not None:
            file = folder / f"videos/chunk-000/{CAMERA}/episode_{number:06d}.mp4"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(video)
        lengths.append(n)
        first += n
    info = {
        "codebase_version": "v2.1", "robot_type": "so100", "total_episodes": len(lengths), "total_frames": first,
        "total_tasks": len(tasks), "chunks_size": 1000, "fps": FPS, "splits": {"train": f"0:{len(lengths)}"},
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet", "video_path": video_path,
        "features": features,
    }  # fmt: skip
    rows = [{"episode_index": k, "tasks": [tasks[k % len(tasks)]], "length": n} for k, n in enumerate(lengths)]
    texts = {
        "info.json": json.dumps(info),
        "episodes.jsonl": "\n".join(map(json.dumps, rows)),
        "tasks.jsonl": "\n".join(json.dumps({"task_index": k, "task": task}) for k, task in enumerate(tasks)),
    }
    for name, text in texts.items():
        (folder / "meta" / name).write_text(text)
    return folder
