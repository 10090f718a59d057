"""Write the interactive figure of the concepts: its two matrices, its style and its script, as one piece of HTML.

The build of the site writes ``docs/concepts/interactive/primitive.html``, which the page includes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import kineme
from kineme.dmp.discrete.operators import decoder, encoder

FOLDER = Path(__file__).parent / "concepts" / "interactive"
N_BASIS, N_POINTS = 10, 81
FORMULATIONS = ("bio-inspired", "original")
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
