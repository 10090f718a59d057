"""Base class of batches of learned primitives: length, indexing, `concatenate`, `save` and `load`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.recorded_as import RecordedAs, merged
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels, check_alike
from kineme.movements.trajectories.labels import as_indices, label_array
from kineme.movements.trajectories.movements import Names

if TYPE_CHECKING:
    from kineme.dmp.persistence import Arrays


class Batch:
    """Base of frozen records of n learned movements of d dimensions, with one specification of N basis functions.

    A subclass lists its arrays once, in `ROWS`; write protection, indexing, concatenation and files use that list.
    """

    #: Name of an array -> its shape in the letters n, d, N, and q for what the array itself says.
    ROWS: ClassVar[dict[str, str]]
    #: The class of `dmp`.
    SPECIFICATION: ClassVar[type]
    #: Name of the content in saved files.
    KIND: ClassVar[str]

    if TYPE_CHECKING:  # read-only here: fields or properties of the subclass

        @property
        def dmp(self) -> Any:
            """The specification."""

        @property
        def labels(self) -> NDArray[Any] | None:
            """Labels of the demonstrations, shape (n,), or None."""

        @property
        def names(self) -> tuple[str | None, ...] | None:
            """Source of each demonstration, or None."""

        @property
        def recorded_as(self) -> RecordedAs | None:
            """Channels of the recordings and the steps of discrete ones, or None."""

    def __post_init__(self) -> None:
        for name in self.ROWS:
            view = getattr(self, name).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)
        if self.labels is not None and np.asarray(self.labels).dtype.kind not in "biufO":
            object.__setattr__(self, "labels", label_array(self.labels))

    def __len__(self) -> int:
        return len(self.row(next(iter(self.ROWS))))

    def __getitem__(self, index: Any) -> Self:
        """The chosen primitives as a batch; an integer gives a batch of one."""
        chosen = np.atleast_1d(as_indices(index, len(self)))
        return self._with(
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
        """`recorded_as`, if the movements can be written in the columns of the recording; else None.

        An orientation that was learned as its integrated rotation cannot: it does not know where it started.
        """
        about = self.recorded_as
        return None if about is None or about.orientations or not about.has_steps else about

    @classmethod
    def concatenate(cls, batches: Iterable[Self]) -> Self:
        """Concatenate several batches, in the order given.

        Raises
        ------
        SpecificationError
            Batches of different specifications: their weights are not comparable.
        TrajectoryError
            No batch, something that is not a batch, batches of different dimensions, labels on some batches only;
            channels that are known to differ, as joint angles and positions.
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
        return first._with(
            {name: np.concatenate([batch.row(name) for batch in batches]) for name in cls.ROWS},
            np.concatenate(labels) if labels else None,
            tuple(name for batch in batches for name in batch.names or (None,) * len(batch)) if named else None,
            merged([batch.recorded_as for batch in batches]),
        )

    def save(self, path: str | Path) -> Path:
        """Write to one file of plain data, atomically; `load` gives back the same numbers bit for bit.

        Raises
        ------
        DataError
            Labels or preprocessing steps that plain data cannot hold.
        OSError
            The file cannot be written; what was there before stays.
        """
        rows = {name: self.row(name) for name in self.ROWS}
        from kineme.dmp.persistence import header_of, save_as, step_arrays  # files load when they are used

        header = header_of(self.dmp, self.labels, self.names, self.channels)
        return save_as(self.KIND, path, header, rows | step_arrays(self.recorded_as))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file of `save`. The file is data: nothing in it is executed.

        Raises
        ------
        DataError
            The file is foreign, truncated, damaged, of another kind or of a later version; or it is a folder.
        FileNotFoundError
            There is no such file.
        """
        from kineme.dmp.persistence import load_as

        return load_as(cls.KIND, path, cls._from_file)

    def row(self, name: str) -> NDArray[Any]:
        """Return the array of that name in `ROWS`."""
        return np.asarray(getattr(self, name))

    def _with(
        self, arrays: dict[str, Any], labels: NDArray[Any] | None, names: Names, about: RecordedAs | None
    ) -> Self:
        return self._of_rows(self.dmp, arrays, labels, names, about)

    @classmethod
    def _of_rows(
        cls, dmp: Any, arrays: dict[str, Any], labels: NDArray[Any] | None, names: Names, about: RecordedAs | None
    ) -> Self:
        build: Callable[..., Self] = cls
        return build(dmp, **arrays, labels=labels, names=names, recorded_as=about)

    @classmethod
    def _from_file(cls, header: dict[str, Any], arrays: Arrays) -> Self:
        from kineme.dmp.persistence import checked_rows, labels_and_names, recorded_as_from, specification_from_dict

        dmp: Any = specification_from_dict(cls.SPECIFICATION, header["dmp"])
        rows = checked_rows(cls.ROWS, arrays, dmp.n_basis)
        n, d = next(iter(rows.values())).shape[:2]
        return cls._of_rows(dmp, rows, *labels_and_names(header, n), recorded_as_from(header, arrays, n, d))
