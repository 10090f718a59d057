"""The report: one self-contained HTML file."""

from __future__ import annotations

from typing import Any

from kineme.output.page import page, picture
from kineme.output.table import Table, to_html
from kineme.output.text import in_markup


def write_report(tables: dict[str, list[Table]], figures: dict[str, tuple[str, bytes]], facts: dict[str, Any]) -> str:
    """HTML with tables and figures.

    Parameters
    ----------
    tables : dict of str to list of Table
        Heading -> the tables below it.
    figures : dict
        File name -> (caption, SVG).
    facts : dict
        Settings and versions, printed at the end.
    """
    pictures = "\n".join(
        picture(svg, caption, f"Figure {int(name.split('-')[1])}. ") for name, (caption, svg) in figures.items()
    )
    parts = "\n".join(
        f"<h2>{in_markup(heading)}</h2>\n{''.join(map(to_html, some))}" for heading, some in tables.items()
    )
    body = f"""<p class="lead">The tables and figures of D. Escudero-Rodrigo and R. Alquézar, recomputed on the LASA
handwriting recordings of S. M. Khansari-Zadeh and A. Billard. Each accuracy is the mean over random draws of three
demonstrations per shape, with its range; the paper prints one number.</p>
{parts}
<h2>Figures</h2>
{pictures}"""
    heading = "Distance-based kernels for DMPs, reproduced"
    return page(f"kineme: {heading}", heading, body, facts)
