"""The JavaScript runtime, asked in node."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from kineme.studio import javascript

RUNTIME = Path(javascript.__file__).parent / "runtime.js"
DRIVER = Path(__file__).with_name("runtime_in_node.mjs")
NODE = shutil.which("node")
REASON = "node is not installed"


def ask(snapshot, questions, runtime=RUNTIME):
    """What the runtime answers to each question; an error is raised. Without a snapshot questions bring their own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "questions.json"
        held = "null" if snapshot is None else snapshot.to_json()
        path.write_text(f'{{"snapshot": {held}, "questions": {json.dumps(questions)}}}')
        done = subprocess.run([NODE, DRIVER, runtime, path], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    answers = json.loads(done.stdout)
    for answer in answers:
        assert "error" not in answer, answer["error"]
    return [answer["answer"] for answer in answers]


def question(ask, movement, **more):
    """A question about a movement."""
    times, positions = np.asarray(movement.times), np.asarray(movement.positions)
    return {"ask": ask, "times": times.tolist(), "positions": positions.tolist(), **more}
