"""Every script of the gallery runs without warnings and ends in a figure; the build of the documentation draws them."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from soaking import SOAK

ROOT = Path(__file__).parents[1]
FOLDERS = sorted(path for path in (ROOT / "examples").iterdir() if path.is_dir())
SCRIPTS = sorted((ROOT / "examples").rglob("plot_*.py"))

_RUN = """
import runpy, sys, time
import matplotlib
matplotlib.use("agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
for script in sys.argv[1:]:
    begun = time.process_time()
    names = runpy.run_path(script)
    figures = [plt.figure(n) for n in plt.get_fignums()] or [v for v in names.values() if isinstance(v, Figure)]
    print(f"{script}\\t{len(figures)}\\t{time.process_time() - begun:.1f}", file=sys.__stderr__, flush=True)
    plt.close("all")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the packages for arms have no wheels there")
def test_every_script_runs_without_warnings_and_draws():
    """In one process, as the build does; each reports to the standard error, so a failure is that of the next.

    `make test` runs the first script of each folder, `make soak` all.
    """
    scripts = SCRIPTS if SOAK else [sorted(folder.glob("plot_*.py"))[0] for folder in FOLDERS]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _RUN, *map(str, scripts)],
        capture_output=True, text=True, check=False, timeout=500, env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    figures = {line.split("\t")[0]: int(line.split("\t")[1]) for line in done.stderr.splitlines() if "\t" in line}
    assert set(figures) == set(map(str, scripts))
    assert min(figures.values()) >= 1


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_a_folder_has_a_header_and_several_scripts(folder):
    assert (folder / "GALLERY_HEADER.rst").read_text().splitlines()[1].startswith("---")
    assert len(list(folder.glob("plot_*.py"))) >= 2


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_says_what_it_shows_and_needs_no_network(path):
    text = path.read_text()
    title, rule, _ = ast.get_docstring(ast.parse(text)).split("\n", 2)
    assert len(title) == len(rule)
    assert set(rule) == {"="}
    code = [line for line in text.split('"""', 2)[2].splitlines() if line.strip() and not line.startswith("#")]
    assert len(code) <= 50
    assert not re.search(r"urllib|requests|https?://", text)
