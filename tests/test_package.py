"""What is published: every data file in the wheel, one version, a citation and a changelog in the usual form."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

import kineme

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _tracked(under):
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: what belongs to the package is not known")
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", under]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {name for name in listed.split("\0") if name and (ROOT / name).is_file()}


def test_the_wheel_holds_every_file_of_the_package():
    """`make package` looks into the wheel itself; this finds a forgotten glob without building."""
    package = ROOT / "src" / "kineme"
    globs = PYPROJECT["tool"]["setuptools"]["package-data"]["kineme"]
    matched = {path for glob in globs for path in package.glob(glob)}
    data = {ROOT / name for name in _tracked("src/kineme") if not name.endswith(".py")}
    assert {str(path.relative_to(package)) for path in data - matched} == set()
    assert all(list(package.glob(glob)) for glob in globs)
    folders = {path.parent for path in package.rglob("*.py")}
    assert [str(one) for one in folders if not (one / "__init__.py").is_file()] == []


def test_licenses_of_what_was_taken_over_are_in_the_wheel():
    named = {path for glob in PYPROJECT["project"]["license-files"] for path in ROOT.glob(glob)}
    words = ("LICENSE", "NOTICE", "COPYING")
    assert named == {ROOT / name for name in _tracked(".") if Path(name).name.startswith(words)}


def test_the_version_stands_in_one_place():
    assert PYPROJECT["project"]["dynamic"] == ["version"]
    assert PYPROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "kineme.__version__"}
    assert re.fullmatch(r"\d+\.\d+\.\d+", kineme.__version__)
    assert _citation()["version"] == kineme.__version__


def test_addresses_of_the_project_are_not_made_up():
    """There is none yet; whoever adds one adds it here, having opened it."""
    assert "urls" not in PYPROJECT["project"]


def _citation():
    from ruamel.yaml import YAML

    return YAML(typ="safe").load(ROOT / "CITATION.cff")


def test_the_citation_can_be_read_by_machines():
    cited = _citation()
    assert cited["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= cited.keys()  # what the format requires
    assert cited["license"] == PYPROJECT["project"]["license"].split(" AND ")[0]  # several would mean: any of them
    assert [author["name"] for author in cited["authors"]] == [one["name"] for one in PYPROJECT["project"]["authors"]]
    assert cited["keywords"] == PYPROJECT["project"]["keywords"]
    for reference in cited["references"]:
        assert {"type", "title", "authors"} <= reference.keys()


KINDS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]


def test_the_changelog_has_the_usual_form():
    """Keep a Changelog: releases in square brackets, the newest first, and in each the kinds of changes in order."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    releases = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
    heads = [release.partition("\n")[0] for release in releases]
    assert heads[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", head) for head in heads[1:])
    for release in releases:
        kinds = re.findall(r"^### (.*)$", release, re.MULTILINE)
        assert kinds == [kind for kind in KINDS if kind in kinds]
