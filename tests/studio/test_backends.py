"""The library of a server and that of a snapshot are asked by the same four functions, with the same questions."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from node_runtime import NODE, REASON
from studio_samples import request_of
from test_answer_form import ANSWER, STATE

from kineme import ActionLibrary, studio
from kineme.studio.snapshot import DRAWN, snapshot_of_library

pytestmark = pytest.mark.skipif(NODE is None, reason=REASON)

ASKS = """
import { readFileSync } from "node:fs";
const messages = [];
globalThis.location = { protocol: "http:", host: "here" };
globalThis.requestAnimationFrame = (act) => setTimeout(act, 0);
globalThis.cancelAnimationFrame = clearTimeout;
globalThis.fetch = async (path, { body }) => {
  messages.push([path, JSON.parse(body)]);
  return new Response("{}");
};
const { server } = await import("./web/parts/server.js");
const { openSnapshot } = await import("./page/snapshot.js");
const { text, movement, question } = JSON.parse(readFileSync(0, "utf8"));
const snapshot = openSnapshot(text);
const states = [];
const following = snapshot.follow((message) => states.push(message.state));
const samples = movement.times.map((time, k) => [time, ...movement.positions[k]]);
following.reset();
following.push(samples.slice(0, 40));
following.push(samples.slice(40, 50));
await new Promise((done) => setTimeout(done, 20));
const sending = server.follow((message) => messages.push(["live", message]) > 0);
sending.push(samples.slice(0, 4));
await server.recognize(movement);
await server.generate(question);
const { times, positions } = snapshot.generate(question);
console.log(JSON.stringify({
  functions: [server, snapshot].map((backend) =>
    ["symbols", "recognize", "follow", "generate"].map((name) => typeof backend[name])),
  following: [sending, following].map((follower) => ["reset", "push", "finish"].map((name) => typeof follower[name])),
  states, messages, symbols: snapshot.symbols().map(({ id, name, path }) => [id, name, path.length]),
  answer: snapshot.recognize(movement), path: { times: [...times], positions }, ends: following.finish(),
}));
"""


def test_a_server_and_a_snapshot_take_the_same_questions(client, folder, tmp_path):
    root = Path(studio.__file__).parent
    for part in ("web", "page", "javascript"):
        shutil.copytree(root / part, tmp_path / part)
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "asks.js").write_text(ASKS)
    with ActionLibrary(folder, read_only=True) as library:
        text = snapshot_of_library(library, early=DRAWN).to_json()
        key = library["kind 2"].id
    movement = request_of(2)
    wish = {"goal": [2.0, 1.0], "start": [0.0, 0.0], "via": [[0.5, [1.0, 1.0]]], "formulation": "bio-inspired"}
    question = {"what": {"symbol": "kind 2"}, **wish}
    done = subprocess.run(
        [NODE, "asks.js"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
        input=json.dumps({"text": text, "movement": movement, "question": question}),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["functions"] == [["function"] * 4] * 2
    assert said["following"] == [["function"] * 3] * 2
    assert [symbol[:2] for symbol in said["symbols"]] == [[f"kind {k}"] * 2 for k in range(4)]
    assert said["messages"][1:] == [["/api/recognize", movement], ["/api/rollout", question]]
    (state,) = said["states"]  # of all samples until the next picture
    STATE.validate(state)
    assert (state["ranked"][0]["label"], said["ends"]) == ("kind 2", False)
    ANSWER.validate(said["answer"])
    served = client.post("/api/rollout", json={"what": {"symbol": key}, **wish}).json()
    path = np.array(said["path"]["positions"])
    share = np.array(said["path"]["times"]) / said["path"]["times"][-1]
    times = np.array(served["times"]) / served["times"][-1]
    expected = np.column_stack([np.interp(share, times, column) for column in np.transpose(served["positions"])])
    assert np.abs(path - expected).max() < 0.02 * np.ptp(expected, axis=0).max()
