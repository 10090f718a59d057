"""A table is the same whether NumPy's parser reads it, or some of it, or each line is read by itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import kineme
from kineme.io.tables import text_table
from kineme.io.tables.text_table import read_text_table
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes
from soaking import examples


def outcome(data, layout=Layout()):  # noqa: B008 - frozen
    """Everything that reading gives: columns, faults, roles, or the error."""
    try:
        table, roles = read_text_table(data, layout)
    except kineme.errors.DataError as error:
        return str(error)
    columns = [np.asarray(column).tolist() for column in table.columns]
    return repr(
        (table.heads, columns, table.n_rows, table.faults, roles, [table.line_of(k) for k in range(table.n_rows)])
    )


def by_lines(data, layout=Layout()):  # noqa: B008
    """The same, every line by itself."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(text_table, "try_rows", lambda *_: None)
        return outcome(data, layout)


def in_stretches(data, layout=Layout()):  # noqa: B008
    """The same, some lines at a time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(text_table, "_read_fast", lambda *_: None)
        patched.setattr(text_table, "_STRETCH", 2)
        return outcome(data, layout)


NUMBERS = (
    "0",
    "1.5",
    "-2e3",
    " 3",
    "4 ",
    "nan",
    "NaN",
    "inf",
    "-Infinity",
    "1e999",
    "",
    " ",
    "1_0",
    "٣",
    "x",
    '"7"',
    "0x1",
    "1d2",
    "+.5",
    "5.",
    "\x1c6",
    "2,5",
)
NAMES = (
    "a",
    " wave",
    "b ",
    "",
    "#1",
    "% 2",
    "//c",
    '"d"',
    '" e "',
    '"f, g"',
    '"h""i"',
    'j"k',
    '"l"m',
    '"',
    "é\u2028",
    "\x0bo",
    "null",
    "1",
    "2024-01-01T00:00:00Z",
)


@st.composite
def tables(draw):
    separator = draw(st.sampled_from([",", ";", "\t", " ", ", ", " ; "]))
    kinds = draw(st.lists(st.sampled_from(["name", "number", "number"]), min_size=1, max_size=5))
    heads = draw(
        st.sampled_from([["t", "x", "y", "label", "id"], ["id", "t", "x", "label", "z"], ["label", "t", "x", "y", "z"]])
    )
    good = draw(st.booleans())
    number = st.sampled_from(NUMBERS[:5] if good else NUMBERS)
    name = st.sampled_from(NAMES)
    lines = [separator.join(heads[: len(kinds)])] if draw(st.booleans()) else []
    for _ in range(draw(st.integers(1, 6))):
        cells = [draw(name if kind == "name" else number) for kind in kinds]
        line = separator.join(cells if draw(st.integers(0, 9)) else cells[:-1])
        lines.append(draw(st.sampled_from([line] * 6 + ["", "  ", "# a comment", "# a, b"])) if not good else line)
    return draw(st.sampled_from(["\n", "\r\n", "\r"])).join(lines) + draw(st.sampled_from(["", "\n"]))


@given(tables(), st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]), st.sampled_from([Layout(), Layout(units=0.1)]))
@settings(max_examples=examples(80, 400))
@example("label,t,x\n wave,0,1\nb ,1,2\n", "utf-8", Layout())
@example('t,x\n0,"a\n1",2\n', "utf-8", Layout())
@example("id,t,x\n#1,0,1\n#1,1,2\n#2,0,1\n", "utf-8", Layout())
@example('"t","x"\n"0",1\n"1",\n', "utf-8-sig", Layout())
@example("t,x\n0,nan\n1,\n2,3\n", "utf-8", Layout())
def test_all_paths_agree(text, encoding, layout):
    data = text.encode(encoding)
    expected = by_lines(data, layout)
    assert outcome(data, layout) == expected
    assert in_stretches(data, layout) == expected


@given(st.text(',;\t \n\r"#%/0123456789.-+eEnaif_x', max_size=120))
@settings(max_examples=examples(60, 300))
def test_all_paths_agree_on_any_text(text):
    data = text.encode()
    assert outcome(data) == in_stretches(data) == by_lines(data)


ROWS = [(name, k / 10, k * k) for name in ("one", "two") for k in range(5)]


def table_of(rows, heads="label,t,x"):
    return "\n".join([heads, *(",".join(map(str, row)) for row in rows)]).encode()


def labels_of(data):
    return tuple(read_recordings_from_bytes(data, "a.csv", Layout()).labels)


@pytest.mark.parametrize("bad", [False, True])
def test_blanks_around_a_name_do_not_belong_to_it(bad):
    rows = [(f" {name} ", t, x) for name, t, x in ROWS] + [("one", "", "")] * bad
    assert labels_of(table_of(rows)) == ("one", "two")


@pytest.mark.parametrize("mark", ["#", "%", "//"])
@pytest.mark.parametrize("first", [0, 1])
def test_a_name_may_begin_as_a_comment(mark, first):
    """Those rows were lost, and nothing said so."""
    rows = [(name if k < 5 * first else mark + name, t, x) for k, (name, t, x) in enumerate(ROWS)]
    expected = tuple(dict.fromkeys(name for name, _, _ in rows))
    assert labels_of(table_of(rows)) == expected
    assert labels_of(table_of(rows) + b"\n# made by hand\n#,\n%a,b,c\n") == expected


@pytest.mark.parametrize("mark", ["#", "%", "//"])
def test_a_row_of_numbers_may_be_commented_out(mark):
    rows = [(k / 10, k, k * k) for k in range(9)]
    data = table_of(rows, "t,x,y") + f"\n{mark}0.9,9,81\n{mark} 1.0,10,100\n".encode()
    assert len(read_recordings_from_bytes(data, "a.csv", Layout()).demonstrations[0]) == 9


def test_a_cell_longer_than_pythons_reader_allows():
    long = "x" * 200_000
    rows = [(f'"{long}"', *row[1:]) for row in ROWS[:5]]
    assert labels_of(table_of(rows)) == (long,)
    assert labels_of(table_of([*rows, ("a", "", "")])) == (long,)
