"""An episode whose stamps are no numbers: the studio shows it by its rate, and its corrections can be read again."""

import numpy as np
import pandas as pd
import pytest

from kineme.io.reading.read_labels import read_labels
from lerobot_sets import write_v3


@pytest.mark.parametrize("stamp", [np.nan, np.inf])
def test_an_episode_without_stamps_is_shown_and_corrected(stamp, folder, open_studio, tmp_path):
    frames = write_v3(tmp_path / "demos") / "data" / "chunk-000" / "file-000.parquet"
    table = pd.read_parquet(frames)
    table.loc[table.index[table["episode_index"] == 1][0], "timestamp"] = stamp
    table.to_parquet(frames)
    client = open_studio(folder, recordings=tmp_path / "demos")
    shown = client.get("/api/episodes/episode-1").json()
    assert shown["episode"]["duration"] == pytest.approx(29 / 50)
    assert client.get("/api/episodes/episode-1/strip").json()["times"][:2] == [0.0, 0.02]
    assert client.post("/api/recordings/episode-1/spotted", json={}).status_code == 400
    spans = {"spans": [{"begin": 0.1, "end": 0.3, "label": "nod"}], "corrected": True}
    assert client.post("/api/episodes/episode-1/spans", json=spans).status_code == 200
    client.post("/api/episodes/corrections", json={})
    (row,) = read_labels(tmp_path / "demos-corrections.csv").rows
    assert (row.start, row.end) == pytest.approx((0.1, 0.3))
