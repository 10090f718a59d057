"""A symbol in a planner's terms: plain data that names a movement and says how it may be varied."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import check_array, specification_from_dict, specification_to_dict
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.styles.average import AveragePrimitive, average
from kineme.dmp.styles.model import StyleModel, compared, learn_styles
from kineme.dmp.styles.parameters import as_primitives, check_primitives
from kineme.errors import DataError, SpecificationError, TrajectoryError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.similarity.describe import Described, Maps, describe, maps_onto, moved, paths_of
from kineme.similarity.similarity import median_distances, similarities
from kineme.similarity.specification import Compares
from kineme.validation import check_choice, check_form

FORMAT = "kineme-grounding"
VERSION = 1
_STYLED = 3  # demonstrations from which on styles are learned
#: Name in a grounding -> field of `Primitives`; `primitive_from` reads the numbers back bit for bit.
_NUMBERS = {
    "scaled_weights": "scaled_weights", "start": "starts", "goal": "goals",
    "velocity": "velocities", "duration": "durations", "extent": "extents",
}  # fmt: skip
_FLAT = 1e-9  # of the path: what members differ by when only rounding tells them apart


@dataclass(frozen=True)
class SymbolName:
    """Name, id and history of a symbol.

    - `id`: stable, whatever it is renamed to.
    - `parents`: ids of the symbols that it was made from.
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
    """Describe what a symbol does, as plain data that JSON can hold; `grounding_schema` is its schema.

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
    primitives = as_primitives(primitives)
    d = primitives.n_dims
    named = None if units is None else [units] * d if isinstance(units, str) else list(units)
    if named is not None and len(named) != d:
        raise TrajectoryError(f"expected a unit for each of {d} dimensions, got {len(named)}: {named}")
    typical = prototype(primitives, medoid, like)
    primitive = primitives[typical.medoid] if by == "medoid" else typical.primitive
    return {
        "format": FORMAT,
        "version": VERSION,
        "symbol": asdict(symbol) | {"parents": list(symbol.parents)},
        "n_dims": d,
        "units": {"position": named, "time": "s"},
        "n_demonstrations": len(primitives),
        "prototype": {"by": by, "medoid": typical.medoid},
        "dmp": specification_to_dict(primitive.dmp),
        "primitive": {name: getattr(primitive, field)[0].tolist() for name, field in _NUMBERS.items()},
        "demonstrated": {
            "start": _range(primitives.starts),
            "goal": _range(primitives.goals),
            "displacement": _range(primitives.goals - primitives.starts),
            "extent": _range(primitives.extents),
            "duration": _range(primitives.durations),
        },
        "styles": _styles(primitives, typical),
    }


def _range(values: NDArray[np.float64]) -> dict[str, Any]:
    return {name: getattr(np, name)(values, axis=0).tolist() for name in ("min", "median", "max")}


def _styles(primitives: Primitives, typical: Prototype) -> dict[str, Any] | None:
    """The style model of the members laid onto the medoid, or None where they are too few or do not differ."""
    laid = moved(primitives, typical.maps)
    if len(laid) < _STYLED or typical.average.deviation().max() <= _FLAT * laid.extents.max():
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


@dataclass(frozen=True, eq=False)
class Prototype:
    """A symbol as one movement.

    - `medoid`: the member most similar to the others.
    - `average`: mean of the members and their spread, each laid onto the medoid first; at the medoid's position, size
      and direction, and with the (geometric) mean of all durations.
    - `maps`: from each member onto the medoid.
    """

    medoid: int
    average: AveragePrimitive
    maps: Maps

    @property
    def primitive(self) -> Primitives:
        """The mean, a batch of one."""
        return self.average.primitive


def prototype(primitives: Primitives, medoid: int | None = None, like: Compares | None = None) -> Prototype:
    """The prototype of the members of one symbol.

    Parameters
    ----------
    primitives : Primitives
        Of the members.
    medoid : int, optional
        Where it is known; by default the member with the largest mean similarity to the others.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take out before the mean.

    Raises
    ------
    SpecificationError
        A medoid that is none of the members.
    """
    check_primitives(primitives)
    if medoid is not None and not 0 <= medoid < len(primitives):
        raise SpecificationError(f"expected medoid to be one of {len(primitives)} members, got {medoid!r}")
    paths = paths_of(primitives)
    if medoid is None:
        medoid = medoid_of(paths.transpose(0, 2, 1), like)
    maps = maps_onto(paths, paths[medoid], like)
    return Prototype(medoid, average(moved(primitives, maps)), maps)


def medoid_of(movements: Described | MovementsLike, like: Compares | None = None) -> int:
    """The movement with the largest mean similarity to the others; the first of one or two."""
    described = describe(movements, like)
    if len(described) < 3:
        return 0
    # One width serves all of them: it only weighs the representations, by how much they differ within the symbol.
    # Where they do not differ, as movements of one dimension do not in turning angles, all are equally typical.
    widths = median_distances(described)
    differ = np.flatnonzero(widths > 0)
    if not len(differ):
        return 0
    return int(similarities(described.select(differ), widths=widths[differ]).sum(axis=1).argmax())


def grounding_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of what `ground` returns; it comes with the package."""
    text = files("kineme.anchoring").joinpath("grounding.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def primitive_from(grounding: Mapping[str, Any], style: ArrayLike | None = None) -> Primitives:
    """The primitive of a grounding, bit for bit, or of another style: a batch of one, labeled with the symbol's name.

    Parameters
    ----------
    grounding : mapping
        As `ground` gives it, or as JSON reads it.
    style : array_like of shape (J,), optional
        Style coordinates within the demonstrated range.

    Raises
    ------
    DataError
        Not a grounding, one of a later version, or one whose numbers are missing or do not fit together.
    SpecificationError
        A style of a symbol without styles, or outside its range.
    """
    check_form(grounding, "grounding", FORMAT, VERSION)
    try:
        dmp = specification_from_dict(DMP, grounding["dmp"])
        label = np.array([grounding["symbol"]["name"]])
        if style is None:
            return _primitive(dmp, grounding["primitive"], int(grounding["n_dims"]), label)
        model = None if grounding["styles"] is None else style_model(grounding["styles"], dmp)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(
            f"expected a complete grounding, got one that does not fit ({type(error).__name__}: {error}); "
            "check it against kineme.anchoring.grounding.grounding_schema()"
        ) from error
    if model is None:
        n, name = grounding["n_demonstrations"], grounding["symbol"]["name"]
        raise SpecificationError(
            f"expected no style, since the {n} demonstrations of {name!r} are fewer than 3 or do not differ, "
            f"got {style!r}"
        )
    return model.primitive(style)


def _primitive(dmp: DMP, numbers: Mapping[str, Any], d: int, label: Any) -> Primitives:
    shapes: dict[str, tuple[int, ...]] = {"scaled_weights": (d, dmp.n_basis), "duration": ()}
    arrays: dict[str, Any] = {}
    for name, field in _NUMBERS.items():
        values = np.array(numbers[name], dtype=np.float64)
        check_array(name, values, shapes.get(name, (d,)))
        arrays[field] = values[None]
    if arrays["durations"][0] <= 0:
        raise ValueError(f"duration should be above 0, is {numbers['duration']!r}")
    return Primitives(dmp, **arrays, labels=label)
