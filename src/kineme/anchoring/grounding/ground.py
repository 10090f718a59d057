"""A symbol in a planner's terms: plain data that names a movement and says how it may be varied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.grounding.prototypes import Prototype, prototype
from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.persistence import specification_to_dict
from kineme.dmp.styles.model import StyleModel, compared, learn_styles
from kineme.errors import TrajectoryError
from kineme.similarity.alignment import moved
from kineme.similarity.specification import Compares
from kineme.validation import Array, check_choice

FORMAT = "kineme-grounding"
VERSION = 1
_STYLED = 3  # demonstrations from which on styles are learned
_FLAT = 1e-9  # of the path: what members differ by when only rounding tells them apart


@dataclass(frozen=True)
class SymbolName:
    """What a symbol is called.

    Attributes
    ----------
    id : str
        Stable, whatever it is renamed to.
    name : str
    description : str
    parents : tuple of str
        Ids of the symbols that it was made from.
    """

    id: str
    name: str
    description: str = ""
    parents: tuple[str, ...] = ()


def ground(
    symbol: SymbolName,
    primitives: Primitives,
    *,
    by: str = "medoid",
    units: Sequence[str] | str | None = None,
    medoid: int | None = None,
    like: Compares | None = None,
) -> dict[str, Any]:
    """What a symbol does, as plain data that JSON can hold; `grounding_schema` describes it.

    Parameters
    ----------
    symbol : SymbolName
    primitives : Primitives
        Of all demonstrations of the symbol.
    by : {"medoid", "mean"}, default "medoid"
        What stands for the symbol: its most typical demonstration, or the mean of all, laid onto that one.
    units : str or sequence of d str, optional
        Of the positions, as "mm", or of each dimension.
    medoid : int, optional
        Which demonstration it is, where that is known.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take out before means and styles.

    Returns
    -------
    dict
        The primitive (specification, scaled weights, start, goal, velocity, duration), the demonstrated ranges of
        start, goal, displacement ``g - x0``, extent and duration, and from three demonstrations on the styles
        in which they differ, if they do, beside position, size and direction.

    Raises
    ------
    TrajectoryError
        No demonstration, or not one unit for each dimension.
    """
    check_choice("by", by, ["medoid", "mean"])
    if not len(primitives):
        raise TrajectoryError(f"expected at least one demonstration of {symbol.name!r}, got none")
    typical = prototype(primitives, medoid, like)
    one = primitives[typical.medoid] if by == "medoid" else typical.primitive
    return {
        "format": FORMAT,
        "version": VERSION,
        "symbol": {
            "id": symbol.id,
            "name": symbol.name,
            "description": symbol.description,
            "parents": list(symbol.parents),
        },
        "n_dims": primitives.n_dims,
        "units": {"position": _units(units, primitives.n_dims), "time": "s"},
        "n_demonstrations": len(primitives),
        "prototype": {"by": by, "medoid": typical.medoid},
        "dmp": specification_to_dict(one.dmp),
        "primitive": _numbers(one),
        "demonstrated": _ranges(primitives),
        "styles": _styles(primitives, typical),
    }


def _units(units: Sequence[str] | str | None, n_dims: int) -> list[str] | None:
    if units is None:
        return None
    named = [units] * n_dims if isinstance(units, str) else list(units)
    if len(named) != n_dims:
        raise TrajectoryError(f"expected a unit for each of {n_dims} dimensions, got {len(named)}: {named}")
    return named


def _numbers(one: Primitives) -> dict[str, Any]:
    """A batch of one as lists; `primitive_from` reads them back bit for bit."""
    return {
        "scaled_weights": one.scaled_weights[0].tolist(),
        "start": one.starts[0].tolist(),
        "goal": one.goals[0].tolist(),
        "velocity": one.velocities[0].tolist(),
        "duration": float(one.durations[0]),
        "extent": one.extents[0].tolist(),
    }


def _ranges(primitives: Primitives) -> dict[str, Any]:
    return {
        "start": _range(primitives.starts),
        "goal": _range(primitives.goals),
        "displacement": _range(primitives.goals - primitives.starts),
        "extent": _range(primitives.extents),
        "duration": _range(primitives.durations),
    }


def _range(values: NDArray[np.float64]) -> dict[str, Any]:
    return {
        "min": values.min(axis=0).tolist(),
        "median": np.median(values, axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
    }


def _styles(primitives: Primitives, typical: Prototype) -> dict[str, Any] | None:
    """The style model of the members laid onto the medoid, or None where they are too few or do not differ."""
    laid = moved(primitives, typical.maps)
    if len(laid) < _STYLED or not _differ(typical.average.deviation(), laid.extents):
        return None
    model = learn_styles(laid)
    return {
        "metric": model.metric,
        "coordinates": model.styles.tolist(),
        "min": model.lowest.tolist(),
        "max": model.highest.tolist(),
        "explained_variance": model.explained_variance[: model.n_styles].tolist(),
        "mean": model.mean.tolist(),
        "basis": model.basis.tolist(),
        "duration": model.duration,
        "tempo_basis": model.tempo_basis.tolist(),
        "singular_values": model.singular_values.tolist(),
    }


def _differ(deviation: Array, extents: Array) -> bool:
    return bool(deviation.max() > _FLAT * extents.max())


def style_model(styles: dict[str, Any], dmp: Any) -> StyleModel:
    """The style model that a grounding holds."""
    names = ("singular_values", "mean", "basis", "tempo_basis")
    arrays = {name: np.array(styles[name], dtype=np.float64) for name in names}
    return StyleModel(
        dmp,
        metric=styles["metric"],
        styles=np.array(styles["coordinates"], dtype=np.float64),
        duration=float(styles["duration"]),
        # What the metric sees of the basis: theta is regressed on the styles, and the metric is linear in theta.
        directions=compared(styles["metric"], dmp, arrays["basis"]),
        recorded_as=None,
        **arrays,
    )
