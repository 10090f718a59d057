"""The pictures of the concepts that scripts of the gallery draw: name of the picture -> its script."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import TYPE_CHECKING

from gallery_style import reset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = {
    "concept-primitive": "primitives/plot_anatomy.py",
    "concept-formulations": "primitives/plot_formulations.py",
    "concept-matrices": "primitives/plot_two_matrices.py",
    "concept-features": "kernels/plot_weights_or_shape_attractor.py",
    "concept-conventions": "kernels/plot_conventions.py",
    "concept-kernels": "kernels/plot_kernels.py",
    "concept-representations": "recognition/plot_representations.py",
    "concept-rotation": "recognition/plot_rotation.py",
    "concept-unknown": "recognition/plot_unknown.py",
    "concept-between": "anchoring/plot_between_two_symbols.py",
}


def drawn(name: str) -> Figure:
    """The figure of the script of that picture, in the style of the gallery."""
    from matplotlib import pyplot

    reset({}, name)
    pyplot.close("all")
    figure: Figure = runpy.run_path(str(EXAMPLES / SCRIPTS[name]))["figure"]
    return figure
