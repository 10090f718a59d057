"""Optional packages, which only the rivals need."""

from __future__ import annotations

import warnings
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from kineme.errors import SpecificationError

GROUP = "rivals"


def why_missing(name: str) -> str:
    """Why a module of an optional package cannot be used, or ""."""
    try:
        optional_module(name)
    except SpecificationError:
        return f"not installed: {name.partition('.')[0]}"
    except Exception as error:  # an incompatible release of another package can raise anything
        return f"installed, but cannot be imported: {type(error).__name__}: {error}"
    return ""


def optional_module(name: str) -> Any:
    """A module of an optional package.

    Raises
    ------
    SpecificationError
        The package is not installed; the message names the group that has it.
    """
    package = name.partition(".")[0]
    if find_spec(package) is None:
        raise SpecificationError(
            f"expected the package {package!r}, which is not installed; pip install 'kineme[{GROUP}]'"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings of the package, for example on optional file formats
        return import_module(name)
