"""``kineme annotate`` on a long recording of real handwriting, with rests and unknown motion between the letters."""

from __future__ import annotations

import json
import os
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pandas
import pytest
from commands import answer, run, start

import kineme
from kineme.cli import output
from kineme.io.lerobot.motions import read_motions
from kineme.io.writing.write_movement import write_movement
from kineme.library import annotate

RATE = 100.0
LETTERS = ["CShape", "GShape", "Sshape"]
ORDER = ["GShape", "NShape", "CShape", "Sshape", "GShape", "CShape"]  # NShape is of no symbol


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa([*LETTERS, "NShape"])


@pytest.fixture(scope="module")
def library(demos, tmp_path_factory):
    folder = tmp_path_factory.mktemp("annotate") / "actions"
    with kineme.ActionLibrary(folder, create=True) as actions:
        actions.learn(demos[np.isin(demos.labels, LETTERS)])
    return folder


def _long(demos, start_time=0.0):
    """Stamps, positions, and what is shown from when to when."""
    at, parts, truth, n = np.zeros(2), [], [], 0
    for k, letter in enumerate(ORDER):
        one = demos[demos.labels == letter][k % 7]
        times = np.arange(one.times[0], one.times[-1], 1.0 / RATE)
        path = np.column_stack([np.interp(times, one.times, x) for x in one.positions.T])
        path = at + path - path[0]
        rest = np.repeat(path[-1:], 60, axis=0)
        truth.append((start_time + n / RATE, start_time + (n + len(path)) / RATE, letter))
        parts += [path, rest]
        n += len(path) + len(rest)
        at = path[-1]
    positions = np.concatenate(parts)
    return start_time + np.arange(len(positions)) / RATE, positions, truth


@pytest.fixture(scope="module")
def truth(demos):
    return _long(demos, 50.0)[2]


@pytest.fixture
def recording(demos, tmp_path):
    times, positions, _ = _long(demos, 50.0)
    return write_movement(tmp_path / "long.csv", {"times": times, "positions": positions})


def _right(truth, rows):
    for begin, end, letter in truth:
        middle = 0.5 * (begin + end)
        here = [one for one in rows if one["start"] <= middle <= one["end"]]
        assert [one["symbol"] for one in here] == [letter if letter in LETTERS else None]


def test_pandas_reads_what_happens_when(recording, library, truth, tmp_path):
    out = tmp_path / "labels.csv"
    said = answer("annotate", recording, "-l", library, "-o", out)
    assert said["written"] == [str(out)]
    assert said["problems"] == []
    _right(truth, said["annotations"])
    table = pandas.read_csv(out, keep_default_na=False)
    assert table["symbol"].tolist() == [one["symbol"] or "" for one in said["annotations"]]
    np.testing.assert_allclose(table["start"], [one["start"] for one in said["annotations"]])
    assert set(table["recording"]) == {"long.csv"}
    assert table["unknown"].tolist() == [one["unknown"] for one in said["annotations"]]
    np.testing.assert_allclose(table["uncertainty"], [one["uncertainty"] for one in said["annotations"]])
    assert (table["uncertainty"] > 0.0).all()


def test_elan_and_audacity_count_from_the_first_sample(recording, library, truth, tmp_path):
    run("annotate", recording, "-l", library, "-o", tmp_path / "long.eaf")
    run("annotate", recording, "-l", library, "-o", tmp_path / "long.txt")
    values = [one.text for one in ElementTree.parse(tmp_path / "long.eaf").findall(".//TIER[@TIER_ID='symbol']//*")]
    lines = [line.split("\t") for line in (tmp_path / "long.txt").read_text().splitlines()]
    assert [text for *_, text in lines] == [one for one in values if one and one.strip()]
    rows = [
        {"start": 50 + float(a), "end": 50 + float(b), "symbol": t if t != "unknown" else None} for a, b, t in lines
    ]
    _right(truth, rows)


def test_several_recordings_are_files_in_a_folder_or_one_table(recording, library, tmp_path):
    other = recording.rename(tmp_path / "other.csv")
    recording.write_bytes(other.read_bytes())
    out = tmp_path / "named"
    done = run("annotate", recording, other, "-l", library, "-o", out, "--format", "audacity")
    assert done.returncode == 0, done.stderr
    assert sorted(one.name[-9:] for one in out.iterdir()) == ["-long.txt", "other.txt"]
    said = answer("annotate", recording, other, "-l", library)
    assert {one["recording"] for one in said["annotations"]} == {recording.as_posix(), other.as_posix()}
    refused = run("annotate", recording, other, "-l", library, "-o", tmp_path / "one.eaf")
    assert refused.returncode == 1
    assert "name a folder" in refused.stderr


def test_nothing_is_written_over(recording, library, tmp_path):
    (tmp_path / "labels.csv").write_text("mine")
    for out in (tmp_path / "labels.csv", recording):
        before = out.read_bytes()
        assert run("annotate", recording, "-l", library, "-o", out).returncode == 2
        assert out.read_bytes() == before
    for given in (recording, tmp_path, tmp_path / "*.csv"):
        assert run("annotate", given, "-l", library, "-o", recording, "--force").returncode == 2
    assert recording.read_bytes() == before
    assert run("annotate", recording, "-l", library, "-o", tmp_path / "labels.csv", "--force").returncode == 0
    assert (tmp_path / "labels.csv").read_text().startswith("recording,place,start")


def test_a_recording_without_motion_has_no_annotations(recording, library, tmp_path):
    still = tmp_path / "still.csv"
    still.write_text("t,x,y\n" + "".join(f"{k / 100},1,1\n" for k in range(300)))
    said = answer("annotate", recording, still, "-l", library)
    assert {one["recording"] for one in said["annotations"]} == {recording.as_posix()}
    text = run("annotate", still, "-l", library)
    assert text.returncode == 0
    assert "0 movements of 0 symbols" in text.stdout


def test_the_command_shows_a_table_and_says_what_it_wrote(recording, library, tmp_path):
    shown = start("annotate", recording, "-l", library)
    assert shown.returncode == 0, shown.stderr
    assert shown.stderr == ""
    assert all(word in shown.stdout for word in ("GShape", "unknown", "start [s]", "how sure", "new"))
    wrote = run("annotate", recording, "-l", library, "-o", tmp_path / "a.json")
    assert f"written to {tmp_path / 'a.json'}" in wrote.stdout
    assert json.loads((tmp_path / "a.json").read_text())[0]["recording"] == "long.csv"


def test_csv_for_other_programs_is_that_of_the_file(recording, library, tmp_path):
    answer("annotate", recording, "-l", library, "-o", tmp_path / "rows.csv")
    done = run("annotate", recording, "-l", library, "--csv")
    assert done.stdout == (tmp_path / "rows.csv").read_text()
    assert run("annotate", recording, "-l", library, "--csv", "--json").returncode == 2


def test_recordings_of_which_none_can_be_searched_are_an_error(recording, library, tmp_path):
    (tmp_path / "wide.csv").write_text("t,a,b,c\n" + "\n".join(f"{k / 50},{k},{k * k},1" for k in range(40)))
    done = run("annotate", tmp_path / "wide.csv", "-l", library, "-o", tmp_path / "labels.csv")
    assert done.returncode == 1
    assert "expected recordings of 2 dimensions" in done.stderr
    assert not (tmp_path / "labels.csv").exists()


def test_a_table_of_labels_cuts_a_long_recording_into_symbols(recording, truth, tmp_path):
    table = pandas.DataFrame(truth, columns=["start", "end", "label"])
    table.to_csv(tmp_path / "labels.csv", index=False)
    learned = answer("learn", recording, "--labels", tmp_path / "labels.csv", "-l", tmp_path / "actions")
    assert (learned["added"], sorted(learned["symbols"])) == (6, sorted(set(ORDER)))
    again = answer("learn", recording, "--labels", tmp_path / "labels.csv", "-l", tmp_path / "actions")
    assert (again["added"], again["duplicates"]) == (0, 6)
    said = answer("annotate", recording, "-l", tmp_path / "actions")
    middles = [0.5 * (start + end) for start, end, _ in truth]
    found = [one["symbol"] for middle in middles for one in said["annotations"] if one["start"] < middle < one["end"]]
    assert found == [letter for *_, letter in truth]


def test_what_was_annotated_is_learned_with_the_unknown_left_without_symbol(recording, library, tmp_path):
    run("annotate", recording, "-l", library, "-o", tmp_path / "long.eaf")
    learned = answer("learn", recording, "--labels", tmp_path / "long.eaf", "-l", tmp_path / "actions")
    assert sorted(learned["symbols"]) == LETTERS
    with kineme.ActionLibrary(tmp_path / "actions", read_only=True) as actions:
        assert 0 < len(actions.unlabeled()) < len(actions)


def _lerobot(demos, source):
    """Write a data set of one episode with pandas, and return its frames."""
    times, positions, _ = _long(demos)
    positions = positions.astype(np.float32)
    names = ["x", "y"]
    counter = {"dtype": "int64", "shape": [1], "names": None}
    features = {"observation.state": {"dtype": "float32", "shape": [2], "names": names}}
    features |= dict.fromkeys(("timestamp", "frame_index", "episode_index", "index", "task_index"), counter)
    info = {"codebase_version": "v3.0", "fps": RATE, "features": features, "total_episodes": 1, "chunks_size": 1000}
    info["data_path"] = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    k = np.arange(len(positions))
    frames = {"observation.state": list(positions), "timestamp": times.astype(np.float32), "frame_index": k}
    frames |= {"episode_index": 0 * k, "index": k, "task_index": 0 * k}
    episodes = {"episode_index": [0], "length": [len(k)], "data/chunk_index": [0], "data/file_index": [0]}
    for path, table in (("data/chunk-000/file-000", frames), ("meta/episodes/chunk-000/file-000", episodes)):
        (source / path).parent.mkdir(parents=True)
        pandas.DataFrame(table).to_parquet(source / f"{path}.parquet")
    (source / "meta" / "info.json").write_text(json.dumps(info))
    return frames


def test_a_lerobot_set_is_copied_with_its_annotations(demos, library, tmp_path):
    """Each frame says what its episode shows."""
    source = tmp_path / "set"
    _lerobot(demos, source)
    said = answer("annotate", source, "-l", library, "-o", tmp_path / "named")
    assert said["written"] == [str(tmp_path / "named")]
    new = pandas.read_parquet(tmp_path / "named" / "data" / "chunk-000" / "file-000.parquet")
    for rows in new["language_persistent"]:
        named = [row["content"] for row in rows if row["content"] != "rest"]
        assert named == [one["symbol"] or "unknown" for one in said["annotations"]]
    _right(_long(demos)[2], said["annotations"])
    doubts = [motion.uncertainty for motion in read_motions(tmp_path / "named")]
    assert doubts == [one["uncertainty"] for one in said["annotations"]]
    again = run("annotate", source, "-l", library, "-o", tmp_path / "named", "--force")
    assert again.returncode
    said = " ".join(again.stderr.split())
    assert "is there; name another, or remove it: a folder is never written over, with --force neither" in said


@pytest.mark.parametrize("change", ["changed", "removed"])
def test_a_set_that_changes_while_it_is_read_is_not_copied(demos, library, tmp_path, monkeypatch, change):
    """Its annotations are of other frames than those that would be copied."""
    source = tmp_path / "set"
    _lerobot(demos, source)
    shard = source / "data" / "chunk-000" / "file-000.parquet"
    search = annotate.annotate_by

    def while_searching(*given):
        if change == "removed":
            shard.unlink()
        else:
            frames = pandas.read_parquet(shard)
            frames["observation.state"] = frames["observation.state"].map(lambda state: 2.0 * state)
            frames.to_parquet(shard)
        return search(*given)

    monkeypatch.setattr(annotate, "annotate_by", while_searching)
    done = run("annotate", source, "-l", library, "-o", tmp_path / "named")
    assert done.returncode
    said = " ".join(done.stderr.split())
    assert f"{shard.name} was {change} after it was read; nothing was written, run it again" in said
    assert not (tmp_path / "named").exists()


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_searched(demos, library, tmp_path, monkeypatch):
    _lerobot(demos, tmp_path / "set")
    (tmp_path / "closed").mkdir()
    # The superuser writes anywhere.
    monkeypatch.setattr(output, "os", SimpleNamespace(W_OK=os.W_OK, access=lambda path, _: path.name != "closed"))
    monkeypatch.setattr(annotate, "annotate_by", None)
    for name in ("named", "named.csv"):
        done = run("annotate", tmp_path / "set", "-l", library, "-o", tmp_path / "closed" / "of-today" / name)
        assert done.returncode == 2
        assert "closed is read-only; allow writing there, or choose another folder" in " ".join(done.stderr.split())


def test_a_lerobot_set_in_lance_is_annotated_in_place(demos, library, tmp_path):
    lance = pytest.importorskip("lance")
    source = tmp_path / "set"
    frames = pandas.DataFrame(_lerobot(demos, source))
    frames["observation.state"] = frames["observation.state"].map(list)
    lance.write_dataset(frames.rename(columns={"observation.state": "observation_state"}), str(source / "frames.lance"))
    info = json.loads((source / "meta" / "info.json").read_text()) | {"storage_format": "lance"}
    (source / "meta" / "info.json").write_text(json.dumps(info))
    refused = run("annotate", source, "-l", library, "-o", source)
    assert refused.returncode
    assert "write over it with --force" in " ".join(refused.stderr.split())
    assert lance.dataset(str(source / "frames.lance")).version == 1
    said = answer("annotate", source, "-l", library, "-o", source, "--force")
    assert said["written"] == [str(source)]
    table = lance.dataset(str(source / "frames.lance")).to_table(columns=["language_persistent"], limit=3)
    for rows in table["language_persistent"].to_pylist():
        named = [row["content"] for row in rows if row["content"] != "rest"]
        assert named == [one["symbol"] or "unknown" for one in said["annotations"]]
