"""The page of a library: one file that allows its own script and style alone, and never replaces another unasked."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from html import escape

import pytest
from click.testing import CliRunner

import kineme
from kineme.cli import main
from kineme.errors import KinemeError, SpecificationError
from kineme.studio.page.write_page import bundled, library_page
from movement_samples import draw_shapes

HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture
def library(tmp_path):
    demos = draw_shapes([2, 1])
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos, [HOSTILE if label.endswith("0") else "wave" for label in demos.labels])
        yield library


def parts(page, tag):
    return re.findall(rf"<{tag}[^>]*>(.*?)</{tag}>", page, re.DOTALL)


def hashed(text):
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def test_the_policy_allows_the_script_and_the_style_and_nothing_else(library):
    page, _ = library_page(library, "Two movements")
    data, script = parts(page, "script")
    (style,) = parts(page, "style")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules == {
        "default-src": "'none'",
        "script-src": hashed(script),
        "style-src": hashed(style),
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    assert not re.search(r"\sstyle=|\son\w+=|javascript:", re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL))
    assert set(json.loads(data)["classes"]) == {HOSTILE, "wave"}


def test_names_are_text(library):
    page, _ = library_page(library, HOSTILE)
    assert HOSTILE not in page
    assert page.count(escape(HOSTILE)) == 2  # title and heading


def test_nothing_is_requested_from_anywhere(library):
    page, _ = library_page(library, "t")
    assert not re.search(r"https?:|\bfetch\(|XMLHttpRequest|WebSocket|await import|\beval\(|new Function", page)


def test_the_script_is_one_without_imports_in_which_every_module_is_once(tmp_path):
    (tmp_path / "a.js").write_text(
        'import { b } from "./b.js";\nimport { C } from "./c.js";\nexport function a() { return b() + C; }\n'
    )
    (tmp_path / "b.js").write_text('import { C } from "./c.js";\nexport function b() { return C; }\n')
    (tmp_path / "c.js").write_text("export const C = 1;\n")
    text = bundled(tmp_path / "a.js")
    assert text.count("const C = 1;") == 1
    assert "import" not in text
    assert "export" not in text
    assert text.index("const C = 1") < text.index("function b") < text.index("function a")
    (tmp_path / "c.js").write_text("export default 1;\n")
    with pytest.raises(KinemeError, match=r"c\.js"):
        bundled(tmp_path / "a.js")


def test_the_command_writes_a_page_and_never_over_another(library, tmp_path):
    file = tmp_path / "actions.html"
    command = ["page", "--library", str(tmp_path / "actions"), "-o", str(file), "--title", "Ours"]
    done = CliRunner().invoke(main, [*command, "--json"])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said == {"file": str(file), "bytes": file.stat().st_size, "symbols": 2, "movements": 3, "of": 3}
    assert "<h1>Ours</h1>" in file.read_text()
    before = file.read_bytes()
    file.write_text("mine")
    refused = CliRunner().invoke(main, command)
    assert refused.exit_code == 2
    assert "--force" in refused.output
    assert file.read_text() == "mine"
    assert CliRunner().invoke(main, [*command, "--force"]).exit_code == 0
    assert file.read_bytes() == before
    done = CliRunner().invoke(main, [*command, "--force", "--json", "--most", "2"])
    assert json.loads(done.stdout)["movements"] == 2
    assert "2 of 3 movements" in file.read_text()
    assert [path.name for path in tmp_path.iterdir() if path.name != "actions"] == ["actions.html"]


def test_a_library_that_cannot_be_drawn_is_refused(tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_shapes([2, 2], d=4))
        with pytest.raises(SpecificationError, match="4 dimensions"):
            library_page(library, "t")


def test_an_empty_library_is_refused_and_nothing_is_written(tmp_path):
    kineme.ActionLibrary(tmp_path / "actions", create=True).close()
    command = ["page", "--library", str(tmp_path / "actions"), "-o", str(tmp_path / "a.html")]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 1
    assert "symbol" in done.output
    assert not (tmp_path / "a.html").exists()


def test_equal_libraries_give_equal_pages(library, tmp_path):
    assert library_page(library, "t")[0] == library_page(library, "t")[0]


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("nowhere/page.html", "expected a folder nowhere to write page.html into, there is none; create it"),
        ("file/page.html", "expected a folder file to write page.html into, a file of that name is there"),
        ("folder", "'folder' is a directory"),
        (f"{'x' * 300}.html", "the system refuses: file name too long; check its name"),
        (f"{'x' * 240}.html", "which is longer; choose a shorter one"),
        ("/proc/page.html", "expected to write /proc/page.html, the system refuses"),
    ],
)
def test_where_no_page_can_be_written_is_said_in_words(library, tmp_path, monkeypatch, where, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"")
    done = CliRunner().invoke(main, ["page", "-l", "actions", "-o", where])
    assert done.exit_code in {1, 2}
    assert words in done.stderr
    assert "[Errno" not in done.stderr
