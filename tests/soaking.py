"""What `make test` leaves to `make soak`: more examples, slow repetitions, and all combinations of values.

A repetition is marked `pytest.mark.soak`, a test or some of its parameters. Marked `pytest.mark.soak("combinations")`,
a test whose parametrizations are stacked tries each value of each of them with some values of the others; `combined`
does so within one of them.
"""

from __future__ import annotations

import os
from collections import defaultdict
from itertools import chain, combinations, product

import pytest

SOAK = "KINEME_SOAK" in os.environ


def examples(usual, soaked=60):
    """How many examples hypothesis draws."""
    return soaked if SOAK else usual


def slow(*values):
    """A row of parameters that `make soak` alone tries."""
    return pytest.param(*values, marks=pytest.mark.soak)


def some(values, *usual):
    """Values of one parameter, of which `make test` tries those at the places `usual`."""
    values = list(values)
    chosen = [values[i] for i in usual]
    return [value if value in chosen else slow(value) for value in values]


def combined(*columns, together=2):
    """Rows of values, one of each column: as few as try each value with each other one of `together` columns at a time.

    With `together=1` each value is tried with some others. All rows under `make soak`.
    """
    rows = list(product(*columns))
    if SOAK or together >= len(columns):
        return rows
    return [rows[i] for i in _covering([tuple(map(repr, row)) for row in rows], together)]


def _covering(rows, together=1):
    """Places of as few rows as hold all that `together` columns hold in all rows; of equal rows that with new pairs."""
    places = list(combinations(range(len(rows[0])), together))
    pairs = list(combinations(range(len(rows[0])), together + 1))
    of_row = [{(place, *(row[k] for k in place)) for place in places} for row in rows]
    beside = [{(place, *(row[k] for k in place)) for place in pairs} for row in rows]
    missing, new, chosen = set().union(*of_row), set().union(*beside), []
    while missing:
        best = max(range(len(rows)), key=lambda i: (len(of_row[i] & missing), len(beside[i] & new)))
        missing -= of_row[best]
        new -= beside[best]
        chosen.append(best)
    return sorted(chosen)


def left_to_soak(items):
    """Collected tests that `make soak` alone runs."""
    left, stacked = [], defaultdict(list)
    for item in items:
        marks = [mark.args for mark in item.iter_markers("soak")]
        if () in marks:
            left.append(item)
        elif ("combinations",) in marks:
            stacked[item.parent, item.originalname].append(item)
    for cases in stacked.values():
        columns = [_names(mark.args[0]) for mark in cases[0].iter_markers("parametrize")]
        columns += [[name] for name in cases[0].callspec.params if name not in chain(*columns)]  # of fixtures
        rows = [[tuple(id(case.callspec.params[name]) for name in column) for column in columns] for case in cases]
        chosen = set(_covering(rows))
        left += [case for i, case in enumerate(cases) if i not in chosen]
    return left


def _names(argnames):
    return [name.strip() for name in argnames.split(",")] if isinstance(argnames, str) else argnames
