"""The conclusions below the tables: sentences that are computed from the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import NamedTuple

from kineme_experiments.ranges import mean_and_range

#: Column -> the accuracy of each draw.
ByColumn = Mapping[str, Sequence[float]]

_DIGITS = 0.001  # the paper prints three digits and truncates: 0.740 for 20/27
_ALIKE = 1.5  # largest factor between two widths that count as alike
_LOST = 0.1  # an accuracy has fallen if it is lower by this much
_MOST = 0.5  # share of multipliers at their bound above which the bound is named as the reason
_NUMBERS = ("no", "one", "two", "three", "four")


class Printed(NamedTuple):
    """One accuracy of the paper, and our draws for each convention that it can stand for, by name of the feature."""

    name: str
    value: float
    conventions: ByColumn


def listed(items: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``; with semicolons where an item has a comma of its own."""
    comma = "; " if any("," in item for item in items) else ", "
    return " and ".join(filter(None, [comma.join(items[:-1]), *items[-1:]]))


def inside(printed: float, values: Sequence[float]) -> bool:
    """Whether a printed number lies within the range of our draws."""
    return min(values) - _DIGITS <= printed <= max(values) + _DIGITS


def alike(width: float, other: float) -> bool:
    """Whether two widths are within a factor of 1.5 of each other."""
    return max(width, other) <= _ALIKE * min(width, other)


def multiples(accuracies: Sequence[float], n: int) -> list[float]:
    """The accuracies that are k / n for a whole number k, within the printed digits."""
    return [value for value in accuracies if abs(value - round(value * n) / n) <= _DIGITS]


def read_counts(accuracies: Sequence[float], counted: int, drawn: int) -> str:
    """Whether the paper's accuracies are shares of the number of movements it states, or of the number in our draws."""
    both = {n: multiples(accuracies, n) for n in (drawn, counted)}
    neither = [f"{value:.3f}" for value in accuracies if all(value not in some for some in both.values())]
    sentence = (
        f"The paper counts {counted} movements. Of its {len(accuracies)} accuracies in Tables 2 and 4, "
        f"{len(both[drawn])} are multiples of 1/{drawn} and {len(both[counted])} are multiples of 1/{counted}"
    )
    return f"{sentence}; {listed(neither)} of neither." if neither else f"{sentence}."


def read_placement(what: str, printed: Mapping[str, float], ours: ByColumn) -> str:
    """The columns in which the range of our draws contains the paper's number."""
    within = [column for column, value in printed.items() if inside(value, ours[column])]
    others = [
        f"{column} ({value:.3f} against {_range(ours[column])})"
        for column, value in printed.items()
        if column not in within
    ]
    sentence = f"{what}: our draws contain the paper's number in "
    if not others:
        return f"{sentence}every column."
    return (
        f"{sentence}{listed(within)}, but not in {listed(others)}."
        if within
        else f"{sentence}no column: {listed(others)}."
    )


def read_nearer(printed: Mapping[str, float], readings: Mapping[str, ByColumn]) -> str:
    """The reading whose mean is nearest to the paper's number, for columns in which the readings differ."""
    nearest: dict[str, list[str]] = {}
    for column, value in printed.items():
        off = {name: abs(fmean(ours[column]) - value) for name, ours in readings.items()}
        if max(off.values()) - min(off.values()) > _DIGITS:
            nearest.setdefault(min(off, key=off.__getitem__), []).append(column)
    parts = [f"{name} in {listed(columns)}" for name, columns in nearest.items()]
    return f"Nearest to the paper's accuracies: {'; '.join(parts)}." if parts else ""


def read_order(what: str, names: tuple[str, str], first: Sequence[float], second: Sequence[float]) -> str:
    """In how many draws each of two is ahead."""
    ahead = sum(a > b for a, b in zip(first, second, strict=True))
    behind = sum(a < b for a, b in zip(first, second, strict=True))
    means = f"{fmean(first):.3f} against {fmean(second):.3f}"
    if not ahead + behind:
        return f"{what}: {names[0]} and {names[1]} are equal in all {len(first)} draws ({means})."
    return f"{what}: {names[0]} is ahead of {names[1]} in {ahead} of {len(first)} draws, behind in {behind} ({means})."


def read_ahead(what: str, names: tuple[str, str], first: ByColumn, second: ByColumn) -> str:
    """The columns in which the mean of one is above that of the other."""
    found: dict[str, list[str]] = {}
    for column, values in first.items():
        one, other = round(fmean(values), 3), round(fmean(second[column]), 3)
        if one == other:
            found.setdefault(f"{names[0]} and {names[1]} are equal", []).append(column)
            continue
        order = names if one > other else names[::-1]
        means = f"{max(one, other):.3f} against {min(one, other):.3f}"
        found.setdefault(f"{order[0]} is ahead of {order[1]}", []).append(f"{column} ({means})")
    return f"{what}, {'; '.join(f'{order} in {listed(columns)}' for order, columns in found.items())}."


def read_widths(what: str, printed: Mapping[str, float], ours: Mapping[str, float]) -> str:
    """The columns in which the paper's RBF width is like our median distance."""
    others = [
        f"{column} ({value:.3g} against {ours[column]:.3g})"
        for column, value in printed.items()
        if not alike(value, ours[column])
    ]
    found = f"{_NUMBERS[len(printed) - len(others)]} of {_NUMBERS[len(printed)]} columns"
    sentence = f"{what}: the paper's RBF width is within a factor of {_ALIKE:g} of the median distance in {found}"
    return f"{sentence}; not in {listed(others)}." if others else f"{sentence}."


def read_conventions(accuracies: Sequence[Printed]) -> str:
    """The accuracies of the paper that lie within the draws of a convention, and of which; else the nearest one."""
    within: list[str] = []
    others: list[str] = []
    for name, value, conventions in accuracies:
        found = [feature for feature, values in conventions.items() if inside(value, values)]
        off = {feature: abs(fmean(values) - value) for feature, values in conventions.items()}
        chosen = found or [feature for feature in off if off[feature] - min(off.values()) <= _DIGITS]
        shown = " or ".join(f"{feature}: {mean_and_range(conventions[feature])}" for feature in chosen)
        (within if found else others).append(f"{name}, {value:.3f} [{shown}]")
    sentences = [f"Within the draws of a convention: {listed(within)}."] if within else []
    sentences += [f"Of none, with the nearest: {listed(others)}."] if others else []
    return " ".join(sentences)


def read_perfect(what: str, accuracies: ByColumn) -> str:
    """The features that make no error in any draw."""
    perfect = [name for name, values in accuracies.items() if min(values) == 1.0]
    return f"{what}: {listed(perfect) or 'none'}."


def read_penalty(
    accuracies: Mapping[str, Mapping[float, Sequence[float]]], at_bound: Mapping[str, Sequence[float]], n_classes: int
) -> str:
    """The kernels that lose accuracy at the smallest penalty, and whether multipliers at their bound explain it."""
    sentences = []
    for kernel, by_penalty in accuracies.items():
        smallest, largest = min(by_penalty), max(by_penalty)
        low, high, share = fmean(by_penalty[smallest]), fmean(by_penalty[largest]), fmean(at_bound[kernel])
        if high - low < _LOST:
            sentences.append(f"{kernel} does not fall: {low:.3f} at C = {smallest:g}.")
            continue
        text = (
            f"{kernel} falls from {high:.3f} at C = {largest:g} to {low:.3f} at C = {smallest:g}, where chance is "
            f"{1 / n_classes:.3f}"
        )
        if share > _MOST:
            text += (
                f": there {share:.0%} of the multipliers of the class that lost a movement to the test are at their "
                "bound C, and the other classes, which keep all their movements, outvote it"
            )
        sentences.append(f"{text}.")
    return " ".join(sentences)


def read_left_out(names: Sequence[str]) -> str:
    """The movements that no draw contains, and the reason."""
    if not names:
        return ""
    return (
        f"Left out of all columns: {listed(names)}. They end in one dimension exactly where they start, so they have "
        "no w and no f in the original formulation."
    )


def _range(values: Sequence[float]) -> str:
    return f"{min(values):.2f}-{max(values):.2f}"
