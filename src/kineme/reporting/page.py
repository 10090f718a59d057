"""The style of all HTML reports: one page that needs no other file."""

from __future__ import annotations

import re
import sys
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from typing import Any

import numpy as np

from kineme.reporting.text import in_markup
from kineme.sampling import evenly_spaced
from kineme.validation import Array

_POINTS = 64  # of a thumbnail, at most

#: Colors that drawings inside a page take, too; pictures of files keep white paper in the dark.
_STYLE = """
:root { color-scheme: light dark; --text: #1a1a1a; --soft: #444; --page: #fff; --raised: #f3f6f9; --line: #ddd;
        --dot: #bbb; --blue: #0072b2; --orange: #d55e00; --purple: #cc79a7; --gray: #777; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e8ecef; --soft: #b4bcc4; --page: #14181c; --raised: #1d2329; --line: #3a424a; --dot: #626c76;
          --blue: #56b4e9; --orange: #f08a3c; --purple: #dc93ba; --gray: #8d969f; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--text); background: var(--page); max-width: 68rem;
       margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; margin-bottom: .3rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
.verdict { font-size: 1.15rem; max-width: 52rem; margin: .8rem 0; padding: .8rem 1.1rem; background: var(--raised);
           border-left: 4px solid var(--blue); border-radius: 4px; }
.verdict p { margin: .35rem 0; } .verdict p + p { font-size: 1rem; }
p.lead { color: var(--soft); margin-top: 0; max-width: 48rem; }
figure { margin: 1.6rem 0; overflow-x: auto; }
figcaption, figure p { color: var(--soft); font-size: .9rem; max-width: 52rem; }
img { max-width: 100%; height: auto; background: #fff; border-radius: 4px; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; white-space: nowrap; font-weight: 600; padding-bottom: .4rem; font-size: .95rem; }
th, td { padding: .28rem .7rem .28rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
thead th { border-bottom: 1.5px solid var(--text); } tbody th { font-weight: 500; }
@media (max-width: 40rem) {
  caption { white-space: normal; max-width: calc(100vw - 2rem); }
  th, td { padding-right: .4rem; }
}
footer { color: var(--soft); font-size: .85rem; margin-top: 3rem; padding-top: 1rem;
         border-top: 1px solid var(--line); }
"""


def thumbnail(path: Array) -> str:
    """Draw a path (T, d) as a small picture in the color of the text around it, with a dot where it starts.

    One dimension is drawn over the phase, more than two in the plane in which the path is widest. It has 64 points at
    most, so that a table of them stays small.
    """
    points = path[evenly_spaced(len(path), _POINTS)]
    if points.shape[1] == 1:
        points = np.column_stack((np.linspace(0.0, 1.0, len(points)), points / (np.ptp(points) or 1.0)))
    elif points.shape[1] > 2:
        from kineme.reporting.figures import principal_axes

        points = points @ principal_axes(points.T).T
    extent = np.ptp(points, axis=0)
    shown = np.array([1.0, -1.0]) * (points - points.min(axis=0) - 0.5 * extent) * (84.0 / (extent.max() or 1.0)) + 50.0
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in shown.tolist())
    return (
        '<svg width="48" height="48" viewBox="0 0 100 100" fill="none" stroke="currentColor" stroke-width="4" '
        f'aria-hidden="true"><path d="M{line}"/><circle cx="{shown[0, 0]:.1f}" cy="{shown[0, 1]:.1f}" r="6" '
        'fill="currentColor" stroke="none"/></svg>'
    )


def picture(svg: bytes, caption: str, head: str = "") -> str:
    """A figure element with the drawing inside; `head` stands before the visible caption."""
    return (
        f'<figure><img alt="{in_markup(caption)}" src="data:image/svg+xml;base64,{b64encode(svg).decode()}">'
        f"<figcaption>{in_markup(head + caption)}</figcaption></figure>"
    )


def inline(figure: Any, caption: str) -> str:
    """Return a figure that no one shows otherwise as markup, on white whatever the colors around it are."""
    from kineme.reporting.figures import encode_figure

    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close(figure)
    return picture(encode_figure(figure, "svg"), caption)


def filled(template: str, parts: dict[str, str], style: str, scripts: dict[str, str], allowed: str = "") -> str:
    """Fill the marks ``{{name}}`` of a page, whose policy allows its own scripts and style by their hashes, no more."""

    def hashed(text: str) -> str:
        return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"

    policy = (
        f"default-src 'none'; script-src {' '.join(map(hashed, scripts.values()))}; style-src {hashed(style)}; "
        f"{allowed}base-uri 'none'; form-action 'none'"
    )
    texts = {**parts, **scripts, "style": style, "policy": policy}
    return re.sub(r"\{\{(\w+)\}\}", lambda match: texts[match[1]], template)


def page(title: str, heading: str, verdict: Sequence[str], body: str, facts: dict[str, Any]) -> str:
    """Return an HTML document: the title of the browser's tab, a heading, what to think of it all, and how it was made.

    The sentences of `verdict` are paragraphs below the heading; the body should begin with a picture.
    """
    said = "".join(f"<p>{in_markup(sentence)}</p>" for sentence in verdict if sentence)
    listed = "; ".join(f"{in_markup(key)} {in_markup(value)}" for key, value in facts.items())
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{in_markup(title)}</title><style>{_STYLE}</style></head><body>
<h1>{in_markup(heading)}</h1>
<div class="verdict">{said}</div>
{body}
<footer>{listed}</footer>
</body></html>
"""
