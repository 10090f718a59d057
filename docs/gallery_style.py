"""The figures of the gallery: how they look, and how those that are not of pyplot come into a page."""

from __future__ import annotations

from typing import Any
from weakref import WeakSet

from matplotlib.figure import Figure

#: Okabe and Ito's palette, which color-blind readers can tell apart; C0 to C6 of the scripts.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#777777")


def reset(gallery_conf: dict[str, Any], fname: str) -> None:
    """Set matplotlib's parameters; for ``reset_modules`` of sphinx-gallery."""
    import matplotlib as mpl
    from cycler import cycler

    from kineme.reporting.figures import new_figure

    mpl.rcdefaults()
    mpl.use("agg")
    new_figure(1, 1)  # sets the sizes and lines that figures of kineme have
    mpl.rcParams.update(
        {
            "axes.prop_cycle": cycler(color=COLORS),
            "figure.constrained_layout.use": True,
            "figure.dpi": 100,
            "image.cmap": "viridis",
            "savefig.dpi": 100,
        }
    )


_SHOWN: WeakSet[Figure] = WeakSet()


def scrape(block: tuple[str, str, int], block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures of a cell; for ``image_scrapers`` of sphinx-gallery.

    Functions such as `kineme.anchoring.draw_map` return a figure that is not of pyplot; where a name of the script
    holds it, it is handed to pyplot first.
    """
    from matplotlib import pyplot
    from sphinx_gallery.scrapers import matplotlib_scraper

    for value in block_vars["example_globals"].values():
        if isinstance(value, Figure) and value not in _SHOWN:
            _SHOWN.add(value)
            pyplot.figure(value)
    shown: str = matplotlib_scraper(block, block_vars, gallery_conf)
    return shown
