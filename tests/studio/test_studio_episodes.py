"""Episodes of a data set or of files over HTTP: pages, strips, symbols, corrections, videos; no path from a client."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from episode_samples import CAMERA, FPS, drawn, write_drawings
from hypothesis import given
from hypothesis import strategies as st

from kineme import read_recordings
from kineme.errors import DataError
from kineme.io.reading.episodes import read_episodes
from kineme.io.reading.read_labels import labeled_pieces, read_labels
from kineme.io.writing.annotations import Annotation, write_annotations
from kineme.library.correct import as_labels, corrections_beside, corrections_of, motions_in
from kineme.movements.episodes import Episode
from kineme.studio.server import opened as opened_module
from kineme.studio.server.opened import OpenedRecordings, opened_at
from kineme.studio.server.records import envelope, plot
from lerobot_sets import add_videos, write_lance, write_v3

KINDS = [(0, 1), (2,), (1, 3, 0), (0,), (3, 2)]
WEBM = b"\x1a\x45\xdf\xa3" + bytes(range(256)) * 40


@pytest.fixture
def demos(tmp_path):
    return write_drawings(tmp_path / "demos", *KINDS, video=WEBM, codec="av1")


@pytest.fixture
def client(folder, demos, open_studio):
    return open_studio(folder, recordings=demos)


def _put(client, key, *spans, corrected=True):
    body = {
        "spans": [{"begin": begin, "end": end, "label": label} for begin, end, label in spans],
        "corrected": corrected,
    }
    return client.post(f"/api/episodes/{key}/spans", json=body)


def test_episodes_come_in_pages_with_what_was_done_in_them(client):
    page = client.get("/api/episodes?offset=1&limit=3").json()
    assert (page["name"], page["total"], page["offset"], page["saved"]) == ("demos", 5, 1, True)
    assert [(item["key"], item["number"], item["task"]) for item in page["episodes"]] == [
        ("episode-1", 1, "Wave"), ("episode-2", 2, "Draw"), ("episode-3", 3, "Wave")
    ]  # fmt: skip
    samples = len(drawn(1, 3, 0)[0])
    assert (page["episodes"][1]["n_samples"], page["episodes"][1]["spans"]) == (samples, [])
    assert page["episodes"][1]["duration"] == pytest.approx((samples - 1) / FPS, abs=1e-6)
    assert client.get("/api/episodes?offset=5").json()["episodes"] == []
    assert client.get("/api/episodes?limit=1000").status_code == 422


def test_a_strip_is_thinned_to_the_width_of_its_picture(client):
    positions, _ = drawn(*KINDS[2])
    strip = client.get("/api/episodes/episode-2/strip?width=20").json()
    assert [column["name"] for column in strip["columns"]] == ["x", "y"]
    assert len(strip["times"]) <= 40
    for column, values in zip(strip["columns"], positions.T, strict=True):
        shown = column["values"]
        assert (min(shown), max(shown)) == (
            pytest.approx(values.min(), abs=1e-3),
            pytest.approx(values.max(), abs=1e-3),
        )


@given(st.integers(1, 300), st.integers(1, 40), st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_no_peak_is_lost_where_signals_are_thinned(n, width, seed, missing):
    rng = np.random.default_rng(seed)
    values = np.where(rng.random((n, 3)) < missing, np.nan, rng.normal(size=(n, 3)))
    times = np.cumsum(rng.random(n))
    shown, thinned = envelope(times, values, width)
    assert len(shown) == len(thinned) <= max(2 * width, min(n, 2 * width))
    assert (np.diff(shown) >= 0).all()
    assert (shown[0], shown[-1]) == (times[0], times[-1])
    for column, before in zip(thinned.T, values.T, strict=True):
        assert np.isnan(column).all() == np.isnan(before).all()
        if not np.isnan(before).all():
            assert (np.nanmin(column), np.nanmax(column)) == (np.nanmin(before), np.nanmax(before))


def test_the_order_of_extremes_is_kept_and_an_empty_signal_is_none():
    values = np.array([0, 5, -5, 0, 0, -7, 7, 0.0])[:, None]
    assert envelope(np.arange(8.0), values, 2)[1].ravel().tolist() == [5, -5, -7, 7]
    assert plot(np.zeros(0), np.zeros((0, 1)), ["x"], 10) == {"times": [], "columns": [{"name": "x", "values": []}]}


def test_an_episode_is_a_recording_that_is_searched_and_learned_as_one_that_was_sent(client):
    detail = client.get("/api/episodes/episode-2").json()
    assert detail["recording"] == "episode-2"
    (table,) = detail["tables"]
    assert [channel["name"] for channel in table["channels"]] == ["x", "y", "action.x", "action.y"]
    assert (detail["chosen"], table["label"]) == (["x", "y"], None)
    body = {"channels": detail["chosen"]}
    spans = client.post("/api/recordings/episode-2/spotted", json=body).json()["spans"]
    assert [span["label"] for span in spans] == ["kind 1", "kind 3", "kind 0"]
    assert all(0 <= span["confidence"] <= 1 for span in spans)
    for span, (begin, end) in zip(spans, drawn(*KINDS[2])[1], strict=True):
        assert (span["begin"], span["end"]) == (pytest.approx(begin, abs=0.1), pytest.approx(end, abs=0.1))
    given_back = client.post("/api/episodes/episode-2/spans", json={"spans": spans}).json()
    assert given_back["corrected"] is False
    assert [span["label"] for span in given_back["spans"]] == ["kind 1", "kind 3", "kind 0"]
    assert client.get("/api/episodes").json()["n_corrected"] == 0  # nobody has looked at them
    named = {"begin": spans[0]["begin"], "end": spans[0]["end"], "label": "mine"}
    learned = client.post("/api/recordings/episode-2/learn", json={**body, "spans": [named]})
    assert learned.status_code == 200, learned.text
    symbols = {symbol["name"]: symbol["n_members"] for symbol in client.get("/api/library").json()["symbols"]}
    assert symbols["mine"] == 1


def test_corrections_are_a_table_that_kineme_reads(client, demos, tmp_path):
    _, spans = drawn(*KINDS[2])
    for key, labels in (("episode-2", ("mine", None, "kind 0")), ("episode-0", ())):
        rows = [(*span, label) for span, label in zip(spans, labels, strict=False)]
        assert _put(client, key, *rows).json()["corrected"] is True
    _put(client, "episode-1", (0.1, 0.9, "kind 2"), corrected=False)
    assert client.get("/api/episodes").json()["saved"] is False
    answer = client.post("/api/episodes/corrections", json={}).json()
    assert answer == {"file": "demos-corrections.csv", "n_spans": 4}  # all of the empty one is unknown
    assert client.get("/api/episodes").json()["saved"] is True
    sent = client.get("/api/episodes/corrections.csv")
    path = tmp_path / "demos-corrections.csv"
    assert path.read_bytes() == sent.content
    assert "demos-corrections.csv" in sent.headers["content-disposition"]
    *rows, empty = csv.DictReader(io.StringIO(sent.text))
    assert {(row["recording"], row["place"]) for row in rows} == {("demos", "episode 2")}
    assert (empty["place"], empty["start"], empty["symbol"]) == ("episode 0", "0.0", "")
    assert [(row["symbol"], row["unknown"]) for row in rows] == [("mine", "false"), ("", "true"), ("kind 0", "false")]
    pieces = labeled_pieces(read_recordings(demos), read_labels(path))
    assert list(pieces.labels) == [None, "mine", None, "kind 0"]
    for piece, (begin, end) in zip(pieces.demonstrations[1:], spans, strict=True):
        assert (piece.times[0], piece.times[-1]) == (pytest.approx(begin, abs=0.02), pytest.approx(end, abs=0.02))


def test_a_studio_goes_on_with_the_corrections_that_were_saved(client, folder, demos, open_studio, tmp_path):
    _put(client, "episode-3", (0.6, 2.1, "mine"))
    client.post("/api/episodes/corrections", json={})
    again = open_studio(folder, recordings=demos)
    page = again.get("/api/episodes").json()
    item = page["episodes"][3]
    assert (item["corrected"], page["saved"], page["n_corrected"]) == (True, True, 1)
    assert [(span["begin"], span["end"], span["label"], span["p"]) for span in item["spans"]] == [
        (pytest.approx(0.6), pytest.approx(2.1), "mine", None)
    ]
    _put(again, "episode-0", (0.6, 2.0, "kind 0"))
    assert again.post("/api/episodes/corrections", json={}).json()["n_spans"] == 2
    path = tmp_path / "demos-corrections.csv"
    path.write_text(path.read_text() + "demos,episode 4,0.5,1.0,theirs,1,1,false\n")
    refused = again.post("/api/episodes/corrections", json={})
    assert (refused.status_code, "theirs" in path.read_text()) == (409, True)
    assert again.post("/api/episodes/corrections", json={"replace": True}).status_code == 200
    assert "theirs" not in path.read_text()


def test_a_table_of_something_else_stays_as_it_is_unless_it_is_to_be_replaced(folder, demos, open_studio):
    path = demos.with_name("demos-corrections.csv")
    path.write_text("a,b\n1,2\n")
    client = open_studio(folder, recordings=demos)
    assert "was not read" in client.get("/api/episodes").json()["problem"]
    _put(client, "episode-0", (0.6, 2.0, "kind 0"))
    assert client.post("/api/episodes/corrections", json={}).status_code == 409
    assert path.read_text() == "a,b\n1,2\n"
    assert client.post("/api/episodes/corrections", json={"replace": True}).status_code == 200
    assert "kind 0" in path.read_text()


def test_for_reading_only_nothing_is_written(folder, demos, open_studio):
    client = open_studio(folder, recordings=demos, read_only=True)
    assert _put(client, "episode-0", (0.6, 2.0, "mine")).status_code == 200
    assert client.post("/api/episodes/corrections", json={}).status_code == 403
    assert "mine" in client.get("/api/episodes/corrections.csv").text
    assert not demos.with_name("demos-corrections.csv").exists()


def test_where_nothing_can_be_written_it_says_so(client, monkeypatch):
    _put(client, "episode-0", (0.6, 2.0, "mine"))

    def full(path, data):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("kineme.studio.server.opened.write_atomically", full)
    refused = client.post("/api/episodes/corrections", json={})
    assert (refused.status_code, "download it instead" in refused.json()["error"]) == (400, True)
    assert client.get("/api/episodes").json()["saved"] is False


def test_what_kineme_annotate_wrote_is_shown_and_is_no_correction(folder, demos, open_studio, tmp_path):
    note = Annotation("demos", "episode 1", 0.6, 2.1, "kind 2", 0.7, 0.9)
    write_annotations(tmp_path / "named", [note], [demos], "lerobot")
    client = open_studio(folder, recordings=tmp_path / "named")
    page = client.get("/api/episodes").json()
    (span,) = page["episodes"][1]["spans"]
    assert (span["label"], span["p"], span["confidence"]) == ("kind 2", pytest.approx(0.7), pytest.approx(0.9))
    assert (page["episodes"][1]["corrected"], page["n_corrected"]) == (False, 0)


def test_corrections_stand_before_what_kineme_annotate_wrote(folder, demos, open_studio, tmp_path):
    note = Annotation("demos", "episode 1", 0.6, 2.1, "kind 2", 0.7, 0.9)
    write_annotations(tmp_path / "named", [note], [demos], "lerobot")
    client = open_studio(folder, recordings=tmp_path / "named")
    _put(client, "episode-1", (0.6, 2.0, "mine"))
    client.post("/api/episodes/corrections", json={})
    item = open_studio(folder, recordings=tmp_path / "named").get("/api/episodes").json()["episodes"][1]
    assert ([span["label"] for span in item["spans"]], item["corrected"]) == (["mine"], True)


def test_an_episode_of_which_all_was_removed_is_corrected_too(folder, demos, open_studio, tmp_path):
    """Its row says that it was looked at: what was annotated there is removed, not left as it was."""
    notes = [Annotation("demos", f"episode {k}", 0.1, 0.7, "kind 2", 0.7, 0.9) for k in (1, 2)]
    write_annotations(tmp_path / "named", notes, [demos], "lerobot")
    client = open_studio(folder, recordings=tmp_path / "named")
    _put(client, "episode-1")
    assert client.get("/api/episodes").json()["episodes"][1]["spans"] == []
    client.post("/api/episodes/corrections", json={})
    table, recordings = read_labels(corrections_beside(tmp_path / "named")), read_recordings(tmp_path / "named")
    assert [(row.place, row.label, row.start) for row in table.rows] == [("episode 1", None, 0.0)]
    corrections = corrections_of(recordings, table, as_labels(motions_in(tmp_path / "named")))
    assert [(change.kind, change.was) for change in corrections.changes] == [("removed", "kind 2")]
    assert not corrections.examples
    again = open_studio(folder, recordings=tmp_path / "named").get("/api/episodes").json()["episodes"]
    assert [(item["corrected"], [span["label"] for span in item["spans"]]) for item in again[1:3]] == [
        (True, [None]), (False, ["kind 2"]),
    ]  # fmt: skip


def test_spans_are_kept_in_order_and_those_without_a_length_are_not(client):
    spans = _put(client, "episode-0", (1.0, 1.5, "b"), (0.2, 0.6, "a"), (0.8, 0.8, "c")).json()["spans"]
    assert [span["label"] for span in spans] == ["a", "b"]


def test_a_correction_that_is_taken_back_is_to_be_saved_again(client):
    _put(client, "episode-0", (0.6, 2.0, "mine"))
    client.post("/api/episodes/corrections", json={})
    _put(client, "episode-0", (0.6, 2.0, "kind 0"), corrected=False)
    assert client.get("/api/episodes").json()["saved"] is False


def test_videos_are_sent_in_parts(client):
    (video,) = client.get("/api/episodes/episode-1").json()["videos"]
    assert video == {"camera": CAMERA, "start": 0.0, "codec": "av1"}
    address = f"/api/episodes/episode-1/videos/{CAMERA}"
    answer = client.get(address)
    assert (answer.status_code, answer.content, answer.headers["content-type"]) == (200, WEBM, "video/webm")
    part = client.get(address, headers={"Range": "bytes=4-9"})
    assert (part.status_code, part.content) == (206, WEBM[4:10])
    assert part.headers["content-range"] == f"bytes 4-9/{len(WEBM)}"
    assert "media-src 'self'" in answer.headers["content-security-policy"]
    assert client.get("/api/episodes/episode-1/videos/other").status_code == 404


@pytest.mark.parametrize("key", ["info", "video_info"])
def test_an_episode_begins_within_the_video_of_many(folder, open_studio, tmp_path, key):
    demos = write_v3(tmp_path / "demos")
    add_videos(demos, "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4")
    path = demos / "meta" / "info.json"
    info = json.loads(path.read_text())
    info["features"][CAMERA][key] = {"video.codec": "av1"}
    path.write_text(json.dumps(info))
    client = open_studio(folder, recordings=demos)
    videos = [client.get(f"/api/episodes/episode-{k}").json()["videos"] for k in range(3)]
    assert videos == [[{"camera": CAMERA, "start": start, "codec": "av1"}] for start in (0, 0.4, 1.0)]


def test_nothing_but_videos_within_the_data_set_is_sent(demos, client):
    address = f"/api/episodes/episode-1/videos/{CAMERA}"
    file = demos / f"videos/chunk-000/{CAMERA}/episode_000001.mp4"
    file.write_text("a secret")
    assert client.get(address).status_code == 404
    file.unlink()
    assert client.get(address).status_code == 404
    item = client.app.state.studio.opened.page(1, 1)[0]
    outside = demos.parent / "outside.mp4"
    outside.write_bytes(WEBM)
    for name in ("../outside.mp4", "/etc/passwd", str(outside), "videos/../../outside.mp4"):
        item.episode.videos[CAMERA] = name
        assert client.get(address).status_code == 404


KEYS = ["episode-5", "episode--1", "episode-", "episode-x", "..", "demos", "episode-%2e%2e%2f", "episode-99999999999"]


@pytest.mark.parametrize("key", KEYS)
def test_a_key_that_is_none_leads_nowhere(client, key):
    for path in (f"/api/episodes/{key}", f"/api/episodes/{key}/strip", f"/api/episodes/{key}/videos/{CAMERA}"):
        assert client.get(path).status_code in {404, 422}
    assert client.post(f"/api/recordings/{key}/spotted", json={}).status_code in {404, 405}
    assert _put(client, key, (0, 1, "a")).status_code == 404


def test_a_studio_without_recordings_has_no_episodes(folder, open_studio):
    client = open_studio(folder)
    assert client.get("/api/episodes").json()["name"] is None
    for path in ("/api/episodes/episode-0", "/api/episodes/corrections.csv"):
        assert client.get(path).status_code == 404
    assert client.post("/api/episodes/corrections", json={}).status_code == 404
    assert client.post("/api/recordings/episode-0/spotted", json={}).status_code == 404


def test_a_page_reads_its_own_episodes_alone(demos, monkeypatch):
    from kineme.io.lerobot import episodes as reading

    asked, real = [], reading.episodes

    def noted(folder, features, numbers):
        asked.append(sorted(numbers))
        return real(folder, features, numbers)

    monkeypatch.setattr(reading, "episodes", noted)
    opened = OpenedRecordings(demos, held=0)
    assert [item.episode.number for item in opened.page(1, 2)] == [1, 2]
    assert opened.episode("episode-2").episode.number == 2  # it is there still
    assert [item.episode.number for item in opened.page(4, 20)] == [4]
    opened.page(1, 2)  # they were let go
    assert asked == [[1, 2], [4], [1, 2]]


def test_an_episode_that_cannot_be_read_is_there_with_its_problem(client, demos):
    (demos / "data/chunk-000/episode_000001.parquet").write_bytes(b"PAR1 and no more")
    page = client.get("/api/episodes").json()["episodes"]
    assert [bool(item["problems"]) for item in page] == [False, True, False, False, False]
    assert (page[1]["n_samples"], page[1]["duration"]) == (0, 0)
    detail = client.get("/api/episodes/episode-1").json()
    assert detail["tables"][0]["channels"] == []
    assert client.get("/api/episodes/episode-1/strip").json()["times"] == []
    assert client.post("/api/recordings/episode-1/spotted", json={}).status_code == 400


@pytest.fixture
def files(tmp_path):
    """A folder of tables, one of them damaged, one with two movements and a clock of its own."""
    folder = tmp_path / "tables"
    (folder / "wave").mkdir(parents=True)
    x, _ = drawn(0, 1)
    t = np.arange(len(x)) / FPS
    for name, clock in (("a.csv", 0.0), ("wave/b.csv", 1e6)):
        rows = [f"{a:.4f},{b:.6f},{c:.6f}" for a, (b, c) in zip(t + clock, x, strict=True)]
        (folder / name).write_text("t,x,y\n" + "\n".join(rows))
    (folder / "damaged.csv").write_text("nothing\n")
    rows = [f"{k},{a:.4f},{b:.6f},{c:.6f}" for k in (7, 8) for a, (b, c) in zip(t, x, strict=True)]
    (folder / "two.csv").write_text("movement,t,x,y\n" + "\n".join(rows))
    return folder


def test_a_folder_of_recordings_is_a_list_of_movements(files, folder, open_studio):
    client = open_studio(folder, recordings=files)
    page = client.get("/api/episodes").json()
    assert [item["place"] for item in page["episodes"]] == [
        "a.csv",
        "damaged.csv",
        "two.csv 7",
        "two.csv 8",
        "wave/b.csv",
    ]
    assert (page["total"], page["episodes"][4]["task"]) == (5, "wave")
    assert page["episodes"][1]["problems"]
    for key, origin, recording, place in ((3, 0.0, "two.csv", "8"), (4, 1e6, "wave/b.csv", "")):
        spans = client.post(f"/api/recordings/episode-{key}/spotted", json={"channels": ["x", "y"]}).json()["spans"]
        assert [span["label"] for span in spans] == ["kind 0", "kind 1"]
        _put(client, f"episode-{key}", (spans[0]["begin"], spans[0]["end"], "mine"))
        rows = list(csv.DictReader(io.StringIO(client.get("/api/episodes/corrections.csv").text)))
        row = next(row for row in rows if row["recording"] == recording)
        assert (row["place"], float(row["start"])) == (place, pytest.approx(origin + spans[0]["begin"], abs=1e-6))


def test_of_files_only_those_up_to_the_page_are_read(files, monkeypatch):
    read, real = [], opened_module.read_recordings
    monkeypatch.setattr(
        opened_module, "read_recordings", lambda path, **how: read.append(path.name) or real(path, **how)
    )
    opened = OpenedRecordings(files, held=0)
    assert (len(opened.page(0, 1)), opened.total) == (1, None)
    assert read == ["a.csv", "damaged.csv"]  # one more says that there are others
    assert [item.episode.number for item in opened.page(3, 5)] == [3, 4]
    assert opened.total == 5
    assert [item.recording for item in opened.page(0, 2)] == ["a.csv", "damaged.csv"]  # read again


def test_one_file_is_opened_too(files, folder, open_studio):
    client = open_studio(folder, recordings=files / "two.csv")
    page = client.get("/api/episodes").json()
    assert ([item["place"] for item in page["episodes"]], page["file"]) == (
        ["two.csv 7", "two.csv 8"],
        "two-corrections.csv",
    )


def test_a_path_without_recordings_is_refused(tmp_path):
    with pytest.raises(DataError, match="found nothing"):
        OpenedRecordings(tmp_path / "none")
    assert list(opened_at(tmp_path)) == []


def test_a_feature_that_is_no_movement_hides_no_other(client):
    opened = client.app.state.studio.opened
    item = opened.page(0, 1)[0]
    signals = {**item.episode.signals, "pose": np.full((len(item.episode), 4), 2.0)}
    names = {**item.episode.names, "pose": ("qw", "qx", "qy", "qz")}  # of no orientation
    opened._episodes[0] = item._replace(episode=Episode(0, item.episode.times, signals, names))
    detail = client.get("/api/episodes/episode-0").json()
    assert [channel["name"] for channel in detail["tables"][0]["channels"]] == ["x", "y"]
    spans = client.post("/api/recordings/episode-0/spotted", json={"channels": ["x", "y"]}).json()["spans"]
    assert [span["label"] for span in spans] == ["kind 0", "kind 1"]


def test_episodes_that_are_files_of_their_own_are_named_so(tmp_path, monkeypatch):
    monkeypatch.setattr(opened_module, "holds_episodes", lambda path: True)
    episodes = [Episode(k, np.arange(9.0), {"a": np.zeros((9, 2))}, {"a": ("x", "y")}, place=f"{k}.h5") for k in (0, 1)]
    monkeypatch.setattr(opened_module, "read_episodes", lambda path: iter(episodes))
    (tmp_path / "0.h5").write_bytes(b"")
    assert [item.movement for item in opened_at(tmp_path)] == [("0.h5", ""), (tmp_path.name, "1.h5")]


def test_a_data_set_is_opened_as_episodes_with_all_their_signals_and_a_table_as_a_file(tmp_path):
    written = write_v3(tmp_path / "set", (30, 40))
    assert [(item.file, sorted(item.episode.signals)) for item in opened_at(written)] == [
        (None, sorted(episode.signals)) for episode in read_episodes(written)
    ]
    table = tmp_path / "0.csv"
    table.write_text("\n".join(["t,x,y", *(f"{k / 10},{k},{k * k}" for k in range(20))]))
    assert [item.file for item in opened_at(table)] == [table]


def test_a_data_set_in_lance_is_opened_too(folder, open_studio, tmp_path):
    pytest.importorskip("lance", reason="pylance is not installed")
    client = open_studio(folder, recordings=write_lance(tmp_path / "demos"))
    page = client.get("/api/episodes?offset=1").json()
    assert (page["total"], [item["place"] for item in page["episodes"]]) == (3, ["episode 1", "episode 2"])
    assert client.get("/api/episodes/episode-1").json()["videos"] == []


def test_episodes_with_stamps_that_go_back_are_drawn_and_are_no_recording(client):
    opened = client.app.state.studio.opened
    item = opened.page(0, 1)[0]
    odd = Episode(0, item.episode.times[::-1].copy(), item.episode.signals, item.episode.names)
    opened._episodes[0] = item._replace(episode=odd)
    detail = client.get("/api/episodes/episode-0").json()
    assert detail["problems"]
    assert detail["plots"][0]["columns"]
