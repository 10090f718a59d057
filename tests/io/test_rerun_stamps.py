"""Scenes for Rerun whose stamps the viewer cannot count: missing ones, and ones centuries later."""

import numpy as np
import pytest

from kineme.io.writing.rerun import Scene, Stretch, write_rerun

rerun = pytest.importorskip("rerun", reason="Rerun writes")


@pytest.mark.parametrize("stamps", [[np.nan, 0.1, 0.2], [0.0, 1e12, 2e12], [np.nan] * 3, [1e12, 1e12 + 1, 1e12 + 2]])
def test_stamps_that_are_none_cost_their_samples_alone(stamps, tmp_path):
    lanes = {"rest": [Stretch(np.nan, np.nan, "idle"), Stretch(0.0, 1e12, "gap"), Stretch(0.0, 0.1, "idle")]}
    scene = Scene("episode 0", np.array(stamps), {"state": np.zeros((3, 2))}, {"state": ("a", "b")}, lanes=lanes)
    assert write_rerun(tmp_path / "a.rrd", [scene]).stat().st_size > 0
