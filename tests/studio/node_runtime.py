"""The JavaScript runtime, asked in node."""

from __future__ import annotations

import atexit
import json
import shutil
import subprocess
import tempfile
import threading
from functools import cache
from pathlib import Path

import numpy as np

from kineme.studio import javascript

RUNTIME = Path(javascript.__file__).parent / "runtime.js"
DRIVER = Path(__file__).with_name("runtime_in_node.mjs")
NODE = shutil.which("node")
REASON = "node is not installed"


@cache
def _node():
    """A node that answers until Python ends: to start one for each question would take longer than the answers."""
    pipe = subprocess.PIPE
    process = subprocess.Popen([NODE, DRIVER], stdin=pipe, stdout=pipe, text=True, encoding="utf-8")

    @atexit.register
    def end():
        process.communicate()

    return process


def ask(snapshot, questions, runtime=RUNTIME):
    """What the runtime answers to each question; an error is raised. Without a snapshot questions bring their own."""
    node = _node()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "questions.json"
        held = "null" if snapshot is None else snapshot.to_json()
        path.write_text(f'{{"snapshot": {held}, "questions": {json.dumps(questions)}}}')
        guard = threading.Timer(300, node.kill)
        guard.start()
        node.stdin.write(json.dumps([str(runtime), str(path)]) + "\n")
        node.stdin.flush()
        line = node.stdout.readline()
        guard.cancel()
    assert line, f"node ended with code {node.wait()}"
    answers = json.loads(line)
    assert "failed" not in answers, answers["failed"]
    for answer in answers:
        assert "error" not in answer, answer["error"]
    return [answer["answer"] for answer in answers]


PARSES = """import { readFileSync } from "node:fs";
import { SourceTextModule } from "node:vm";
const wrong = {};
for (const path of process.argv.slice(1)) {
  try { new SourceTextModule(readFileSync(path, "utf8")); } catch (error) { wrong[path] = String(error); }
}
console.log(JSON.stringify(wrong));"""


def in_node(program, *arguments, options=()):
    """What a module prints as JSON."""
    command = [NODE, *options, "--input-type=module", "-e", program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def unparsed(*paths):
    """The modules that do not parse, each with why."""
    return in_node(PARSES, *paths, options=["--experimental-vm-modules"])


def question(ask, movement, **more):
    """A question about a movement."""
    times, positions = np.asarray(movement.times), np.asarray(movement.positions)
    return {"ask": ask, "times": times.tolist(), "positions": positions.tolist(), **more}
