"""``kineme move --lerobot``: episodes named by the symbol, one behind the other."""

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from kineme.cli import main

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


def test_episodes_are_appended_and_named(tmp_path):
    u = np.linspace(0, 1, 100)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = kineme.write_movement(
        tmp_path / "reach.csv", {"times": 3 * u, "positions": np.column_stack((0.2 * s, 0.1 * s, 0 * s))}
    )
    words = ["move", path, "--robot", "panda", "--at", "0.45,0,0.3", "--lerobot", tmp_path / "set", "--fps", 20]
    for _ in range(2):
        done = CliRunner().invoke(main, [*map(str, words)])
        assert done.exit_code == 0, done.output
    found = kineme.read_recordings(tmp_path / "set")
    assert (found.labels.tolist(), found.problems) == (["reach", "reach"], ())
    assert found.demonstrations.dimensions[0] == "panda_joint1"
    refused = CliRunner().invoke(main, [*map(str, words[:-1]), "25"])
    assert refused.exit_code
    assert len(kineme.read_recordings(tmp_path / "set").demonstrations) == 2


def test_the_task_is_the_name_of_the_symbol(tmp_path):
    u = np.linspace(0, 1, 100)
    for k in range(3):
        columns = {"times": 3 * u, "positions": np.column_stack((0.2 * u, (0.1 + k / 90) * u**2, 0 * u))}
        kineme.write_movement(tmp_path / f"{k}.csv", columns)
    with kineme.ActionLibrary(tmp_path / "library", create=True) as library:
        library.learn([kineme.read_recording(tmp_path / f"{k}.csv") for k in range(3)], labels=["pour it"] * 3)
        (symbol,) = library.symbols()
    words = ["--library", tmp_path / "library", "--robot", "panda", "--slow-down", "--lerobot", tmp_path / "set"]
    for source in ("pour it", symbol.id):
        done = CliRunner().invoke(main, ["move", *map(str, (source, *words))])
        assert done.exit_code == 0, done.output
    assert kineme.read_recordings(tmp_path / "set").labels.tolist() == ["pour it", "pour it"]
