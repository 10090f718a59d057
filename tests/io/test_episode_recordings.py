"""An episode of robot data as a recording, and where it begins in its videos."""

from __future__ import annotations

import json

import numpy as np
import pytest

from kineme import read_recordings
from kineme.errors import DataError
from kineme.io.lerobot.videos import video_codec, video_starts
from kineme.io.reading.episode_recordings import episode_recordings, heads_of
from kineme.io.reading.episodes import read_episodes
from kineme.movements.episodes import Episode
from lerobot_sets import NAMES, TASKS, write_v2, write_v3

CAMERA = "observation.images.top"


@pytest.mark.parametrize("write", [write_v2, write_v3])
def test_an_episode_is_the_movement_that_all_of_the_set_holds(tmp_path, write):
    folder = write(tmp_path / "demos")
    together = read_recordings(folder)
    for k, episode in enumerate(read_episodes(folder)):
        (movement,) = (recording := episode_recordings(episode, "demos", NAMES)).demonstrations
        assert np.array_equal(movement.times, together.demonstrations[k].times)
        assert np.array_equal(movement.recorded, together.demonstrations[k].recorded)
        assert movement.channels == together.demonstrations[k].channels
        (source,) = recording.sources
        assert (source.path, source.place, source.label) == ("demos", f"episode {k}", TASKS[k % 2])


def test_columns_of_other_features_are_called_by_feature_and_entry(tmp_path):
    folder = write_v3(tmp_path / "demos")
    episode = next(read_episodes(folder))
    assert list(heads_of(episode).items())[:2] == [
        ("observation.state", tuple(NAMES)),
        ("action", tuple(f"action.{name}" for name in NAMES)),
    ]
    chosen = ("action.gripper.pos", "shoulder_pan.pos")
    (movement,) = episode_recordings(episode, "demos", chosen).demonstrations
    assert [channel.name for channel in movement.channels] == list(chosen)
    np.testing.assert_array_equal(movement.recorded[:, 0], episode.signals["action"][:, 2])
    with pytest.raises(DataError, match="none"):
        episode_recordings(episode, "demos", ["none"])


def test_without_a_state_the_first_feature_of_several_numbers_is_read_by_default():
    signals = {"force": np.zeros((9, 1)), "pose": np.zeros((9, 2))}
    episode = Episode(0, np.arange(9.0), signals, {"force": ("",), "pose": ("x", "y")})
    assert list(heads_of(episode).items()) == [("pose", ("x", "y")), ("force", ("force",))]
    assert heads_of(Episode(0, np.zeros(0), {}, {})) == {}


def test_stamps_that_go_back_are_refused(tmp_path):
    episode = next(read_episodes(write_v3(tmp_path / "demos")))
    odd = Episode(7, episode.times[::-1].copy(), episode.signals, episode.names)
    with pytest.raises(DataError, match="episode 7"):
        episode_recordings(odd, "demos")


def _with_videos(folder, starts):
    """Say in meta/episodes where each episode begins in the video of the camera."""
    import pyarrow as pa
    from pyarrow import parquet

    (path,) = (folder / "meta" / "episodes").glob("*/*.parquet")
    table = parquet.read_table(path, partitioning=None)
    parquet.write_table(table.append_column(f"videos/{CAMERA}/from_timestamp", pa.array(starts, pa.float64())), path)


def test_an_episode_begins_in_its_video_where_the_data_set_says_so(tmp_path):
    folder = write_v3(tmp_path / "demos")
    assert video_starts(folder, CAMERA) == {}
    _with_videos(folder, [0.0, 0.4, None])
    assert video_starts(folder, CAMERA) == {0: 0.0, 1: 0.4}
    assert video_starts(folder, "another") == {}
    (path,) = (folder / "meta" / "episodes").glob("*/*.parquet")
    path.write_bytes(b"PAR1")
    assert video_starts(folder, CAMERA) == {}
    assert video_starts(write_v2(tmp_path / "two"), CAMERA) == {}


@pytest.mark.parametrize("key", ["info", "video_info"])
def test_the_codec_is_what_the_data_set_says(tmp_path, key):
    folder = write_v3(tmp_path / "demos")
    assert video_codec(folder, CAMERA) is None
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    info["features"][CAMERA][key] = {"video.codec": "av1"}
    path.write_text(json.dumps(info))
    assert (video_codec(folder, CAMERA), video_codec(folder, "another")) == ("av1", None)
    path.write_text("{")
    assert video_codec(folder, CAMERA) is None
