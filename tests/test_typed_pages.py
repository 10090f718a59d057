"""What users write after the pages is complete to a type checker: ``mypy --strict`` passes on every page."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from walk_through import page_name, pages, text_from_the_beginning

ROOT = Path(__file__).parents[1]
PAGES = pages()
# Settings and results of the package's own check, so that none of it is read twice; pages also say what returns Any.
_OWN = re.search(
    r"(?ms)^\[tool\.mypy\]\n.*?(?=^\[tool\.(?!mypy))", (ROOT / "pyproject.toml").read_text(encoding="utf-8")
)[0]
_MORE = """
[[tool.mypy.overrides]]
module = ["mujoco.*"]
ignore_missing_imports = true

[[tool.mypy.overrides]]
module = {modules}
warn_return_any = true
"""

#: What comes back is a record, which an editor completes, and not Any.
RESULTS = """
import kineme
import numpy as np

demos = kineme.load_lasa()
movement: kineme.Trajectory = demos[0]
primitives: kineme.dmp.Primitives = kineme.DMP().learn(demos)
rollout: kineme.dmp.Rollout = primitives.rollout(goal=np.zeros(2))
cut: kineme.movements.Segmentation = kineme.segment(movement)
read: kineme.io.Recordings = kineme.read_recordings("recordings/")
recognizer = kineme.Recognizer().fit(read)
answer: kineme.recognition.Answer = recognizer.recognize(movement)
answers: list[kineme.recognition.Answer] = recognizer.recognize(demos)
for held in (demos, read, cut, rollout):
    many: kineme.Demonstrations = kineme.Demonstrations.of(held)
for array in (movement.positions, [movement.positions], [[0.0, 1.0, 2.0, 4.0]]):
    kineme.DMP().learn(array)
kineme.preprocess([cut, cut], [kineme.Smooth()])
kineme.DMP().learn([read, rollout, cut, movement, movement.positions])
rollout.plot().savefig("rollout.png")
rollout.plot(rollout.plot().axes[0]).set_title("rollout")
kineme.Recognizer().fit([read, rollout[0]])
kineme.preprocess([movement, movement], (kineme.TrimRest(), kineme.Resample(50)))
for taken in (demos, read, cut, rollout):
    recognizer.predict(taken)
with kineme.ActionLibrary("actions", create=True) as library:
    library.learn(read)
    reveal_type(library.recognize(movement))
chosen: kineme.DMP = kineme.DMP().choose(demos).dmp
between: kineme.dmp.Primitives = kineme.dmp.Contextual().fit(demos, parameters=np.arange(7.0)).primitive(0.5)
better: kineme.dmp.Improvement = kineme.improve(primitives[:1], lambda rollout: rollout.positions[:, -1, 0])
passing: kineme.styles.AveragePrimitive = kineme.styles.average(primitives).condition(t=0.5, position=[0.0, 1.0])
reveal_type(recognizer.spot(movement))
reveal_type(recognizer.stream().update(0.0, [0.0, 0.0]))
reveal_type(kineme.anchoring.propose(demos))
for proposal in kineme.anchoring.propose(demos):
    reveal_type(proposal)
reveal_type(primitives.controller(0.01))
"""


def _module(page):
    """The name of the module that a page becomes."""
    return f"{re.sub('[^a-z0-9]', '_', page_name(page).lower().removesuffix('.md'))}_page"


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """Lines of mypy about each page, by its name; all pages in one run."""
    folder = tmp_path_factory.mktemp("pages")
    modules = [_module(page) for page in PAGES]
    for page, module in zip(PAGES, modules, strict=True):
        blocks = re.findall(r"```python\n(.*?)```", text_from_the_beginning(page), re.DOTALL)
        (folder / f"{module}.py").write_text("\n".join(blocks), encoding="utf-8")
    (folder / "results.py").write_text(RESULTS)
    settings = folder / "pyproject.toml"
    settings.write_text(_OWN + _MORE.format(modules=json.dumps([*modules, "results"])), encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", settings, "--cache-dir", Path(sys.prefix) / "mypy"]
    if np.lib.NumpyVersion(np.__version__) < "2.2.0":
        command += ["--disable-error-code", "type-arg"]  # its ndarray names no type of elements by itself
    done = subprocess.run(
        [*command, *sorted(folder.glob("*.py"))],
        capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, "MYPYPATH": str(folder)},
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    # Messages that mypy kept of equal files name the folder of that run.
    return [re.sub(r"^\S*[/\\](?=(?:\w+_page|results)\.py:)", "", line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_the_python_of_pages_passes(checked, page):
    assert not [line for line in checked if line.startswith(f"{_module(page)}.py") and "error" in line]


def test_results_are_records_and_not_any(checked):
    about = [line for line in checked if line.startswith("results.py")]
    assert not [line for line in about if "error" in line]
    revealed = [line.partition('Revealed type is "')[2].rstrip('"') for line in about if "Revealed" in line]
    assert len(revealed) == RESULTS.count("reveal_type")
    assert not [one for one in revealed if "kineme." not in one]  # Any, list[Any]


def test_nothing_else_is_wrong(checked):
    assert not [line for line in checked if "error" in line and not re.match(r"\w+_page\.py|results\.py|Found ", line)]
