"""One form of an answer, and of a movement under way: Python, the shell, the studio and the runtime fit one schema."""

from __future__ import annotations

import json
from importlib.resources import files

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner
from node_runtime import NODE, REASON, ask, question
from studio_samples import LIVE, request_of, samples

from kineme import ActionLibrary, Recognizer, Trajectory, write_movement
from kineme.cli import main
from kineme.recognition.conformal import RULES
from kineme.studio.snapshot import DRAWN, snapshot_of_library

SCHEMA = json.loads(files("kineme.recognition").joinpath("answer.schema.json").read_text(encoding="utf-8"))
ANSWER = jsonschema.Draft202012Validator(SCHEMA)
STATE = jsonschema.Draft202012Validator(SCHEMA["$defs"]["state"])
KINDS = (2, 7)  # of the drawings: a symbol of the library, and none


def _movement(k):
    drawing = request_of(k)
    return Trajectory(np.array(drawing["times"]), np.array(drawing["positions"]))


def _of_python(folder):
    with ActionLibrary(folder, read_only=True) as library:
        return [library.recognize(_movement(k)).to_dict() for k in KINDS]


def _of_the_shell(folder):
    for k in KINDS:
        movement = _movement(k)
        write_movement(folder.parent / f"{k}.csv", {"times": movement.times, "positions": movement.positions})
    paths = [str(folder.parent / f"{k}.csv") for k in KINDS]
    done = CliRunner().invoke(main, ["recognize", *paths, "-l", str(folder), "--json", "--top", "9"])
    assert done.exit_code == 0, done.output
    return [movement["answer"] for movement in json.loads(done.stdout)["movements"]]


def _of_the_runtime(folder):
    with ActionLibrary(folder, read_only=True) as library:
        snapshot = snapshot_of_library(library)
    return ask(snapshot, [question("recognize", _movement(k)) for k in KINDS])


def _same(ours, theirs):
    """Equal, numbers up to single precision; what the runtime does not have is None there."""
    if isinstance(ours, dict):
        assert list(ours) == list(theirs)
        for key in ours:
            _same(ours[key], theirs[key])
    elif isinstance(ours, list):
        for a, b in zip(ours, theirs, strict=True):
            _same(a, b)
    elif isinstance(ours, (int, float)) and not isinstance(ours, bool):  # JSON of JavaScript has 1 for 1.0
        assert ours == pytest.approx(theirs, abs=1e-5, rel=1e-4)
    else:
        assert ours is None or ours == theirs


def test_the_schema_is_one_and_knows_every_rule():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert set(SCHEMA["properties"]["rule"]["enum"]) == set(RULES)


def test_python_the_shell_and_the_studio_give_one_form(client, folder):
    ours = _of_python(folder)
    served = [client.post("/api/recognize", json=request_of(k)).json() for k in KINDS]
    with client.websocket_connect(LIVE) as socket:
        heard = []
        for k in KINDS:
            socket.send_json({"samples": samples(k)})
            socket.receive_json()
            socket.send_json({"finish": True})
            heard.append(socket.receive_json()["answer"])
    for answers in (ours, _of_the_shell(folder), served, heard):
        assert [answer["label"] for answer in answers] == ["kind 2", None]
        for answer, expected in zip(answers, ours, strict=True):
            ANSWER.validate(answer)
            _same(answer, expected)


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_the_runtime_gives_the_same_form_without_a_transform(folder):
    for answer, expected in zip(_of_the_runtime(folder), _of_python(folder), strict=True):
        ANSWER.validate(answer)
        assert answer["transform"] is answer["nearest"][0]["name"] is None
        _same(answer, expected)


def test_labels_that_are_numbers_are_texts():
    movements = [_movement(k).positions for k in range(3)]
    (answer,) = Recognizer().fit(movements, [3, 1, 2]).recognize(movements[:1])
    form = json.loads(json.dumps(answer.to_dict(top=2), allow_nan=False))
    ANSWER.validate(form)
    assert (form["label"], [candidate["label"] for candidate in form["ranked"]]) == ("3", ["3", "2"])


def _states(socket, k, ends):
    for begin, end in zip([0, *ends], ends, strict=False):
        socket.send_json({"samples": samples(k)[begin:end]})
        yield socket.receive_json()["state"]
    socket.send_json({"reset": True})


@pytest.mark.skipif(NODE is None, reason=REASON)
def test_a_movement_under_way_has_one_form(client, folder):
    ends = [2, 20, 40, 60]
    with client.websocket_connect(LIVE) as socket:
        served = [state for k in KINDS for state in _states(socket, k, ends)]
    with ActionLibrary(folder, read_only=True) as library:
        snapshot = snapshot_of_library(library, early=DRAWN)
        ours = []
        for k in KINDS:
            stream, movement = library.stream(early=DRAWN), _movement(k)
            for begin, end in zip([0, *ends], ends, strict=False):
                state = stream.update(movement.times[begin:end], movement.positions[begin:end])
                ours.append(json.loads(json.dumps(state.to_dict(), allow_nan=False)))
    runtime = [state for k in KINDS for state in ask(snapshot, [question("follow", _movement(k), ends=ends)])[0]]
    for state, expected, drawn in zip(served, ours, runtime, strict=True):
        STATE.validate(state)
        STATE.validate(expected)
        assert list(state) == list(expected)
        if not expected["ranked"]:
            assert drawn is None
            continue
        STATE.validate(drawn)
        _same(drawn, {key: expected[key] for key in drawn})
        assert expected.keys() - drawn.keys() == {"skipped", "status"}


@pytest.mark.skipif(NODE is None, reason=REASON)
@pytest.mark.parametrize("slower", [1, 50, 1e4, 1e40])
def test_classes_of_a_movement_unlike_all_share_one(folder, slower):
    """However little is left to them beside unknown, whose share is 1 in floating point."""
    movement = _movement(KINDS[0])
    slow = Trajectory(slower * movement.times, movement.positions)
    with ActionLibrary(folder, read_only=True) as library:
        snapshot = snapshot_of_library(library, early=DRAWN)
        state = library.stream(early=DRAWN).update(slow.times, slow.positions)
    drawn = ask(snapshot, [question("follow", slow, ends=[len(slow)])])[0][0]
    expected = json.loads(json.dumps(state.to_dict(), allow_nan=False))
    for form in (expected, drawn):
        STATE.validate(form)
        assert sum(guess["probability"] for guess in form["ranked"]) == pytest.approx(1.0)
    assert drawn["ranked"][0]["label"] == expected["ranked"][0]["label"]
    assert expected["ranked"][0]["probability"] == pytest.approx(drawn["ranked"][0]["probability"], abs=1e-3)
    assert list(state.probabilities.values()) == sorted(state.probabilities.values(), reverse=True)
