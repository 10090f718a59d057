"""LeRobot itself loads what is written: a training recipe finds the motion of each frame. Skipped without LeRobot."""

import json
from collections import Counter

import pytest

lerobot_dataset = pytest.importorskip("lerobot.datasets.lerobot_dataset")
language_render = pytest.importorskip("lerobot.datasets.language_render")
recipe = pytest.importorskip("lerobot.configs.recipe")

from kineme.io.lerobot.copy import copy_in_lance, copy_with_motions  # noqa: E402 - what is skipped first
from kineme.io.lerobot.motions import Motion  # noqa: E402
from lerobot_sets import CAMERA, write_lance, write_v3  # noqa: E402

MOTIONS = {0: [Motion(0, 0.0, 0.6, "reach"), Motion(0, 1.0, 1.5, "pour")], 2: [Motion(2, 0.3, 2.4, None)]}
EXPECTED = {(0, "reach"): 7, (0, "rest"): 7, (0, "pour"): 6, (1, None): 30, (2, "rest"): 3, (2, "unknown"): 22}
RECIPE = {
    "bindings": {"now": "active_at(t, style=motion)", "begins": "emitted_at(t, style=motion)"},
    "messages": [
        {"role": "user", "content": "${task}", "stream": "high_level"},
        {"role": "assistant", "content": "${now}", "stream": "low_level", "target": True, "if_present": "now"},
    ],
}


def without_videos(folder):
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    del info["features"][CAMERA]
    path.write_text(json.dumps(info))
    return folder


@pytest.mark.parametrize("storage", ["parquet", "lance"])
def test_a_recipe_finds_the_motion_of_each_frame(tmp_path, storage):
    if storage == "lance":
        pytest.importorskip("lance")
        load = pytest.importorskip("lerobot_lancedb").LanceDBDataset
        write, copy = write_lance, copy_in_lance
    else:
        load, write, copy = lerobot_dataset.LeRobotDataset, write_v3, copy_with_motions
    target = tmp_path / "named"
    target.mkdir()
    copy(without_videos(write(tmp_path / "set", fps=10)), target, MOTIONS)
    said = Counter()
    frames = load("kineme/named", root=target)
    for k in range(len(frames)):
        frame = frames[k]
        rendered = language_render.render_sample(
            recipe=recipe.TrainingRecipe.from_dict(RECIPE), persistent=frame["language_persistent"], events=[],
            t=float(frame["timestamp"]), sample_idx=k, task=frame["task"],
        )  # fmt: skip
        said[int(frame["episode_index"]), rendered and rendered["messages"][-1]["content"]] += 1
    assert said == EXPECTED
