"""Movements as a table of pandas, as a picture, and as notebooks show them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels.channel import Channels
from kineme.movements.channels.detect import unit_of
from kineme.movements.trajectories.movements import Samples
from kineme.reporting.page import thumbnail
from kineme.reporting.table import Table, data_frame, to_html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LISTED = 20  # labels that a notebook shows


class Presented:
    """A base of what holds movements: `to_pandas`, `plot`, and a table in notebooks."""

    @property
    def _samples(self) -> Samples:
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """Return all samples in one long table.

        Returns
        -------
        pandas.DataFrame
            One row per sample, with the columns ``movement`` (its number), ``label`` (None without one), ``time [s]``
            and one for each column that was recorded, under its name; the unit, where it is known, is in the head, as
            in ``x [mm]``. `Demonstrations.from_dataframe` reads it back.

        Raises
        ------
        DataError
            The package pandas is not installed.
        """
        samples = self._samples
        lengths = np.diff(samples.offsets)
        labels = np.full(len(lengths), None) if samples.labels is None else samples.labels
        columns = {
            "movement": np.repeat(np.arange(len(lengths)), lengths),
            "label": np.repeat(labels, lengths),
            "time [s]": samples.times,
        }
        return data_frame(columns | dict(zip(samples.column_names, samples.columns.T, strict=True)))

    @overload
    def plot(self, ax: None = None) -> Figure: ...
    @overload
    def plot(self, ax: Axes) -> Axes: ...
    def plot(self, ax: Axes | None = None) -> Figure | Axes:
        """Draw each dimension over time, and the path where it has two or three dimensions.

        A circle is where a path starts, a star where it ends. Of more than 50 movements, some are drawn; the title says
        how many.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Draw into these axes: the path of movements of two dimensions, of three if they are axes of projection
            "3d", or the only dimension over time.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            `ax` if it was given; else a new figure, ``figure.savefig("movements.png")`` writes it to a file. If
            `matplotlib.pyplot` has been imported, the figure belongs to it: ``plt.show()`` and notebooks show it, and
            ``plt.close(figure)`` frees it.

        Raises
        ------
        SpecificationError
            Something else than axes, axes in the plane for movements in space or the reverse, or axes for movements
            of more than three dimensions.
        """
        from kineme.movements.trajectories.figure import draw_movements, draw_movements_into

        if ax is None:
            return draw_movements(self._samples)
        draw_movements_into(ax, self._samples)
        return ax

    def _repr_html_(self) -> str:
        """Show a picture and a row for each label in a notebook; names from files are escaped."""
        return to_html(self.by_label(repr(self)))

    def by_label(self, title: str) -> Table:
        """Return a table with a row for each of the first 20 labels, and a picture of its first movement."""
        samples = self._samples
        lengths = np.diff(samples.offsets)
        durations = samples.times[samples.offsets[1:] - 1] - samples.times[samples.offsets[:-1]]
        labels = np.full(len(lengths), "") if samples.labels is None else samples.labels
        names, first, of_label = np.unique(labels, return_index=True, return_inverse=True)
        rows = [
            (str(name), f"{mine.sum():,}", _range(lengths[mine], ","), _range(durations[mine], ".3g"))
            for name, mine in ((name, of_label == k) for k, name in enumerate(names[:_LISTED]))
        ]
        pictures = [
            thumbnail(samples.positions[samples.offsets[i] : samples.offsets[i + 1]]) for i in first[:_LISTED].tolist()
        ]
        more = f"The first {_LISTED} of {len(names):,} labels." if len(names) > _LISTED else ""
        return Table(title, ("label", "movements", "samples each", "duration [s]"), rows, more, pictures)


def with_units(names: tuple[str, ...], channels: Channels | None) -> tuple[str, ...]:
    """Put the units of the channels behind the names of their columns, as ``x [mm]``, where only they say them."""
    units = {
        name: channel.unit
        for channel in channels or ()
        for name in channel.columns
        if channel.unit and unit_of(name) != channel.unit
    }
    return tuple(f"{name} [{units[name]}]" if name in units else name for name in names)


def _range(values: NDArray[Any], form: str) -> str:
    low, high = format(values.min(), form), format(values.max(), form)
    return low if low == high else f"{low} to {high}"
