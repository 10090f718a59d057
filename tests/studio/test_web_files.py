"""The files that the browser gets: modules that parse, short ones, no text read as markup, nothing from elsewhere."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from node_runtime import NODE, REASON, in_node, unparsed

from kineme.reporting import colors

WEB = Path(__file__).parents[2] / "src" / "kineme" / "studio" / "web"
RUNTIME = WEB.parent / "javascript"
PAGE = WEB.parent / "page"
SCRIPTS = sorted(WEB.rglob("*.js"))
PAGES = sorted(WEB.glob("*.html"))
STYLES = sorted(WEB.glob("*.css"))
MAX_FILE, MAX_LINE = 400, 120
MOST_BYTES = 341_082  # of all JavaScript of the studio
needs_node = pytest.mark.skipif(NODE is None, reason=REASON)


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
import { matching } from "./parts/find.js";
const described = (k) => ({ name: `Place it on shelf ${k}`, description: k === 3 ? "Careful" : null });
const symbols = Array.from({ length: 20 }, (_, k) => described(k));
const field = { value: "SHELF  17", hidden: true };
const names = (some) => some.map((symbol) => symbol.name);
const last = [names(matching(field, symbols)), names(matching({ value: "careful" }, symbols)), field.hidden];
console.log(JSON.stringify([...last, matching(field, symbols.slice(0, 5)).length, field.value]));
"""


@needs_node
def test_every_module_parses(tmp_path):
    (tmp_path / "wrong.js").write_text("export const = 1;")
    assert list(unparsed(tmp_path / "wrong.js", *SCRIPTS)) == [str(tmp_path / "wrong.js")]


@pytest.fixture
def modules(tmp_path):
    """The modules where node knows them as such."""
    folder = shutil.copytree(WEB, tmp_path / "web")
    (folder / "package.json").write_text('{"type": "module"}')
    shutil.copytree(RUNTIME, folder / "runtime")
    return folder


HEIGHTS = """const [folder, ...libraries] = process.argv.slice(1);
const { refresh } = await import(`${folder}/parts/library_state.js`);
const { canvasHeight } = await import(`${folder}/draw/scale.js`);
const heights = [];
for (const [version, symbols] of libraries.entries()) {
  globalThis.fetch = async () => new Response(`{"version": ${version + 1}, "symbols": ${symbols}}`);
  await refresh();
  heights.push(canvasHeight());
}
console.log(JSON.stringify(heights));"""


@needs_node
def test_the_canvas_is_as_high_as_the_movements_of_the_library_in_powers_of_ten(modules):
    sides = [[], [1.0], [0.3], [40.0], [0.002], [40.0, 50.0, 1e6], [0.0, 40.0], [1.7], [1.8]]
    symbols = [[{"path": [[3, 5], [3 + side, 5 + side / 2]]} for side in several] for several in sides]
    for several in symbols:
        several.append({"path": None})
    symbols[6][0]["path"] = [[3, 5], [3, 5]]  # it does not move
    heights = in_node(HEIGHTS, modules, *map(json.dumps, symbols))
    assert heights == [1, 1, 1, 100, 0.01, 100, 100, 1, 10]


FACING = """const [folder, ...several] = process.argv.slice(1);
const { facing } = await import(`${folder}/parts/facing.js`);
const views = several.map((path) => facing([JSON.parse(path)]));
console.log(JSON.stringify(views.map(({ around, above }) => [around, above])));"""


@needs_node
def test_movements_in_space_are_seen_from_the_front_where_they_are_flat(modules):
    u = np.linspace(0, 6, 64)
    wave = np.column_stack((u, 2 * np.sin(u), 0.1 * np.cos(u)))
    knot = np.column_stack((np.cos(u), np.sin(u), np.sin(2 * u)))
    paths = [wave, wave[:, [0, 2, 1]], wave[:, [2, 0, 1]], knot]  # on a table, a wall, the wall beside it, none
    seen = in_node(FACING, modules, *(json.dumps(path.tolist()) for path in paths))
    np.testing.assert_allclose(seen, [[0, np.pi / 2], [0, 0], [np.pi / 2, 0], [-0.6, 0.5]])


SENDS = """const { Sending } = await import(`${process.argv[1]}/parts/sending.js`);
let [here, sent] = [true, []];
const what = (message) => message.samples ?? Object.keys(message)[0];
const sending = new Sending((message) => here && sent.push(what(message)) > 0);
const samples = (from, to) => Array.from({ length: to - from }, (_, k) => [from + k]);
const said = () => sent.splice(0).map((rows) => (typeof rows === "string" ? rows : [rows[0][0], rows.at(-1)[0]]));
const log = {};
sending.reset();
sending.push(samples(0, 10));
sending.push(samples(10, 20)); // waits for the answer to the first
log.first = said();
here = false; // while it is drawn
sending.push(samples(20, 30));
here = true;
sending.renewed();
sending.push(samples(30, 7000));
sending.heard();
sending.finish();
sending.heard();
log.again = said();
sending.renewed(); // after its end, before the answer
sending.heard();
sending.heard();
log.requests = said();
log.wanted = sending.answered();
sending.renewed();
log.answered = said();
const draw = (from, to) => (sending.reset(), sending.push(samples(from, to)));
draw(0, 5);
sending.finish();
sending.heard();
draw(5, 9);
sending.heard();
sending.finish();
log.answers = [sending.answered(), sending.answered()]; // the first is to the movement before
draw(0, 5);
draw(5, 9); // before the state of the one before came
log.stale = [sending.heard(), sending.heard()];
draw(0, 5);
here = false;
sending.lost();
log.hears = sending.finish(); // though no answer came to the samples
console.log(JSON.stringify(log));"""


@needs_node
def test_a_movement_is_sent_from_its_beginning_where_the_connection_is_new(modules):
    assert in_node(SENDS, modules) == {
        "first": ["reset", [0, 9]],
        "again": [[0, 29], [30, 5029], [5030, 6999]],
        "requests": [[0, 4999], [5000, 6999], "finish"],
        "wanted": True,
        "answered": [],
        "answers": [False, True],
        "stale": [False, True],
        "hears": False,
    }


REFRESHES = """const { library, onLibrary, refresh } = await import(`${process.argv[1]}/parts/library_state.js`);
let [version, requests, fails, tag] = [1, 0, false, null];
const log = [];
onLibrary((state) => log.push(state.version));
globalThis.fetch = async (path, { headers }) => {
  const [now, refused] = [version, fails];
  requests += 1;
  if (tag && headers?.["If-None-Match"] === tag) return new Response(null, { status: 304 });
  await new Promise((done) => setTimeout(done, 5));
  if (refused) return new Response('{"error": "busy"}', { status: 503 });
  return new Response(`{"version": ${now}, "symbols": []}`, { headers: tag ? { ETag: tag } : {} });
};
const first = refresh();
await Promise.resolve();
version = 2;
const seen = (await Promise.all([first, refresh(), refresh()])).map((library) => library.version);
fails = true;
const failing = refresh().catch((error) => error.message);
await Promise.resolve();
[fails, version] = [false, 3];
const after = (await refresh()).version;
tag = "for reading only"; // the studio was started anew: another answer about the same version
await refresh();
await refresh();
console.log(JSON.stringify({ seen, requests, log, refused: await failing, after, now: library().version }));"""


FOLLOWED = """const { Rollouts, primitiveOf } = await import(`${process.argv[1]}/move/rollouts.js`);
const requests = [];
globalThis.fetch = (path, { body }) => {
  const { what } = JSON.parse(body);
  return new Promise((answer) => requests.push({ path, what: what.symbol, answer }));
};
const said = async (request, body, status = 200) => {
  request.answer(new Response(JSON.stringify(body), { status }));
  await new Promise((done) => setTimeout(done, 5));
};
const plan = (symbol) => ({ symbol, start: [0], goal: [1], usual: 1, share: 1, style: null, via: [], obstacles: [] });
const seen = [];
const rollouts = new Rollouts("original", () => seen.push(rollouts.path?.of ?? rollouts.problem));
rollouts.follow(plan("old"));
rollouts.reset();
rollouts.follow(plan("new"));
await said(requests[0], { of: "old" });
await said(requests[1], { of: "new" });
rollouts.follow(plan("newer"));
rollouts.reset();
await said(requests[2], { error: "of newer" }, 400);
const primitives = ["first", "second", "third"].map(() => null);
for (const k of [0, 1, 2]) {
  const primitive = primitiveOf({ symbol: "one" }, "original", 1);
  if (requests[3 + k]) await said(requests[3 + k], k ? null : { error: "away" }, k ? 200 : 503);
  primitives[k] = await primitive;
}
console.log(JSON.stringify({ requests: requests.map(({ path, what }) => `${path} ${what}`), seen, primitives }));"""


@needs_node
def test_what_moves_is_never_the_path_of_another_movement_and_what_failed_is_asked_again(modules):
    moves, primitives = "/api/rollout", "/api/primitive"
    assert in_node(FOLLOWED, modules) == {
        "requests": [f"{moves} old", f"{moves} new", f"{moves} newer", f"{primitives} one", f"{primitives} one"],
        "seen": ["new"],
        "primitives": [None, None, None],
    }


BROKEN = """globalThis.document = { createElement: () => "|" };
const { breakable } = await import(`${process.argv[1]}/parts/elements.js`);
console.log(JSON.stringify(process.argv.slice(2).map((name) => breakable(name).join(""))));"""


@needs_node
def test_names_break_where_their_words_meet(modules):
    names = ["Double|Bended|Line", "pick_|and_|place", "GShape", "step-|2/|b", "a b", "x" * 190, "", "-"]
    assert in_node(BROKEN, modules, *(name.replace("|", "") for name in names)) == names


NAMED = """const [folder, n] = process.argv.slice(1);
globalThis.window = { matchMedia: () => ({ addEventListener() {} }) };
globalThis.document = {};
globalThis.getComputedStyle = () => ({ getPropertyValue: () => "" });
const symbols = Array.from({ length: n }, (_, k) => ({ id: `${k}`, name: `kind ${k}` }));
globalThis.fetch = async () => new Response(JSON.stringify({ version: 1, symbols }));
await (await import(`${folder}/parts/library_state.js`)).refresh();
const { MovementMap } = await import(`${folder}/library/map.js`);
const drawn = [];
const context = {
  measureText: () => ({ width: 40 }),
  strokeText() {},
  fillText: (text, x, y) => drawn.push([text, x, y, context.globalAlpha]),
};
const points = symbols.map(({ id }) => ({ symbol: id }));
const board = { context, width: 800, height: 400 };
const map = Object.assign(Object.create(MovementMap.prototype), { points, at: -1, board });
const pixels = symbols.map((_, k) => [30 + ((k * 37) % 740), 30 + ((k * 61) % 340)]);
map.names(pixels);
const all = drawn.splice(0);
map.at = n - 1;
map.names(pixels);
console.log(JSON.stringify([all, drawn.at(-1), pixels]));"""


@needs_node
def test_a_map_of_many_symbols_has_the_names_that_fit_and_the_one_that_is_pointed_at(modules):
    names, pointed, dots = in_node(NAMED, modules, 100)
    assert len(names) > 20
    at = np.array([name[1:3] for name in names])
    apart = np.abs(at[:, None] - at) >= [40, 15]
    assert (apart.any(axis=2) | np.eye(len(at), dtype=bool)).all()
    assert (np.abs(at[:, None] - [0, 4] - dots) >= [20, 9]).any(axis=2).all()  # no name covers a dot
    assert (pointed[0], pointed[3]) == ("kind 99", 1)


REPLAYED = """const frames = [];
globalThis.window = { matchMedia: () => ({ addEventListener() {} }) };
globalThis.ResizeObserver = class { observe() {} };
globalThis.requestAnimationFrame = (step) => frames.push(step);
const { Picture } = await import(`${process.argv[1]}/draw/picture.js`);
const picture = new Picture({ getContext: () => null });
picture.ink = [[0, 0, 0], [1, 1, 1]];
picture.replay();
picture.replay();
const now = performance.now();
for (const step of frames.splice(0)) step(now + 400);
const [left, shown] = [frames.length, picture.replayed];
frames[0](now + 2000);
console.log(JSON.stringify([left, shown > 0.3 && shown < 0.5, picture.replayed, frames.length]));"""


@needs_node
def test_a_replay_that_begins_anew_is_the_only_one(modules):
    assert in_node(REPLAYED, modules) == [1, True, None, 1]


@needs_node
def test_what_is_asked_after_a_change_is_answered_with_that_change(modules):
    assert in_node(REFRESHES, modules) == {
        "seen": [1, 2, 2],
        "requests": 6,
        "log": [1, 2, 3, 3],
        "refused": "busy",
        "after": 3,
        "now": 3,
    }


@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_a_module_is_short_and_says_what_it_is_for(path):
    text = path.read_text()
    assert text.startswith("// ")
    assert len(text.splitlines()) <= MAX_FILE
    assert [line for line in text.splitlines() if len(line) > MAX_LINE] == []


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
        for name in (part.strip() for part in names.split(",")):
            if name.startswith("* as "):
                continue
            assert re.search(rf"export (?:async )?(?:function|class|const|let) {name}\b", there.read_text()), (
                source,
                name,
            )
            assert len(re.findall(rf"\b{name}\b", text)) > 1, f"{name} is imported and not used"


@pytest.mark.parametrize("path", SCRIPTS, ids=_name)
def test_a_view_knows_no_other_view(path):
    """What views share lies in `parts`, which knows none of them."""
    own = path.parent
    if own == WEB:  # the start knows all
        return
    others = {_imported(path, source).parent for source in re.findall(r' from "([^"]+)";', path.read_text())}
    assert others <= {own, WEB / "parts", RUNTIME}


def _reached(path, modules):
    """All modules that one imports, and those that they import."""
    for source in re.findall(r' from "([^"]+)";', path.read_text()):
        there = _imported(path, source)
        if there not in modules:
            modules.add(there)
            _reached(there, modules)
    return modules


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


def _statements_that_find_elements():
    """Statements of scripts that name elements by their ids, also as a list; the viewer of arms runs in `arm.html`."""
    viewer = WEB.parents[1] / "robots" / "view" / "page" / "viewer.js"
    return [
        statement for path in (*SCRIPTS, viewer) for statement in path.read_text().split(";") if "byId" in statement
    ]


def test_every_id_is_one_elements_and_is_used():
    pages = [path.read_text() for path in PAGES]
    ids = [re.findall(r'\sid="([^"]+)"', page) for page in pages]
    assert all(len(listed) == len(set(listed)) for listed in ids)
    wanted = {name for path in SCRIPTS for name in re.findall(r'byId\("([\w-]+)"\)', path.read_text())}
    assert wanted - {name for listed in ids for name in listed} <= {"data"}  # made by robot/arm.js
    views = json.loads(re.search(r"VIEWS = (\[.*?\])", (WEB / "parts" / "views.js").read_text())[1])
    used = {f"{part}-{view}" for part in ("tab", "view") for view in views}
    used |= {name for statement in _statements_that_find_elements() for name in re.findall(r'"([\w-]+)"', statement)}
    used |= {name for path in STYLES for name in re.findall(r"#([\w-]+)", path.read_text())}
    naming = r'\s(?:aria-\w+|for|list)="([^"]+)"'
    used |= {name for page in pages for several in re.findall(naming, page) for name in several.split()}
    assert [name for listed in ids for name in listed if name not in used] == []


def test_types_of_elements_by_their_ids_are_those_of_the_pages():
    """The table by which the type checker knows what `byId` gives."""
    table = (WEB.parent / "types.d.ts").read_text().partition("type ElementOf")[0]
    records = re.findall(r"Record<([^>]*),\s*HTML(\w+)Element", table)
    kinds = {name: kind for names, kind in records for name in re.findall(r'"([\w-]+)"', names)}
    assert len(kinds) > 80
    tags = [
        (name, tag)
        for page in (*PAGES, *PAGE.glob("*.html"))
        for tag, name in re.findall(r'<(\w+)\b[^>]*?\sid="([^"]+)"', page.read_text())
    ]
    assert {name for name, _ in tags} >= kinds.keys()
    assert [name for name, tag in tags if kinds.get(name, tag).lower() != tag] == []


def test_what_a_module_exports_is_imported():
    every = {path: path.read_text() for path in (*SCRIPTS, *sorted(RUNTIME.glob("*.js")), *sorted(PAGE.glob("*.js")))}
    exported = {
        (path.name, name)
        for path, text in every.items()
        for name in re.findall(r"^export (?:async )?(?:function|class|const) (\w+)", text, re.MULTILINE)
        if not any(re.search(rf"\b{name}\b", other) for there, other in every.items() if there != path)
    }
    assert not exported


def test_the_scripts_of_the_studio_are_no_larger_than_they_must_be():
    assert sum(path.stat().st_size for path in WEB.parent.rglob("*.js")) <= MOST_BYTES


def test_only_the_tokens_know_colors():
    others = [path for path in STYLES if path.name != "tokens.css"]
    literals = {_name(path): re.findall(r"#[0-9a-fA-F]{3,8}\b(?!\s*[{,:.>\[])", path.read_text()) for path in others}
    assert not {name: colors for name, colors in literals.items() if colors}


def test_the_dark_scheme_is_other_tokens_and_nothing_else():
    """So the views lie as they do in the light one."""
    assert [path.name for path in STYLES if "prefers-color-scheme" in path.read_text()] == ["tokens.css"]
    dark = (WEB / "tokens.css").read_text().partition("(prefers-color-scheme: dark)")[2].partition("@media")[0]
    names = re.findall(r"^ +([\w-]+):", dark, re.MULTILINE)
    assert names
    assert all(name.startswith("--") for name in names)


def test_colors_of_the_figures_are_those_of_the_page():
    tokens = (WEB / "tokens.css").read_text()
    for name in ("BLUE", "ORANGE", "GREEN", "PURPLE", "GRAY"):
        assert f"--{name.lower()}: {getattr(colors, name).lower()};" in tokens


def _luminance(color):
    parts = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _contrast(color, other):
    light, dark = sorted((_luminance(color), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


ON_COLORS = """
const { readableOn } = await import(`${process.argv[1]}/parts/lines.js`);
console.log(JSON.stringify(process.argv.slice(2).map((hex) => readableOn(hex))));"""


@needs_node
def test_names_of_spans_stand_out_from_their_colors(modules):
    tokens = (WEB / "tokens.css").read_text()
    colors = dict(re.findall(r"--(blue|orange|green|purple|sky|amber): (#[0-9a-f]{6});", tokens))
    for paint, text in zip(colors.values(), in_node(ON_COLORS, modules, *colors.values()), strict=True):
        assert _contrast(paint, text[0] + 2 * text[1:]) >= 4.5, (paint, text)


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
