"""Packages of rivals, which the library itself does without."""

from __future__ import annotations

from importlib.util import find_spec

from kineme.errors import SpecificationError

GROUP = "rivals"


def require(module: str) -> None:
    """Refuse to go on without an optional package, and name the group that has it.

    Raises
    ------
    SpecificationError
        The package is not installed.
    """
    if find_spec(module) is None:
        raise SpecificationError(
            f"expected the package {module!r}, which is not installed; pip install 'kineme[{GROUP}]'"
        )
