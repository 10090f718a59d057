"""From a grounding back to a primitive that moves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.anchoring.grounding.ground import FORMAT, VERSION, style_model
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.persistence import check_array, specification_from_dict
from kineme.errors import DataError, SpecificationError


def grounding_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of what `ground` returns; it comes with the package."""
    text = files("kineme.anchoring.grounding").joinpath("grounding.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def primitive_from(grounding: Mapping[str, Any], style: ArrayLike | None = None) -> Primitives:
    """The primitive of a grounding, bit for bit the one that was grounded; or that of another style.

    Parameters
    ----------
    grounding : mapping
        As `ground` gives it, or as JSON reads it.
    style : array_like of shape (J,), optional
        Style coordinates within the demonstrated range.

    Returns
    -------
    Primitives
        A batch of one, labeled with the symbol's name.

    Raises
    ------
    DataError
        Not a grounding, one of a later version, or one whose numbers are missing or do not fit together.
    SpecificationError
        A style of a symbol without styles, or outside its range.
    """
    _check_format(grounding)
    try:
        dmp = specification_from_dict(DMP, grounding["dmp"])
        label = np.array([grounding["symbol"]["name"]])
        if style is None:
            return _primitive(dmp, grounding["primitive"], int(grounding["n_dims"]), label)
        model = None if grounding["styles"] is None else style_model(grounding["styles"], dmp)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(
            f"expected a complete grounding, got one that does not fit ({type(error).__name__}: {error}); "
            "check it against kineme.anchoring.grounding.grounding_io.grounding_schema()"
        ) from error
    if model is None:
        n, name = grounding["n_demonstrations"], grounding["symbol"]["name"]
        raise SpecificationError(
            f"expected no style, since the {n} demonstrations of {name!r} are fewer than 3 or do not differ, "
            f"got {style!r}"
        )
    return model.primitive(style)


def _check_format(grounding: Any) -> None:
    if not isinstance(grounding, Mapping) or grounding.get("format") != FORMAT:
        got = grounding.get("format") if isinstance(grounding, Mapping) else type(grounding).__name__
        raise DataError(f"expected a grounding, a mapping with format {FORMAT!r}, got {got!r}")
    if not isinstance(grounding.get("version"), int) or grounding["version"] > VERSION:
        raise DataError(
            f"expected a grounding of version {VERSION} or earlier, got {grounding.get('version')!r}; upgrade kineme"
        )


def _primitive(dmp: DMP, numbers: Mapping[str, Any], d: int, label: Any) -> Primitives:
    shapes = {"scaled_weights": (d, dmp.n_basis), "start": (d,), "goal": (d,), "velocity": (d,), "extent": (d,)}
    arrays = {}
    for name, shape in {**shapes, "duration": ()}.items():
        arrays[name] = np.array(numbers[name], dtype=np.float64)
        check_array(name, arrays[name], shape)
    if arrays["duration"] <= 0:
        raise ValueError(f"duration should be above 0, is {numbers['duration']!r}")
    return Primitives(
        dmp,
        scaled_weights=arrays["scaled_weights"][None],
        starts=arrays["start"][None],
        goals=arrays["goal"][None],
        velocities=arrays["velocity"][None],
        durations=arrays["duration"][None],
        extents=arrays["extent"][None],
        labels=label,
    )
