"""Build wheel and source archive of the tracked files alone, and check metadata and contents."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from release.contents import ROOT, faults_of_source, faults_of_wheel, tracked


def build(target: Path) -> Path:
    """Write both archives into the folder; the path of the wheel. Exits with what is wrong, if anything is.

    The wheel is built from the source archive, so what the archive lacks is missing in the wheel too.
    """
    shutil.rmtree(target, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in tracked():
            copy = Path(folder) / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy)
        command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", target, folder]
        subprocess.run(
            command, check=True, env={**os.environ, "SOURCE_DATE_EPOCH": _last_change()}, stdout=subprocess.DEVNULL
        )
    (wheel,), (source,) = target.glob("*.whl"), target.glob("*.tar.gz")
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", wheel, source], check=True)
    if faults := faults_of_wheel(wheel) + faults_of_source(source):
        raise SystemExit("\n".join(faults))
    for path in (wheel, source):
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB, contents as expected")
    return wheel


def _last_change() -> str:
    """Seconds of the last commit: the same tree gives the same archives."""
    asked = ["git", "log", "-1", "--format=%ct"]
    return subprocess.run(asked, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
