"""``kineme audit`` on data sets of LeRobot."""

import csv
import json
import re
import subprocess
import sys

import numpy as np
import pytest
from commands import run

from lerobot_sets import write_v3

N = 30


@pytest.fixture
def data_set(tmp_path):
    """Thirty episodes, of which one has a spike and one stamps of half the rate."""
    import pyarrow as pa
    from pyarrow import parquet

    folder = tmp_path / "set"
    write_v3(folder, (120,) * N, per_shard=10)
    for number, change in ((4, spike), (23, slow)):
        (path,) = folder.glob(f"data/*/file-{number // 10:03d}.parquet")
        table = parquet.read_table(path)
        rows = np.flatnonzero(table["episode_index"].to_numpy() == number)
        parquet.write_table(change(pa, table, rows), path)
    return folder


def spike(pa, table, rows):
    state = np.array(table["observation.state"].to_pylist(), np.float32)
    state[rows[60], 1] += 4
    column = pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), state.shape[1])
    return table.set_column(table.schema.get_field_index("observation.state"), "observation.state", column)


def slow(pa, table, rows):
    stamps = table["timestamp"].to_numpy().copy()
    stamps[rows] *= 2
    return table.set_column(table.schema.get_field_index("timestamp"), "timestamp", pa.array(stamps))


def test_bad_episodes_are_listed_with_reasons(data_set):
    done = run("audit", data_set)
    words = " ".join(done.stdout.split())
    assert done.returncode == 0
    assert f"{N} episodes of 2 tasks" in words
    assert "rate: frames come at 25 per second, the data set declares 50" in words
    assert re.search(r"elbow_flex.pos jumps within one frame, \d+ times its noise", words)


def test_json_is_all_of_it(data_set, tmp_path):
    done = run("audit", data_set, "--json", "--train-mask", tmp_path / "keep.json", "-o", tmp_path / "audit.html")
    data = json.loads(done.stdout)
    assert data["episodes"] == N
    assert [finding["episode"] for finding in data["findings"][:2]] == [23, 4]
    assert data["written"] == [str(tmp_path / "keep.json"), str(tmp_path / "audit.html")]
    kept = json.loads((tmp_path / "keep.json").read_text())
    assert not {4, 23} & set(kept)
    assert f"episodes={json.dumps(kept, separators=(',', ':'))}" in data["lerobot"][1]


def test_the_page_and_the_mask_are_written(data_set, tmp_path):
    done = run("audit", data_set, "-o", tmp_path / "audit.html", "--train-mask", tmp_path / "keep.csv")
    page = (tmp_path / "audit.html").read_text(encoding="utf-8")
    assert 'id="episode-23"' in page
    assert page.count("<svg") == 1 + page.count('id="episode-')
    with (tmp_path / "keep.csv").open(newline="") as file:
        kept = [int(row["episode_index"]) for row in csv.DictReader(file) if row["keep"] == "1"]
    assert f'--dataset.episodes "{json.dumps(kept, separators=(",", ":"))}"' in done.stdout


@pytest.mark.parametrize(
    ("option", "name", "endings"), [("-o", "audit.pdf", ".html, .htm"), ("--train-mask", "keep.txt", ".csv, .json")]
)
def test_a_file_of_another_kind_is_not_written(tmp_path, option, name, endings):
    refused = run("audit", tmp_path, option, tmp_path / name)
    assert refused.returncode == 2
    assert f"expected {endings}, got" in " ".join(refused.stderr.split())
    assert not (tmp_path / name).exists()


def test_nothing_is_written_over_unasked(data_set, tmp_path):
    target = tmp_path / "audit.html"
    target.write_text("mine")
    done = run("audit", data_set, "-o", target)
    assert (done.returncode, target.read_text()) == (2, "mine")
    assert "--force" in done.stderr
    assert run("audit", data_set, "-o", target, "--force").returncode == 0
    info = data_set / "meta" / "info.json"
    before = info.read_bytes()
    assert run("audit", data_set, "--train-mask", info, "--force").returncode == 2
    assert info.read_bytes() == before
    done = run("audit", data_set, "-o", tmp_path / "no" / "audit.html")
    assert done.returncode == 2
    assert "expected a folder to write" in done.stderr


def test_the_data_set_stays_as_it_is(data_set, tmp_path):
    before = {path: path.read_bytes() for path in sorted(data_set.rglob("*")) if path.is_file()}
    done = run("audit", data_set, "-o", tmp_path / "audit.html", "--train-mask", tmp_path / "keep.csv")
    assert (done.returncode, (tmp_path / "keep.csv").is_file()) == (0, True)
    assert {path: path.read_bytes() for path in sorted(data_set.rglob("*")) if path.is_file()} == before


def test_what_is_no_data_set_is_refused(tmp_path):
    done = run("audit", tmp_path)
    assert done.returncode == 1
    assert "expected a data set of episodes" in done.stderr
    assert run("audit", tmp_path, "--error-rate", "0").returncode == 2


def test_a_viewer_of_rerun_is_given_the_flagged_episodes(data_set, tmp_path):
    chunks = pytest.importorskip("rerun.chunk")
    run("audit", data_set, "--rerun", tmp_path / "audit.rrd")
    entities = {chunk.entity_path for chunk in chunks.RrdReader(str(tmp_path / "audit.rrd")).stream()}
    assert {"/episode\\ 23/symbols/rate", "/episode\\ 4/symbols/spikes"} <= entities
    assert "/episode\\ 4/signals/observation.state" in entities
    assert "--force" in run("audit", data_set, "--rerun", tmp_path / "audit.rrd").stderr


def test_a_set_without_stamps_is_audited_too(tmp_path):
    """Of ALOHA: a file for each episode; its rate is the custom until --rate says it."""
    h5py = pytest.importorskip("h5py")
    rng = np.random.default_rng(0)
    (tmp_path / "aloha").mkdir()
    for k in range(24):
        reach = np.linspace(0, 1, 200)[:, None] ** 2 * rng.normal(1, 0.1, 14)
        joints = reach + rng.normal(scale=1e-3, size=reach.shape)
        if k == 6:
            joints[100, 3] += 0.5
        with h5py.File(tmp_path / "aloha" / f"episode_{k}.hdf5", "w") as file:
            file["observations/qpos"], file["action"] = joints, reach
    data = json.loads(run("audit", tmp_path / "aloha", "--json").stdout)
    assert data["findings"][0]["episode"] == 6
    assert any("50 Hz assumed" in note for note in data["of_the_set"])
    slower = json.loads(run("audit", tmp_path / "aloha", "--json", "--rate", "25").stdout)
    assert slower["seconds"] == pytest.approx(2 * data["seconds"])


@pytest.mark.soak
def test_the_command_runs_as_a_program(data_set):
    command = [sys.executable, "-m", "kineme", "audit", data_set]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "flagged" in done.stdout
