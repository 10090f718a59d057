"""Every measured value as one row of a tidy table."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from kineme.reporting.text import as_cell
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.score_split import Scores


class Row(NamedTuple):
    """One value.

    Attributes
    ----------
    data, protocol, condition : str
        What was measured: the name of the data set, and where the value stands in the tables.
    varied : str
        What the conditions of this kind vary, for example "shots".
    strength : float
        By how much.
    measure, method : str
    split : int
    person : str
        Whose movements were tested; "" for everybody's.
    value : float
        In six digits, which do not depend on the order of summation.
    """

    data: str
    protocol: str
    condition: str
    varied: str
    strength: float
    measure: str
    method: str
    split: int
    person: str
    value: float


def make_rows(data: DataSet, scores: Mapping[Any, list[Scores]]) -> list[Row]:
    """The rows of all jobs, (protocol, method, index of the split) -> scores."""
    rows = []
    for (protocol, method, split), own in scores.items():
        person = PROTOCOLS[protocol].person(data, split)
        for condition, values, _ in own:
            where = (data.name, protocol, condition.label, condition.varied, condition.strength)
            rows += [
                Row(*where, measure, method, split, person, float(f"{value:.6g}")) for measure, value in values.items()
            ]
    return rows


def to_csv(rows: Sequence[Row]) -> str:
    """The rows with a head, as comma-separated values."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Row._fields)
    writer.writerows([as_cell(one) if isinstance(one, str) else one for one in row] for row in rows)
    return text.getvalue()
