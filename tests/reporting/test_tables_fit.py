"""Tables fit the terminal, measured in its columns, and are complete elsewhere."""

import os
import pty
import subprocess
import sys
from unicodedata import category, east_asian_width

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.reporting.table import Table, fitted, padded, to_text, width_of, wrapped

CELLS = st.text(st.sampled_from("ab 1.名é" + "e\u0301"), max_size=60)


@st.composite
def tables(draw):
    n = draw(st.integers(1, 8))
    rows = draw(st.lists(st.tuples(*[CELLS] * n), min_size=1, max_size=4))
    return Table(draw(CELLS), tuple(f"head {k}" for k in range(n)), rows)


@given(tables(), st.integers(10, 200))
def test_no_line_is_wider_than_the_terminal(table, width):
    assert all(width_of(line) <= width for line in to_text(table, width).splitlines())


@given(tables())
def test_a_table_that_fits_is_the_same_on_every_terminal_and_loses_nothing(table):
    wide = to_text(table, 2000)
    assert wide == to_text(table, 3000)
    assert all(cell.strip() in wide for row in table.rows for cell in row)


def test_columns_of_wide_characters_are_aligned():
    table = Table("", ("label", "n"), [("名前", "1"), ("cafe\u0301", "2"), ("wave", "3")])
    lines = to_text(table, 80).splitlines()
    assert [width_of(line[: line.index(mark)]) for line, mark in zip(lines[3:], "123", strict=True)] == [7, 7, 7]
    assert width_of("名前") == 4
    assert padded("名", 4) == "名  "


@pytest.mark.parametrize("width", [3, 5, 8, 20])
def test_words_too_wide_lose_their_middle(width):
    name = "recordings/名前/wave_0001.csv"
    assert width_of(fitted(name, width)) <= width
    assert fitted(name, 40) == name
    assert fitted(name, width)[0] == "r"
    assert fitted(name, width)[-1] == "v"
    assert all(width_of(line) <= width for line in wrapped(f"a {name} b", width))


def test_at_80_columns_numbers_stay_whole_and_no_row_becomes_a_list():
    heads = ("recording", "symbol", "confidence", "ranked, with p-values", "most like", "relative to it")
    name = "recordings/2024-05-06/ann/wave_recorded_in_kitchen_0001.csv"
    row = (name, "wave", "1.00", "wave 1, point 3.3e-155, circle 1e-14", name, "×1, +0°, 1 × as long")
    text = to_text(Table("", heads, [row]), 80)
    assert text.splitlines()[1].startswith("recording ")
    assert all(word in text for word in ("1.00", "3.3e-155", "1e-14", "001.csv"))
    assert "symbol: wave" in to_text(Table("", heads, [row]), 50)


def test_a_terminal_gets_what_fits_and_a_pipe_everything(tmp_path):
    program = (
        "from kineme.reporting.table import Table, to_text\n"
        "print(to_text(Table('', ('name', 'n', 'words'), [('a' * 100, '1', 'some words ' * 8)])))"
    )
    piped = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "a" * 100 in piped
    main, other = pty.openpty()
    size = {**os.environ, "COLUMNS": "60"}
    subprocess.run([sys.executable, "-c", program], stdout=other, check=True, env=size)
    os.close(other)
    shown = os.read(main, 100_000).decode()
    os.close(main)
    assert max(map(len, shown.splitlines())) <= 60
    assert "…" in shown


def test_marks_and_wide_characters_are_those_of_unicode():
    for mark in "名👋e\u0301":
        expected = 0 if category(mark) == "Mn" else 2 if east_asian_width(mark) in "WF" else 1
        assert width_of(mark) == expected
