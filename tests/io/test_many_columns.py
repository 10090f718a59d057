"""Tables of thousands of columns take time in proportion to them."""

from __future__ import annotations

import time

import pytest

import kineme
from kineme.movements.tables.columns import choose_roles
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

HEADS = ["t", *(f"v_{k}" for k in range(8000))]


@pytest.mark.parametrize("columns", [None, HEADS[1:], [head.upper() for head in HEADS[1:]]])
def test_roles_of_eight_thousand_columns(columns):
    begin = time.process_time()
    roles = choose_roles(HEADS, ["number"] * len(HEADS), Layout(columns=columns))
    assert roles.positions == tuple(range(1, 8001))
    assert time.process_time() - begin < 4  # 0.1 s; 40 s where every head looks through all others


def test_velocities_of_thousands_of_columns_are_left_aside():
    heads = ["t", *(f"{prefix}{k}" for k in range(4000) for prefix in ("q", "v_q"))]
    begin = time.process_time()
    roles = choose_roles(heads, ["number"] * len(heads), Layout())
    assert roles.positions == tuple(range(1, 8001, 2))
    assert time.process_time() - begin < 4


def test_a_message_shows_some_of_thousands_of_columns():
    with pytest.raises(kineme.errors.DataError, match=r"got the columns .* and 7961 more; say which") as caught:
        choose_roles([*HEADS[1:], "w"], ["number"] * len(HEADS), Layout())
    assert len(str(caught.value)) < 2000
    with pytest.raises(kineme.errors.DataError, match=r"no entry 'positions' but .* and 1960 more") as caught:
        read_recordings_from_bytes(b"{" + b",".join(b'"q%d":1' % k for k in range(2000)) + b"}", "a.json", Layout())
    assert len(str(caught.value)) < 2000
