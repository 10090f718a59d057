"""Install the wheel into empty environments, far from the checkout, and walk through what a newcomer tries."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from release.contents import ROOT

STEPS = Path(__file__).with_name("steps")
#: Those that are installed together; the rest of the extras are resolved only.
TOGETHER = ("segmentation", "parquet", "mocap", "hdf5", "ros", "robot", "studio")


@dataclass(frozen=True)
class Fresh:
    """An empty environment in a folder of its own, where nothing of the checkout is seen."""

    folder: Path

    @classmethod
    def make(cls, python: str, folder: Path) -> Fresh:
        """Make one with that Python."""
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "work").mkdir(parents=True)
        made = cls(folder)
        made._call([python, "-m", "venv", folder / "environment"])
        return made

    def install(self, wheel: Path, extras: tuple[str, ...], lock: str, *more: str) -> None:
        """Install the wheel from its own metadata, at the versions of a lock file."""
        versions = self.folder / "versions.txt"
        pinned = re.findall(r"^[\w.-]+==[^\\\n]+", (ROOT / lock).read_text(encoding="utf-8"), re.MULTILINE)
        versions.write_text("\n".join(one.strip() for one in pinned), encoding="utf-8")
        wanted = f"kineme[{','.join(extras)}] @ {wheel.resolve().as_uri()}"
        self.run("python", "-m", "pip", "install", "--quiet", "--constraint", versions, *more, wanted)

    def run(self, program: str, *arguments: object) -> None:
        """Run a program of the environment in the empty folder; raises `subprocess.CalledProcessError` if it fails."""
        self._call([self.folder / "environment" / "bin" / program, *arguments])

    def step(self, name: str, *arguments: object) -> None:
        """Run one of the scripts in ``steps``, copied beside the work."""
        self.run("python", shutil.copy(STEPS / name, self.folder), *arguments)

    def _call(self, command: list[object]) -> None:
        seen = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
        subprocess.run([str(part) for part in command], cwd=self.folder / "work", env=seen, check=True)


def check_base(python: str, wheel: Path, folder: Path) -> None:
    """The package without extras: its version, the demonstration, and the page that it carries as its description."""
    fresh = Fresh.make(python, folder)
    fresh.install(wheel, (), "requirements/run.txt")
    fresh.run("python", "-m", "pip", "check")
    fresh.step("installed.py", wheel.name.split("-")[1])
    shutil.copy(ROOT / "docs" / "walk_through.py", folder)
    fresh.step("described.py")
    fresh.run("kineme", "reproduce", "--out", "out")
    fresh.step("demonstrated.py")
    fresh.install(wheel, TOGETHER, "requirements/dev.txt", "--dry-run")
    fresh.install(wheel, ("rivals",), "experiments/rivals.txt", "--dry-run")


def check_extras(python: str, wheel: Path, folder: Path) -> None:
    """All extras that users combine: recordings to a library, to a page, to an arm, to the studio."""
    fresh = Fresh.make(python, folder)
    fresh.install(wheel, TOGETHER, "requirements/dev.txt")
    fresh.run("python", "-m", "pip", "check")
    fresh.step("recordings.py")
    for line in (STEPS / "commands.txt").read_text(encoding="utf-8").splitlines():
        fresh.run(*line.split())
    fresh.step("served.py")
