"""A figure of recordings that were cut: channels or speed over time, the pieces shaded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kineme.movements.channels.channel import recorded_names
from kineme.movements.segmentation.segment import Segmentation
from kineme.movements.segmentation.table import observe
from kineme.movements.trajectories.movements import axis_names
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import new_figure
from kineme.reporting.text import drawable, shortened
from kineme.sampling import evenly_spaced
from kineme.validation import Array

_CHANNELS = 8  # of one recording that are drawn, each in a panel of its own
_RECORDINGS = 8  # of several, whose speeds are drawn
_POINTS = 6000  # samples that are drawn
_NUMBERED = 40  # pieces whose numbers are written
_NAME = 24


def draw_segmentations(segmentations: Sequence[Segmentation]) -> Figure:
    """Draw the channels and the speed of one recording over time, or the speed of each of several; shade the pieces."""
    shown, alone = segmentations[:_RECORDINGS], len(segmentations) == 1
    n_all, most, what = len(segmentations), _RECORDINGS, "recordings"
    if alone:
        panels = [*_channels(shown[0]), _speed(shown[0], "speed")]
        n_all, most, what = np.shape(shown[0].recording.recorded)[1], _CHANNELS, "channels"
    else:
        names = [drawable(shortened(segmentation.recording.name or "recording", _NAME)) for segmentation in shown]
        panels = list(map(_speed, shown, names))
    figure = new_figure(7.2, 0.7 + (0.85 if alone else 1.1) * len(panels))
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=alone).ravel()
    owners = [shown[0]] * len(panels) if alone else list(shown)
    for panel, owner, (name, values) in zip(axes, owners, panels, strict=True):
        _draw(panel, owner, name, values)
    for panel, owner in zip(axes[:1] if alone else axes, owners, strict=False):
        _number(panel, owner)
    parts = ["time since the first sample [s]; speeds in shares of the peak speed"]
    if n_all > most:
        parts.append(f"the first {most} of {n_all} {what}")
    axes[-1].set_xlabel("; ".join(parts))
    return figure


def _channels(segmentation: Segmentation) -> list[tuple[str, Array]]:
    """Names and values of the columns that are drawn."""
    recording = segmentation.recording
    named, values = recording.channels, recording.recorded  # without channels the positions
    names = axis_names(recording.n_dims) if named is None else recorded_names(named)
    return [(drawable(shortened(name, _NAME)), values[:, k]) for k, name in enumerate(names[:_CHANNELS])]


def _speed(segmentation: Segmentation, name: str) -> tuple[str, Array]:
    """The speed that the recording is cut by, in shares of its peak."""
    motion = observe(segmentation.recording, segmentation.method.resolution)
    return name, motion.speed / motion.peak


def _draw(axes: Any, segmentation: Segmentation, name: str, values: Array) -> None:
    times = segmentation.recording.times - segmentation.recording.times[0]
    drawn = evenly_spaced(len(times), _POINTS)
    for k, (start, end) in enumerate((segmentation.cuts - segmentation.recording.times[0]).tolist()):
        axes.axvspan(start, end, color=BLUE if k % 2 else ORANGE, alpha=0.18, linewidth=0)
    axes.plot(times[drawn], values[drawn], color=GRAY, linewidth=0.8)
    axes.set_ylabel(name, rotation=0, ha="right", va="center")
    axes.tick_params(labelsize=6.5, length=2)
    axes.locator_params(axis="y", nbins=3)
    axes.margins(x=0.0)


def _number(axes: Any, segmentation: Segmentation) -> None:
    """Write the numbers of the pieces above the panel."""
    middles = segmentation.cuts.mean(axis=1) - segmentation.recording.times[0]
    for k in evenly_spaced(len(middles), _NUMBERED).tolist() if len(middles) else []:
        at = (float(middles[k]), 1.02)
        axes.annotate(str(k + 1), at, xycoords=("data", "axes fraction"), ha="center", fontsize=6.5, color=GRAY)
