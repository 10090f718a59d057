"""Primitives to a file and back: the specification as data, numbers bit for bit."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.container import read_container, write_container
from kineme.primitives.dmp import DMP
from kineme.primitives.primitives import Primitives
from kineme.trajectories.resample import Resample
from kineme.trajectories.smooth import Smooth
from kineme.trajectories.trim import TrimRest

#: The preprocessing steps that a file can name. Files carry names of this table, never of classes.
STEPS = {"trim-rest": TrimRest, "smooth": Smooth, "resample": Resample}

_ARRAYS = ("scaled_weights", "starts", "goals", "velocities", "durations", "extents")
_LABEL_TYPES = (str, int, float, bool)


def save_primitives(primitives: Primitives, path: str | Path) -> Path:
    """Write a batch of primitives to one file; see `Primitives.save`."""
    labels = None if primitives.labels is None else np.asarray(primitives.labels).tolist()
    if labels is not None and not all(isinstance(label, _LABEL_TYPES) for label in labels):
        raise DataError(f"expected labels that are text or numbers, to save them, got {type(labels[0]).__name__}")
    header = {
        "dmp": specification_to_dict(primitives.dmp),
        "labels": labels,
        "names": None if primitives.names is None else list(primitives.names),
    }
    return write_container(Path(path), "primitives", header, {name: getattr(primitives, name) for name in _ARRAYS})


def load_primitives(path: str | Path) -> Primitives:
    """Read a file of `save_primitives`; see `Primitives.load`."""
    path = Path(path)
    header, arrays = read_container(path, "primitives")
    try:
        dmp = specification_from_dict(header["dmp"])
        _check_shapes(arrays, dmp)
        labels, names = header["labels"], header["names"]
        return Primitives(
            dmp,
            **{name: arrays[name] for name in _ARRAYS},
            labels=None if labels is None else np.asarray(labels),
            names=None if names is None else tuple(names),
        )
    except (KeyError, TypeError, ValueError) as error:
        reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
        raise DataError(
            f"expected {path} to hold complete primitives, got a header that does not fit ({reason})"
        ) from error


def specification_to_dict(dmp: DMP) -> dict[str, Any]:
    """A specification as plain data."""
    by_type = {step: name for name, step in STEPS.items()}
    unknown = [step for step in dmp.preprocessing if type(step) not in by_type]
    if unknown:
        raise DataError(f"expected preprocessing steps out of {list(STEPS)}, to save them, got {unknown[0]!r}")
    steps = [{"step": by_type[type(step)], **asdict(step)} for step in dmp.preprocessing]
    return {field.name: getattr(dmp, field.name) for field in fields(dmp)} | {"preprocessing": steps}


def specification_from_dict(data: dict[str, Any]) -> DMP:
    """Plain data as a specification; every parameter is checked as if a user had typed it."""
    steps = []
    for record in data["preprocessing"]:
        parameters = dict(record)
        steps.append(STEPS[parameters.pop("step")](**parameters))
    return DMP(**{**data, "preprocessing": tuple(steps)})


def _check_shapes(arrays: dict[str, np.ndarray], dmp: DMP) -> None:
    n, d = arrays["starts"].shape
    expected: dict[str, tuple[int, ...]] = dict.fromkeys(_ARRAYS, (n, d))
    expected |= {"scaled_weights": (n, d, dmp.n_basis), "durations": (n,)}
    for name, shape in expected.items():
        array = arrays[name]
        if array.shape != shape or array.dtype != np.float64 or not np.isfinite(array).all():
            raise ValueError(
                f"{name} should be finite float64 of shape {shape}, is {array.dtype} of shape {array.shape}"
            )
