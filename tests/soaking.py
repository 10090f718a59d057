"""What `make test` leaves to `make soak`: more examples, and combinations of values that are each tried with others."""

from __future__ import annotations

import os
from itertools import combinations, product

SOAK = "KINEME_SOAK" in os.environ


def examples(usual, soaked=60):
    """How many examples hypothesis draws."""
    return soaked if SOAK else usual


def combined(*columns, together=2):
    """Rows of values, one of each column: as few as try each value with each other one of `together` columns at a time.

    With `together=1` each value is tried with some others. All rows under `make soak`.
    """
    rows = list(product(*columns))
    if SOAK or together >= len(columns):
        return rows
    places = list(combinations(range(len(columns)), together))
    of_row = {i: {(place, tuple(map(repr, (row[k] for k in place)))) for place in places} for i, row in enumerate(rows)}
    missing, chosen = set().union(*of_row.values()), []
    while missing:
        best = max(of_row, key=lambda i: len(of_row[i] & missing))
        missing -= of_row[best]
        chosen.append(best)
    return [rows[i] for i in sorted(chosen)]
