"""The report: one self-contained HTML file."""

from __future__ import annotations

from typing import Any

from kineme.output.page import page, picture
from kineme.output.table import Table, to_html


def write_report(
    tables: tuple[list[Table], list[Table]], figures: dict[str, tuple[str, bytes]], facts: dict[str, Any]
) -> str:
    """HTML with tables and figures.

    Parameters
    ----------
    tables : two lists of Table
        Of the nine letters, and of all shapes.
    figures : dict
        File name -> (caption, SVG).
    facts : dict
        Settings and versions, printed at the end.
    """
    pictures = "\n".join(
        picture(svg, caption, f"Figure {int(name.split('-')[1])}. ") for name, (caption, svg) in figures.items()
    )
    of_letters, of_shapes = tables
    body = f"""<p class="lead">The tables and figures of D. Escudero-Rodrigo and R. Alquézar, recomputed on the LASA
handwriting recordings of S. M. Khansari-Zadeh and A. Billard. Each accuracy is the mean over random draws of three
demonstrations per shape, with its range; the paper prints one number.</p>
<h2>The paper's nine letters</h2>
{"".join(map(to_html, of_letters))}
<h2>All single shapes of LASA</h2>
{"".join(map(to_html, of_shapes))}
<h2>Figures</h2>
{pictures}"""
    heading = "Distance-based kernels for DMPs, reproduced"
    return page(f"kineme: {heading}", heading, body, facts)
