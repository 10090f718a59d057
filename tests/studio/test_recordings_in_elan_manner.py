"""Recordings in the studio: tables that do not say how they are read, shapes of stretches, annotations as files."""

from __future__ import annotations

import csv
import io
import json
import math
import shlex
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from studio_samples import drawing

from kineme.cli.main import main
from kineme.errors import SpecificationError
from kineme.io.reading.recordings import read_recordings
from kineme.io.writing.annotations import WRITERS, Annotation, write_annotations
from kineme.studio.server.importing import NO_TIME, command, reader_options, table_preview

RATE = 50.0
T, X = np.arange(120) / RATE, drawing(1, n=120)[1]


def _text(columns, heads="", separator=","):
    text = io.StringIO()
    np.savetxt(text, np.column_stack(columns), "%.6f", separator, header=heads, comments="")
    return text.getvalue()


#: Name -> text, what is guessed of time, unit and columns, and what is said to be unclear, if anything is.
TABLES = {
    "without times": (_text([X], "x,y"), None, None, ["x", "y"], "Nothing in this file says when"),
    "times of another name": (_text([1000 * T, X], "when,x,y"), "when", "ms", ["x", "y"], "Nothing in this file says"),
    "a counter": (_text([np.arange(120), X], "n;a;b", ";"), None, None, ["a", "b"], "Nothing in this file says when"),
    "without names": (_text([X]), None, None, ["column 0", "column 1"], "The columns of this file have no names."),
    "times without names": (_text([T, X]), "column 0", "s", ["column 1", "column 2"], "The columns of this file have"),
    "clear": (_text([T, X], "t,x,y"), "t", "s", ["x", "y"], ""),
    "a strange rate": (_text([5 * np.arange(120), X], "t [s],x,y"), "t [s]", "s", ["x", "y"], "It would have 0.2 samp"),
}


def _send(client, text, name="some.csv"):
    return client.post("/api/recordings", content=text.encode(), headers={"X-File-Name": name}).json()


@pytest.mark.parametrize("name", TABLES)
def test_what_a_table_does_not_say_is_guessed_and_asked_for(shared_client, name):
    text, time, units, columns, unclear = TABLES[name]
    sent = _send(shared_client, text)
    preview = sent["preview"]
    assert (preview["time"], preview["units"], preview["columns"]) == (time, units, columns)
    assert sent["unclear"].startswith(unclear)
    assert bool(sent["unclear"]) == bool(unclear)
    assert len(preview["rows"]) == 6
    assert all(len(row) == len(preview["heads"]) for row in preview["rows"])
    choice = {"time": time, "units": units, "rate": RATE, "columns": columns, "measured_in": "mm"}
    read = shared_client.post(f"/api/recordings/{sent['recording']}/read", json=choice)
    assert read.status_code == 200, read.text
    (table,) = read.json()["tables"]
    assert read.json()["unclear"] == ""
    assert table["rate"] == pytest.approx(0.2 if "strange" in name else RATE)
    assert [(channel["name"], channel["unit"]) for channel in table["channels"]] == [(head, "mm") for head in columns]


@pytest.mark.soak
@pytest.mark.parametrize("name", ["without times", "times of another name", "a counter", "without names"])
def test_the_command_of_the_shell_reads_the_file_as_the_studio_does(shared_client, tmp_path, name, monkeypatch, capsys):
    text, time, units, columns, _ = TABLES[name]
    sent = _send(shared_client, text, "my file.csv")
    choice = {"time": time, "units": units, "rate": RATE, "columns": columns, "measured_in": "mm"}
    read = shared_client.post(f"/api/recordings/{sent['recording']}/read", json=choice).json()
    (tmp_path / "my file.csv").write_text(text)
    monkeypatch.chdir(tmp_path)
    words = shlex.split(read["command"])
    assert words[:4] == ["kineme", "annotate", "my file.csv", "--library"]
    with pytest.raises(SystemExit) as end:
        main([*words[1:], "--json"])
    assert end.value.code in {0, None}
    assert json.loads(capsys.readouterr().out)["seconds"] == pytest.approx(read["tables"][0]["duration"])


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16", "utf-16-be"])
def test_a_table_that_is_longer_than_what_is_guessed_from_is_previewed_in_any_encoding(tmp_path, encoding):
    path = tmp_path / "long.csv"
    mark = "\ufeff" * (encoding == "utf-16-be")
    path.write_text(mark + _text([np.arange(9000) / RATE, np.arange(9000)], "t [s],grüße"), encoding)
    for data in (path.read_bytes(), path.read_bytes()[:4000]):
        path.write_bytes(data)
        assert table_preview(path)["heads"] == ["t [s]", "grüße"]


def test_a_choice_that_is_refused_leaves_the_file_as_it_was_read(client):
    sent = _send(client, TABLES["clear"][0])
    path = f"/api/recordings/{sent['recording']}"
    refused = client.post(f"{path}/read", json={"time": "x", "columns": ["t", "y"]})
    assert refused.status_code == 400
    assert "strictly increasing" in refused.json()["error"]
    assert client.post(f"{path}/spotted", json={}).status_code == 200
    again = client.post(f"{path}/read", json={"rate": 100, "columns": ["y"]}).json()
    assert again["tables"][0]["rate"] == pytest.approx(100)
    assert [channel["name"] for channel in again["tables"][0]["channels"]] == ["y"]
    assert "--exclude t" in again["command"]
    shapes = client.post(f"{path}/shapes", json={"spans": [{"begin": 0, "end": 0.5}]}).json()
    assert shapes[0]["times"][-1] == 0.5  # it is read so from now on
    assert client.post("/api/recordings/none/read", json={"columns": ["y"]}).status_code == 404


def test_arrays_without_times_are_asked_for_them_too(client):
    array = io.BytesIO()
    np.save(array, X)
    sent = client.post("/api/recordings", content=array.getvalue(), headers={"X-File-Name": "a.npy"}).json()
    assert (sent["tables"], sent["unclear"]) == ([], NO_TIME)
    assert sent["preview"]["columns"] == ["x", "y"]
    assert sent["preview"]["rows"][1] == [f"{value:.6g}" for value in X[1]]
    path = f"/api/recordings/{sent['recording']}/read"
    read = client.post(path, json={"rate": RATE, "columns": ["x", "y"]}).json()
    assert read["tables"][0]["rate"] == pytest.approx(RATE)
    assert read["command"].endswith("--units 0.02")
    turned = io.BytesIO()
    np.save(turned, np.zeros((4, 2, 50)) + np.arange(50))
    refused = client.post("/api/recordings", content=turned.getvalue(), headers={"X-File-Name": "b.npy"})
    assert "array.T" not in refused.text
    assert "turn the array" in refused.text


def test_what_is_no_table_is_refused_as_before(client):
    answer = client.post("/api/recordings", content=b"hello\nworld\n", headers={"X-File-Name": "a.csv"})
    assert answer.status_code == 400
    assert "=" not in answer.json()["error"]


@settings(deadline=None, max_examples=30)
@given(data=st.text("0123456789.,;\"'\t xyt-\n", max_size=300))
def test_a_preview_is_one_of_any_text_or_none(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("any") / "any.csv"
    path.write_text(data)
    try:
        preview = table_preview(path)
    except Exception as error:
        assert type(error).__module__ == "kineme.errors"  # noqa: PT017
    else:
        assert preview is None or (preview["rows"] and len(preview["heads"]) == len(preview["numbers"]))


def test_options_and_command():
    preview = {"named": True, "heads": ["time", "x"]}
    choice = {"time": None, "units": "ms", "rate": 25.0, "columns": ["x"], "measured_in": None}
    assert reader_options(preview, choice) == {"columns": ["x"], "units": 0.04, "exclude": ["time"]}
    options = reader_options(preview, choice | {"time": "time", "units": None, "measured_in": "mm"})
    assert options == {"columns": ["x"], "time": "time", "measured_in": "mm"}
    said = command("a b.csv", "actions", options)
    assert said == "kineme annotate 'a b.csv' --library actions --columns x --time time --measured-in mm"


def test_a_unit_that_the_file_does_not_say_is_given_and_one_that_it_says_stays(tmp_path):
    (tmp_path / "a.csv").write_text(_text([T, X, T], "t,x,y [cm],yaw"))
    (plain,) = read_recordings(tmp_path / "a.csv").demonstrations
    assert [channel.unit for channel in plain.channels] == [None, "cm", None]
    (measured,) = read_recordings(tmp_path / "a.csv", measured_in="mm").demonstrations
    assert [channel.unit for channel in measured.channels] == ["mm", "mm", None]
    np.testing.assert_allclose(measured.positions, plain.positions * [1, 10, 1])
    (tmp_path / "b.json").write_text(
        json.dumps(
            [{"t": t, "joints": [{"name": "a", "x": x, "y": t}]} for t, (x, _) in zip(T, X.tolist(), strict=True)]
        )
    )
    joints = read_recordings(tmp_path / "b.json", measured_in="mm")
    assert ([channel.unit for channel in joints.demonstrations.channels], joints.notes) == (["mm", "mm"], ())
    (note,) = read_recordings(tmp_path / "a.csv", measured_in="mm", columns=["yaw"]).notes
    assert note == "no column is in mm, as measured_in= (--measured-in) says: none without a unit can be in it"
    with pytest.raises(SpecificationError, match="expected measured_in to be a unit"):
        read_recordings(tmp_path / "a.csv", measured_in="parsec")


def test_shapes_are_those_of_the_chosen_channels_between_begin_and_end(shared_client):
    z = np.linspace(0, 1, 120)
    sent = _send(shared_client, _text([T + 1000, z, X, z], "t,force,hand_x,hand_y,hand_z"))
    path = f"/api/recordings/{sent['recording']}/shapes"
    spans = [{"begin": 0.5, "end": 1.0}, {"begin": 5.0, "end": 6.0}, {"begin": 0, "end": 99}]
    body = {"channels": ["hand_z", "hand_x", "hand_y"], "spans": spans, "points": 20}
    middle, outside, whole = shared_client.post(path, json=body).json()
    assert outside == {"times": [], "path": []}
    assert (middle["times"][0], middle["times"][-1]) == (pytest.approx(0.5), pytest.approx(1.0))
    assert len(whole["path"]) == len(whole["times"]) == 20
    expected = np.column_stack((X, z))
    np.testing.assert_allclose(middle["path"][0], expected[25], atol=1e-3)
    np.testing.assert_allclose(whole["path"][-1], expected[-1], atol=1e-3)
    flat = shared_client.post(path, json={"channels": ["force"], "spans": spans[:1]}).json()
    np.testing.assert_allclose(flat[0]["path"][0], [z[25]], atol=1e-3)
    assert shared_client.post(path, json={"spans": []}).json() == []


SPANS = [
    {"begin": 1.0, "end": 1.5, "label": "später & <b>", "p": 0.25, "confidence": 0.5},
    {"begin": 0.25, "end": 0.75, "label": None},
]


@pytest.mark.parametrize("form", ["csv", "json", "elan", "audacity", "rerun"])
def test_annotations_are_written_in_every_format_of_the_shell_that_is_a_file(shared_client, form):
    if form == "rerun":
        pytest.importorskip("rerun")
    sent = _send(shared_client, _text([T + 7, X], "t,x,y"), "own%20words.csv")
    body = {"spans": SPANS, "format": form, "channels": ["x", "y"]}
    answer = shared_client.post(f"/api/recordings/{sent['recording']}/annotations", json=body)
    assert answer.status_code == 200, answer.text
    ending = {"csv": ".csv", "json": ".json", "elan": ".eaf", "audacity": ".txt", "rerun": ".rrd"}[form]
    assert f"own_words_csv-labels{ending}" in answer.headers["content-disposition"]
    if form == "csv":
        first, second = csv.DictReader(io.StringIO(answer.text))
        assert (float(first["start"]), first["symbol"], first["p_value"]) == (7.25, "", "")
        assert (float(second["end"]), second["symbol"], second["p_value"]) == (8.5, SPANS[0]["label"], "0.25")
    elif form == "json":
        first, second = answer.json()
        assert (first["p_value"], first["unknown"], second["confidence"]) == (None, True, 0.5)
    elif form == "elan":
        tiers = {tier.get("TIER_ID"): len(tier) for tier in ElementTree.fromstring(answer.text).iter("TIER")}
        assert tiers == {"symbol": 2, "p-value": 1, "confidence": 2}  # a person has no p-value
    elif form == "audacity":
        assert answer.text.splitlines()[1].split("\t") == ["1.000000", "1.500000", SPANS[0]["label"]]
    else:
        assert answer.content[:4] in {b"RRF2", b"RRF3", b"RRIO"} or len(answer.content) > 1000


def test_every_format_that_is_a_file_of_its_own_is_offered(shared_client):
    page = shared_client.get("/").text
    assert all(f'<option value="{name}">' in page for name, writer in WRITERS.items() if writer.copies is None)
    sent = _send(shared_client, TABLES["clear"][0])
    answer = shared_client.post(f"/api/recordings/{sent['recording']}/annotations", json={"spans": [], "format": "bag"})
    assert answer.status_code == 400
    assert "csv, json, elan, audacity, rerun" in answer.json()["error"]


def test_a_p_value_that_nobody_knows_is_null_in_json(tmp_path):
    note = Annotation("a.csv", "", 0.0, 1.0, "wave", math.nan, 1.0)
    (path,) = write_annotations(tmp_path / "a.json", [note], [tmp_path / "a.csv"])
    assert json.loads(path.read_text())[0]["p_value"] is None
