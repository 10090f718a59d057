"""An episode of robot data as a recording, in the columns of its features."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import read_recordings
from kineme.errors import DataError
from kineme.io.reading.episode_recordings import episode_recordings, heads_of
from kineme.io.reading.episodes import read_episodes
from kineme.movements.episodes import Episode, default_features
from lerobot_sets import NAMES, TASKS, write_v2, write_v3


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


def test_features_that_are_read_by_default():
    positions = {"observation.robot0_eef_pos": 3, "observation.robot0_gripper_width": 1}
    assert default_features({"action": 7, "observation.state": 7}) == ("observation.state",)
    assert default_features({"action": 7, "observation.robot0_joint_vel": 7} | positions) == tuple(positions)
    assert default_features({"action": 7, "reward": 1}) == ("action",)
    assert default_features({"x": 1}) == ("x",)
    assert default_features({"x": 1, "y": 1}) == default_features({"action": 7, "velocity": 7}) == ()
