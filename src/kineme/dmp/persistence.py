"""Save primitives to files and load them: the specification as plain data, arrays bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.recorded_as import DiscreteSteps, RecordedAs
from kineme.errors import DataError, KinemeError
from kineme.movements.channels.channel import Channels, channels_from_data, channels_to_data
from kineme.movements.preparation.resample import Resample
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.preparation.trim import TrimRest
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.movements import Names
from kineme.validation import as_path

#: The preprocessing steps in files, by names of this table; files never contain names of classes.
STEPS = {"trim-rest": TrimRest, "smooth": Smooth, "resample": Resample}

#: Name of an array in files -> field of `DiscreteSteps`.
_STEPS_OF = {"step_values": "values", "step_shares": "shares", "step_offsets": "offsets"}

_LABEL_TYPES = (str, int, float, bool)

Arrays = Mapping[str, NDArray[Any]]
T = TypeVar("T")


def save_as(kind: str, path: str | Path, header: dict[str, Any], arrays: Arrays) -> Path:
    """Write a header of plain data and arrays to one file, with the name of its content."""
    from kineme.io.arrays.npz import write_container  # files load when they are used

    return write_container(Path(path), kind, header, dict(arrays))


def load_as(kind: str, path: str | Path, build: Callable[[dict[str, Any], Arrays], T]) -> T:
    """Read a file with content of the given name and build it; a header or arrays that do not fit are a `DataError`."""
    from kineme.io.arrays.npz import read_container

    path = as_path(path, f"the path of a file of {kind}")
    if path.is_dir() or not path.exists():
        there = "a folder" if path.is_dir() else "nothing"
        missing = DataError if path.is_dir() else FileNotFoundError
        raise missing(f"expected a file of {kind} at {str(path)!r}, found {there} there; save(path) writes one")
    header, arrays = read_container(path, kind)
    try:
        return build(header, arrays)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
        raise DataError(
            f"expected {path} to hold complete {kind}, got a header that does not fit ({reason})"
        ) from error


def header_of(dmp: Any, labels: NDArray[Any] | None, names: Names, channels: Channels | None) -> dict[str, Any]:
    """Specification, labels, names and channels of a batch as plain data."""
    plain = None if labels is None else np.asarray(labels).tolist()
    if plain is not None and not all(isinstance(label, _LABEL_TYPES) for label in plain):
        raise DataError(f"expected labels that are text or numbers, to save them, got {type(plain[0]).__name__}")
    return {
        "dmp": specification_to_dict(dmp),
        "labels": plain,
        "names": None if names is None else list(names),
        "channels": None if channels is None else channels_to_data(channels),
    }


def labels_and_names(header: dict[str, Any], n: int) -> tuple[NDArray[Any] | None, tuple[str | None, ...] | None]:
    """Labels and names of the header of a batch of n, checked."""
    labels, names = (_one_each(n, header, name) for name in ("labels", "names"))
    return None if labels is None else label_array(labels, n), None if names is None else tuple(names)


def step_arrays(about: RecordedAs | None) -> dict[str, NDArray[Any]]:
    """The steps of discrete channels as arrays of a file."""
    steps = None if about is None else about.steps
    return {} if steps is None else {name: getattr(steps, field) for name, field in _STEPS_OF.items()}


def recorded_as_from(header: dict[str, Any], arrays: Arrays, n: int, n_dims: int) -> RecordedAs | None:
    """Read what n movements were recorded as, checked; files of earlier versions do not say it."""
    if header.get("channels") is None:
        return None
    channels = channels_from_data(header["channels"], n_dims)
    n_discrete = sum(channel.kind == "discrete" for channel in channels)
    if not n_discrete or not set(_STEPS_OF) <= set(arrays):
        return RecordedAs(channels)
    steps = DiscreteSteps(**{field: arrays[name] for name, field in _STEPS_OF.items()})
    check_array("step_values", steps.values, (len(steps.shares), n_discrete))
    check_array("step_shares", steps.shares, (len(steps.shares),))
    check_array("step_offsets", steps.offsets, (n + 1,))
    lengths = np.diff(steps.offsets)
    if steps.offsets[0] != 0 or steps.offsets[-1] != len(steps.shares) or (lengths < 1).any():
        raise ValueError("step_offsets should say where the steps of each movement begin")
    later = np.diff(steps.shares) > 0
    later[steps.offsets[1:-1] - 1] = True
    if (steps.shares[steps.offsets[:-1]] != 0).any() or not later.all() or steps.shares.max() > 1:
        raise ValueError("step_shares should rise from 0 to at most 1 in each movement")
    return RecordedAs(channels, steps)


def checked_rows(rows: Mapping[str, str], arrays: Arrays, n_basis: int) -> dict[str, NDArray[Any]]:
    """The arrays of a batch, refused unless they have the shapes of `rows`, in the letters n, d and N; q is any."""
    sizes = {"N": n_basis} | dict(zip("nd", arrays[next(iter(rows))].shape, strict=False))
    for name, letters in rows.items():
        own_sizes = dict(zip(letters, arrays[name].shape, strict=False))
        shape = tuple(own_sizes.get("q", 0) if letter == "q" else sizes[letter] for letter in letters)
        check_array(name, arrays[name], shape)
    return {name: arrays[name] for name in rows}


def _one_each(n: int, header: dict[str, Any], name: str) -> list[Any] | None:
    """Labels or names of a header, one per movement."""
    given = header[name]
    allowed = (str, type(None)) if name == "names" else _LABEL_TYPES
    if given is not None and (
        not isinstance(given, list) or len(given) != n or not all(isinstance(entry, allowed) for entry in given)
    ):
        raise ValueError(f"{name} should be a list of {n} {'texts' if name == 'names' else 'texts or numbers'}")
    return given


def check_array(name: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape, of anything but float64 or whole numbers, or with NaN."""
    if array.shape != shape or array.dtype not in (np.float64, np.intp) or not np.isfinite(array).all():
        raise ValueError(f"{name} should be finite float64 of shape {shape}, is {array.dtype} of shape {array.shape}")


def specification_to_dict(dmp: Any) -> dict[str, Any]:
    """A specification as plain data."""
    by_type = {step: name for name, step in STEPS.items()}
    unknown = [step for step in dmp.preprocessing if type(step) not in by_type]
    if unknown:
        raise DataError(f"expected preprocessing steps out of {list(STEPS)}, to save them, got {unknown[0]!r}")
    steps = [{"step": by_type[type(step)], **asdict(step)} for step in dmp.preprocessing]
    return {field.name: getattr(dmp, field.name) for field in fields(dmp)} | {"preprocessing": steps}


def specification_from_dict(specification: type[T], data: dict[str, Any]) -> T:
    """Plain data as a specification; every parameter is checked like user input."""
    steps = []
    for record in data["preprocessing"]:
        parameters = dict(record)
        steps.append(STEPS[parameters.pop("step")](**parameters))
    return specification(**{**data, "preprocessing": tuple(steps)})
