"""Base class of batches of learned primitives: length, indexing, `concatenate`, `save` and `load`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.recorded_as import DiscreteSteps, RecordedAs, make_read_only, merged
from kineme.errors import DataError, KinemeError, SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels, channels_from_data, channels_to_data, check_alike
from kineme.movements.preparation.glitches import RemoveGlitches
from kineme.movements.preparation.resample import Resample
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.preparation.trim import TrimRest
from kineme.movements.trajectories.labels import as_indices, label_array
from kineme.movements.trajectories.movements import Names, axis_names, set_read_only_state
from kineme.reporting.page import thumbnail
from kineme.reporting.table import Table, to_html
from kineme.reporting.text import counted
from kineme.validation import as_path

#: The preprocessing steps in files, by names of this table; files never contain names of classes.
STEPS = {"remove-glitches": RemoveGlitches, "trim-rest": TrimRest, "smooth": Smooth, "resample": Resample}

#: Name of an array in files -> field of `DiscreteSteps`.
_STEPS_OF = {"step_values": "values", "step_shares": "shares", "step_offsets": "offsets"}

#: What a header that does not fit may raise.
_UNFIT = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError)

_LISTED, _DRAWN = 20, 64  # movements that a notebook shows, and their samples

_LABEL_TYPES = (str, int, float, bool)

Arrays = Mapping[str, NDArray[Any]]
T = TypeVar("T")


class Batch:
    """Base of n learned movements of d dimensions with N basis functions: all that goes over the arrays of `ROWS`."""

    #: Name of an array -> its shape in the letters n, d, N, and q for what the array itself says.
    ROWS: ClassVar[dict[str, str]]
    #: The class of `dmp`.
    SPECIFICATION: ClassVar[type]
    #: Name of the content in saved files.
    KIND: ClassVar[str]

    dmp: Any
    labels: NDArray[Any] | None
    names: Names
    recorded_as: RecordedAs | None

    __setstate__ = set_read_only_state

    def __post_init__(self) -> None:
        make_read_only(self, self.ROWS)
        if self.labels is not None and np.asarray(self.labels).dtype.kind not in "biufO":
            object.__setattr__(self, "labels", label_array(self.labels))

    def __len__(self) -> int:
        return len(self.row(next(iter(self.ROWS))))

    def __getitem__(self, index: Any) -> Self:
        """The chosen primitives as a batch; an integer gives a batch of one."""
        chosen = np.atleast_1d(as_indices(index, len(self)))
        return self._of_rows(
            self.dmp,
            {name: self.row(name)[chosen] for name in self.ROWS},
            None if self.labels is None else self.labels[chosen],
            None if self.names is None else tuple(self.names[i] for i in chosen),
            None if self.recorded_as is None else self.recorded_as.take(chosen),
        )

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        labels = "" if self.labels is None else f", {len(np.unique(self.labels))} labels"
        return f"{type(self).__name__}({len(self)} movements, {self.n_dims} dims{labels}, {self.dmp})"

    def rollout(self, *args: Any, **options: Any) -> Any:
        """Return the movements, see the subclass."""
        raise NotImplementedError

    def plot(self, ax: Any = None) -> Any:
        """Draw the movements as they were learned, see `Demonstrations.plot`; with `ax`, into these axes."""
        return self.rollout().plot(ax)

    def _repr_html_(self) -> str:
        """Show the first 20 movements in a notebook; names are escaped."""
        shown = self[:_LISTED].rollout(n_samples=_DRAWN)
        labels = [""] * len(shown) if shown.labels is None else shown.labels.tolist()
        names, durations = self.names or [None] * len(self), shown.times[:, -1].tolist()
        rows = [
            (str(label), name or "", f"{duration:.3g}")
            for label, name, duration in zip(labels, names[:_LISTED], durations, strict=True)
        ]
        more = f"The first {_LISTED} of {len(self):,} movements." if len(self) > _LISTED else ""
        pictures = [thumbnail(path) for path in np.asarray(shown.positions)]
        title = f"{type(self).__name__}: {counted(len(self), 'movement')}, {counted(self.n_dims, 'dimension')}"
        return to_html(Table(title, ("label", "name", "duration [s]"), rows, more, pictures))

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return int(self.row(next(iter(self.ROWS))).shape[1])

    @property
    def channels(self) -> Channels | None:
        """Channels of the recordings, where they are known; see `Demonstrations.channels`."""
        return None if self.recorded_as is None else self.recorded_as.channels

    @property
    def moving_channels(self) -> Channels | None:
        """Those `channels` that are learned, in the order of the columns of a primitive."""
        return None if self.recorded_as is None else self.recorded_as.moving

    @property
    def to_recording(self) -> RecordedAs | None:
        """`recorded_as` if the recording's columns can be written; an orientation learned as its integral cannot."""
        about = self.recorded_as
        return None if about is None or about.orientations or not about.has_steps else about

    @property
    def plain_names(self) -> tuple[list[str], list[str]]:
        """Names of the columns of movements and of their rates, where no recording names them."""
        return axis_names(self.n_dims), axis_names(self.n_dims)

    @classmethod
    def concatenate(cls, batches: Iterable[Self]) -> Self:
        """Concatenate several batches, in the order given.

        Raises `SpecificationError`: batches of different specifications: their weights are not comparable. Raises
        `TrajectoryError`: no batch, something that is not a batch, batches of different dimensions, labels on some
        batches only; channels that are known to differ, as joint angles and positions.
        """
        batches = list(batches)
        if not batches or not all(isinstance(batch, cls) for batch in batches):
            got = next((type(batch).__name__ for batch in batches if not isinstance(batch, cls)), "none")
            raise TrajectoryError(f"expected at least one batch of {cls.__name__}, got {got}")
        first = batches[0]
        for i, batch in enumerate(batches):
            if batch.dmp != first.dmp:
                name = next(
                    f.name for f in fields(first.dmp) if getattr(first.dmp, f.name) != getattr(batch.dmp, f.name)
                )
                raise SpecificationError(
                    f"batch {i}: expected {name}={getattr(first.dmp, name)!r} as in batch 0, got "
                    f"{getattr(batch.dmp, name)!r}; primitives of one batch share one specification: learn them again "
                    "with it"
                )
            if batch.n_dims != first.n_dims:
                raise TrajectoryError(
                    f"batch {i}: expected {first.n_dims} dimensions as in batch 0, got {batch.n_dims}"
                )
        check_alike([batch.moving_channels for batch in batches], "batch")
        labels = [batch.labels for batch in batches if batch.labels is not None]
        if len(labels) not in (0, len(batches)):
            raise TrajectoryError(
                f"expected labels on every batch or on none, got them on {len(labels)} of {len(batches)}"
            )
        if len({of_batch.dtype.kind for of_batch in labels}) > 1:
            types = ("texts" if of_batch.dtype == object else str(of_batch.dtype) for of_batch in labels)
            raise TrajectoryError(f"expected labels of one type, got {', '.join(types)}")
        named = any(batch.names is not None for batch in batches)
        return cls._of_rows(
            first.dmp,
            {name: np.concatenate([batch.row(name) for batch in batches]) for name in cls.ROWS},
            np.concatenate(labels) if labels else None,
            tuple(name for batch in batches for name in batch.names or (None,) * len(batch)) if named else None,
            merged([batch.recorded_as for batch in batches]),
        )

    def save(self, path: str | Path) -> Path:
        """Write to one file of plain data, atomically; `load` gives back the same numbers bit for bit.

        Raises `DataError`: labels or preprocessing steps that plain data cannot hold. Raises `OSError`: the file cannot
        be written; what was there before stays.
        """
        from kineme.io.arrays.npz import write_container  # files load when they are used

        arrays = {name: self.row(name) for name in self.ROWS}
        if self.recorded_as is not None and self.recorded_as.steps is not None:
            arrays |= {name: getattr(self.recorded_as.steps, field) for name, field in _STEPS_OF.items()}
        plain = None if self.labels is None else np.asarray(self.labels).tolist()
        if plain is not None and not all(isinstance(label, _LABEL_TYPES) for label in plain):
            raise DataError(f"expected labels that are text or numbers, to save them, got {type(plain[0]).__name__}")
        header = {
            "dmp": specification_to_dict(self.dmp),
            "labels": plain,
            "names": None if self.names is None else list(self.names),
            "channels": None if self.channels is None else channels_to_data(self.channels),
        }
        return write_container(Path(path), self.KIND, header, arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file of `save`. The file is data: nothing in it is executed.

        Raises `DataError`: the file is foreign, truncated, damaged, of another kind or of a later version; or it is a
        folder. Raises `FileNotFoundError`: there is no such file.
        """
        from kineme.io.arrays.npz import read_container

        path = as_path(path, f"the path of a file of {cls.KIND}")
        if path.is_dir() or not path.exists():
            there = "a folder" if path.is_dir() else "nothing"
            missing = DataError if path.is_dir() else FileNotFoundError
            raise missing(f"expected a file of {cls.KIND} at {str(path)!r}, found {there} there; save(path) writes one")
        header, arrays = read_container(path, cls.KIND)
        try:
            return cls._from_file(header, arrays)
        except _UNFIT as error:
            reason = error if isinstance(error, KinemeError) else f"{type(error).__name__}: {error}"
            raise DataError(
                f"expected {path} to hold complete {cls.KIND}, got a header that does not fit ({reason})"
            ) from error

    def row(self, name: str) -> NDArray[Any]:
        """Return the array of that name in `ROWS`."""
        return np.asarray(getattr(self, name))

    @classmethod
    def _of_rows(
        cls, dmp: Any, arrays: dict[str, Any], labels: NDArray[Any] | None, names: Names, about: RecordedAs | None
    ) -> Self:
        build: Callable[..., Self] = cls
        return build(dmp, **arrays, labels=labels, names=names, recorded_as=about)

    @classmethod
    def _from_file(cls, header: dict[str, Any], arrays: Arrays) -> Self:
        dmp: Any = specification_from_dict(cls.SPECIFICATION, header["dmp"])
        rows = checked_rows(cls.ROWS, arrays, dmp.n_basis)
        n, d = next(iter(rows.values())).shape[:2]
        labels, names = (_one_each(n, header, name) for name in ("labels", "names"))
        about = recorded_as_from(header, arrays, n, d)
        return cls._of_rows(
            dmp,
            rows,
            None if labels is None else label_array(labels, n),
            None if names is None else tuple(names),
            about,
        )


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
    steps = [dict(record) for record in data["preprocessing"]]
    built = tuple(STEPS[parameters.pop("step")](**parameters) for parameters in steps)
    return specification(**{**data, "preprocessing": built})
