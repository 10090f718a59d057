"""Write what can be used within the pages: the interactive figure of the concepts, and the page to draw in.

The figure is one piece of HTML: its two matrices, its style and its script. The build of the site writes it as
``docs/concepts/interactive/primitive.html``, which the page includes. The page to draw in is one that `kineme page`
writes, of some letters; the build adds it to the site, and the first page shows it.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import kineme
from kineme.dmp.discrete.operators import decoder, encoder
from kineme.studio.page.write_page import page_of
from kineme.studio.snapshot import DRAWN, snapshot_of_library

FOLDER = Path(__file__).parent / "concepts" / "interactive"
N_BASIS, N_POINTS = 10, 81
FORMULATIONS = ("bio-inspired", "original")
#: Shapes of LASA that are letters -> these, and how many demonstrations of each the page to draw in holds.
LETTERS = {
    "CShape": "C", "GShape": "G", "JShape": "J", "NShape": "N", "PShape": "P", "Sshape": "S",
    "WShape": "W", "Zshape": "Z",
}  # fmt: skip
N_SHOWN = 3
_CONTROLS = """\
<div class="controls">
<label>time <input type="range" min="0" value="0" step="1"></label>
<label>formulation <select><option>bio-inspired</option><option>original</option></select></label>
<button type="button" data-act="spring">the spring alone</button>
<button type="button" data-act="again">as it was shown</button>
</div>
<p class="said">Drag the star or a bar, or draw a movement of your own: the encode matrix learns it as you lift the
pen. With the keyboard: Tab to the star or a bar, then the arrow keys; Home makes a weight 0. Arrows at the dot,
half as long as the terms over K are: the goal-attractor (green) and the shape-attractor (orange, dashed).</p>
"""


def matrices() -> dict[str, Any]:
    """What the script computes with; weights are over K, so that they are in the unit of the path."""
    K = kineme.DMP().K
    made: dict[str, Any] = {"n": N_BASIS, "formulations": {}}
    for name in FORMULATIONS:
        dmp = kineme.DMP(name, n_basis=N_BASIS, n_points=N_POINTS)
        response, fitted = decoder(dmp, N_POINTS), encoder(dmp, N_POINTS)
        made |= {"alpha": dmp.basis.phase.alpha, "overlap": dmp.overlap}
        made |= {"Phi": _rounded(K * response.Phi[0]), "velocity": _rounded(response.velocity[0])}
        rows = np.vstack((fitted.weights.T / K, fitted.velocity))
        made["formulations"][name] = {"encode": _rounded(rows), "goal": _rounded(response.goal[0])}
    demo = kineme.load_lasa(["GShape"])[0]
    even = np.linspace(0, len(demo) - 1, N_POINTS).round().astype(int)
    made["shown"] = _rounded(demo.positions[even].T, 4)
    return made


def _rounded(array: np.ndarray, digits: int = 6) -> list[Any]:
    return [_rounded(row, digits) for row in array] if array.ndim > 1 else [float(f"{x:.{digits}g}") for x in array]


def html(made: dict[str, Any]) -> str:
    """The figure: hidden until its script has run."""
    style, script = ((FOLDER / f"primitive.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    data = json.dumps(made, separators=(",", ":"))
    return (
        f'<style>\n{style}</style>\n<div class="primitive" hidden>\n<div class="drawings"></div>\n{_CONTROLS}'
        f'<script type="application/json">{data}</script>\n</div>\n<script>\n{script}</script>\n'
    )


def write(path: Path = FOLDER / "primitive.html") -> None:
    """Write the figure; one that is the same is left alone, so that its page is not read again."""
    text = html(matrices())
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def pages_to_draw_in() -> dict[str, str]:
    """File name -> the page that recognizes and moves `LETTERS`, to stand within another one: no head, foot, options.

    There is one by light and one in the dark: a page within another one cannot know which of them its reader chose.
    """
    demos = kineme.load_lasa(list(LETTERS))
    shown = demos[np.arange(len(demos)) % (len(demos) // len(LETTERS)) < N_SHOWN]
    with TemporaryDirectory() as folder, kineme.ActionLibrary(Path(folder) / "letters", create=True) as library:
        library.learn(shown, [LETTERS[label] for label in shown.labels])
        snapshot = snapshot_of_library(library, None, DRAWN)
    tokens = (files("kineme.studio") / "web" / "tokens.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root \{[^}]*--page:[^}]*\}", tokens)
    rules = (FOLDER / "draw.css").read_text(encoding="utf-8")
    page = page_of(snapshot, "Draw a letter")
    return {
        f"draw-{scheme}.html": _styled(page, f"{colors}\n:root {{ color-scheme: {scheme}; }}\n{rules}")
        for scheme, colors in (("light", light), ("dark", dark))
    }


def _styled(page: str, rules: str) -> str:
    """Add rules to the style of a page, whose policy allows that style by its hash."""
    style = page.partition("<style>")[2].partition("</style>")[0]
    before, after = (b64encode(sha256(text.encode()).digest()).decode() for text in (style, style + rules))
    return page.replace(before, after).replace(f"<style>{style}</style>", f"<style>{style}{rules}</style>")
