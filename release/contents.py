"""What must lie in a wheel and in a source archive, and nothing else."""

from __future__ import annotations

import subprocess
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Folders of the packages, and how much of their paths a wheel leaves out.
PACKAGES = {"src/kineme/": "src/", "experiments/kineme_experiments/": "experiments/"}
#: Beside the package, in the source archive.
BESIDE = {
    "CHANGELOG.md", "CITATION.cff", "LICENSE", "MANIFEST.in", "README.md", "SECURITY.md", "pyproject.toml",
}  # fmt: skip
#: What the build writes into a source archive.
WRITTEN = {"PKG-INFO", "setup.cfg"}
RECORDS = {"METADATA", "RECORD", "WHEEL", "entry_points.txt", "top_level.txt"}
LICENSES = {
    "LICENSE",
    "src/kineme/robots/models/NOTICE.txt",
    "src/kineme/robots/view/vendor/LICENSE-three.txt",
    "src/kineme/robots/view/vendor/LICENSE-urdf-loader.txt",
}


def tracked(under: str = "") -> set[str]:
    """Files that git tracks, and new ones that it does not ignore, as paths from the root."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", under or "."]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return {name for name in listed.split("\0") if name and (ROOT / name).is_file()}


def faults_of_wheel(wheel: Path) -> list[str]:
    """What is missing in a wheel or too much; [] if it holds the package, its licenses and its records."""
    records = "-".join(wheel.name.split("-")[:2]) + ".dist-info"
    wanted = {name.removeprefix(outer) for package, outer in PACKAGES.items() for name in tracked(package)}
    wanted |= {f"{records}/{name}" for name in RECORDS} | {f"{records}/licenses/{name}" for name in LICENSES}
    with zipfile.ZipFile(wheel) as archive:
        return _differences(wheel.name, set(archive.namelist()), wanted)


def faults_of_source(archive: Path) -> list[str]:
    """What is missing in a source archive or too much."""
    with tarfile.open(archive) as opened:
        held = {member.name.partition("/")[2] for member in opened.getmembers() if member.isfile()}
    held = {name for name in held if ".egg-info/" not in name}
    packages = set().union(*map(tracked, PACKAGES))
    return _differences(archive.name, held, packages | BESIDE | WRITTEN)


def _differences(name: str, held: set[str], wanted: set[str]) -> list[str]:
    missing = [f"{name}: {one} is missing" for one in sorted(wanted - held)]
    return missing + [f"{name}: {one} does not belong there" for one in sorted(held - wanted)]
