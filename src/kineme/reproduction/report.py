"""The report: one self-contained HTML file."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from typing import Any

from kineme.reproduction.table import Table, to_html

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 68rem;
       margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; margin-bottom: .3rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
p.lead { color: #444; margin-top: 0; max-width: 48rem; }
figure { margin: 1.6rem 0; overflow-x: auto; } figcaption, figure p { color: #444; font-size: .9rem; max-width: 52rem; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; white-space: nowrap; font-weight: 600; padding-bottom: .4rem; font-size: .95rem; }
th, td { padding: .28rem .7rem .28rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #e3e3e3; }
thead th { border-bottom: 1.5px solid #1a1a1a; } tbody th { font-weight: 500; }
footer { color: #555; font-size: .85rem; margin-top: 3rem; border-top: 1px solid #ddd; padding-top: 1rem; }
"""


def write_report(tables: list[Table], figures: dict[str, tuple[str, bytes]], facts: dict[str, Any]) -> str:
    """HTML with tables and figures.

    Parameters
    ----------
    tables : list of Table
    figures : dict
        File name -> (caption, SVG).
    facts : dict
        Settings and versions, printed at the end.
    """
    pictures = "\n".join(
        f'<figure><img alt="{escape(caption)}" src="data:image/svg+xml;base64,{b64encode(svg).decode()}">'
        f"<figcaption>Figure {int(name.split('-')[1])}. {escape(caption)}</figcaption></figure>"
        for name, (caption, svg) in figures.items()
    )
    small, large = tables[:6], tables[6:]
    listed = "; ".join(f"{escape(str(key))} {escape(str(value))}" for key, value in facts.items())
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>kineme: Distance-based kernels for DMPs, reproduced</title><style>{_STYLE}</style></head><body>
<h1>Distance-based kernels for DMPs, reproduced</h1>
<p class="lead">The tables and figures of D. Escudero-Rodrigo and R. Alquézar, recomputed on the LASA handwriting
recordings of S. M. Khansari-Zadeh and A. Billard. Each accuracy is the mean over random draws of three demonstrations
per shape, with its range; the paper prints one number.</p>
<h2>The paper's nine letters</h2>
{"".join(map(to_html, small))}
<h2>All single shapes of LASA</h2>
{"".join(map(to_html, large))}
<h2>Figures</h2>
{pictures}
<footer>{listed}</footer>
</body></html>
"""
