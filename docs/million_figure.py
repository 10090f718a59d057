"""The picture of docs/tutorials/a-million-movements.md: time and memory of its parts, from the file of results."""

from __future__ import annotations

from matplotlib.figure import Figure

from kineme.reporting.figures import new_figure
from result_tables.million import by_part

_COLORS = ("tab:gray", "tab:blue", "tab:green", "tab:orange", "tab:red", "tab:purple")


def million() -> Figure:
    """Processor time and peak of memory of each part, against the number of movements."""
    figure = new_figure(7.4, 4.0)
    left, right = figure.subplots(1, 2)
    for color, (part, took) in zip(_COLORS, by_part().items(), strict=True):
        counts = sorted(took)
        for axes, what in ((left, "seconds"), (right, "megabytes")):
            axes.plot(counts, [took[count][what] for count in counts], "o-", color=color, label=part, markersize=4)
    left.set(xscale="log", yscale="log", xlabel="movements", ylabel="processor time [s]")
    right.set(xscale="log", ylim=(0, None), xlabel="movements", ylabel="peak of memory [MB]")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
