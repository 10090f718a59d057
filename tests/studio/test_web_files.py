"""The files that the browser gets: modules that parse, short ones, no text read as markup, nothing from elsewhere."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

WEB = Path(__file__).parents[2] / "src" / "kineme" / "studio" / "web"
RUNTIME = WEB.parent / "javascript"
SCRIPTS = sorted(WEB.rglob("*.js"))
PAGES = sorted(WEB.glob("*.html"))
STYLES = sorted(WEB.glob("*.css"))
MAX_FILE = 300
NODE = shutil.which("node")


def _name(path):
    """Its path on the server."""
    return str(path.relative_to(WEB)) if path.is_relative_to(WEB) else f"runtime/{path.name}"


def _imported(path, source):
    """The file that a module names: the server shows the runtime as a folder of the page."""
    there = (path.parent / source).resolve()
    return RUNTIME / there.name if there.parent == WEB / "runtime" else there


def test_there_is_a_page_its_tokens_and_its_modules():
    assert {"index.html", "arm.html", "tokens.css", "style.css", "app.js"} <= {path.name for path in WEB.iterdir()}
    assert len(SCRIPTS) > 20


FINDING = """
import { found } from "./parts/find.js";
const described = (k) => ({ name: `Place it on shelf ${k}`, description: k === 3 ? "Careful" : null });
const symbols = Array.from({ length: 20 }, (_, k) => described(k));
const field = { value: "SHELF  17", hidden: true };
const names = (some) => some.map((one) => one.name);
const last = [names(found(field, symbols)), names(found({ value: "careful" }, symbols)), field.hidden];
console.log(JSON.stringify([...last, found(field, symbols.slice(0, 5)).length, field.value]));
"""


@pytest.mark.skipif(NODE is None, reason="node is not installed")
def test_symbols_are_found_by_words_where_there_are_many():
    asked = subprocess.run(
        [NODE, "--input-type=module"], input=FINDING, cwd=WEB, capture_output=True, text=True, check=True
    )
    assert json.loads(asked.stdout) == [["Place it on shelf 17"], ["Place it on shelf 3"], False, 5, ""]


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_a_module_parses(path):
    checked = subprocess.run(
        [NODE, "--input-type=module", "--check"], input=path.read_text(), capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_a_module_is_short_and_says_what_it_is_for(path):
    text = path.read_text()
    assert text.startswith("// ")
    assert len(text.splitlines()) <= MAX_FILE


@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_a_module_makes_no_markup_of_text_and_runs_no_text(path):
    assert not re.findall(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", path.read_text()
    )


@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_what_a_module_imports_is_there(path):
    text = path.read_text()
    for names, source in re.findall(r"^import \{?\s*([\w,\s*{}]+?)\s*\}? from \"([^\"]+)\";", text, re.MULTILINE):
        assert source.startswith("."), source
        there = _imported(path, source)
        assert there.is_file(), source
        for name in (one.strip() for one in names.split(",")):
            if name.startswith("* as "):
                continue
            assert re.search(rf"export (?:async )?(?:function|class|const|let) {name}\b", there.read_text()), (
                source,
                name,
            )
            assert len(re.findall(rf"\b{name}\b", text)) > 1, f"{name} is imported and not used"


def _reached(path, known):
    """All modules that one imports, and those that they import."""
    for source in re.findall(r' from "([^"]+)";', path.read_text()):
        there = _imported(path, source)
        if there not in known:
            known.add(there)
            _reached(there, known)
    return known


def test_the_page_loads_all_modules_at_once():
    """Not one after the other, as each is found in another: the first view comes sooner."""
    preloaded = re.findall(r'rel="modulepreload" href="/([^"]+)"', (WEB / "index.html").read_text())
    assert preloaded == sorted(_name(path) for path in _reached(WEB / "app.js", set()))


@pytest.mark.parametrize("path", PAGES, ids=_name)
def test_a_page_has_nothing_inline_that_its_policy_would_forbid(path):
    text = path.read_text()
    assert not re.findall(r"\sstyle=|\son\w+=|<style|javascript:", text)
    assert not re.findall(r"<script(?![^>]*\bsrc=)", text)


@pytest.mark.parametrize("path", PAGES + STYLES, ids=_name)
def test_nothing_is_asked_from_another_host(path):
    assert not re.findall(r"(?:https?:)?//[\w.-]+\.\w+|@import|url\(", path.read_text())


def test_every_id_is_one_elements_and_is_used():
    page = (WEB / "index.html").read_text()
    ids = re.findall(r'\sid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    wanted = {name for path in SCRIPTS for name in re.findall(r'byId\("([\w-]+)"\)', path.read_text())}
    known = {*ids, *re.findall(r'\sid="([^"]+)"', (WEB / "arm.html").read_text())}
    assert wanted - known <= {"data"}  # made by robot/arm.js


def test_only_the_tokens_know_colors():
    others = [path for path in STYLES if path.name != "tokens.css"]
    found = {_name(path): re.findall(r"#[0-9a-fA-F]{3,8}\b(?!\s*[{,:.>\[])", path.read_text()) for path in others}
    assert not {name: colors for name, colors in found.items() if colors}


def test_colors_of_the_figures_are_those_of_the_page():
    figures = pytest.importorskip("kineme.output.figures")
    tokens = (WEB / "tokens.css").read_text()
    for name in ("BLUE", "ORANGE", "GREEN", "PURPLE", "GRAY"):
        assert f"--{name.lower()}: {getattr(figures, name).lower()};" in tokens


def _luminance(color):
    parts = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _contrast(one, other):
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_what_it_is_on(scheme):
    """The contrast that WCAG 2.2 asks for: 4.5 of text, 3 of lines and borders that mean something."""
    light, dark = (WEB / "tokens.css").read_text().split("@media (prefers-color-scheme: dark)")
    colors = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", light))
    if scheme == "dark":
        colors |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", dark))
    for ground in ("page", "surface", "raised"):
        for text in ("text", "soft"):
            assert _contrast(colors[text], colors[ground]) >= 4.5, (text, ground)
    pairs = "on-accent accent, accent-strong accent-soft, accent-strong surface, text accent-soft, failed surface, "
    pairs += "failed failed-soft, passed surface, soft accent-soft, page text"
    for text, ground in (pair.split() for pair in pairs.split(", ")):
        assert _contrast(colors[text], colors[ground]) >= 4.5, (text, ground)
    for line in ("ink", "predicted", "goal", "edge", "accent"):
        assert _contrast(colors[line], colors["surface"]) >= 3, line
