"""Tables of annotations are written some annotations at a time, as the same bytes."""

from __future__ import annotations

import json
import weakref

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.io.writing.annotations import WRITERS, Annotation, as_row, to_csv

_TEXTS = st.text(max_size=9) | st.just("\ud800, \n")
_TIMES = st.floats(0, 1e9)
_NOTES = st.builds(Annotation, _TEXTS, _TEXTS, _TIMES, _TIMES, _TEXTS | st.none(), st.floats(0, 1), st.floats(0, 1))


@given(st.lists(st.lists(_NOTES, max_size=4), max_size=4))
def test_parts_are_one_table(tmp_path_factory, parts):
    folder = tmp_path_factory.mktemp("tables")
    notes = [note for part in parts for note in part]
    said = json.dumps([as_row(note) for note in notes], ensure_ascii=False, indent=1) + "\n"
    expected = {"csv": to_csv(notes), "json": said.encode("utf-8", "backslashreplace")}
    for name, data in expected.items():
        assert WRITERS[name].stream(folder / name, parts).read_bytes() == data
        assert WRITERS[name].write(folder / name, notes, None).read_bytes() == data


class _Part(list):
    pass


@pytest.mark.parametrize("name", ["csv", "json"])
def test_one_part_is_in_memory_at_a_time(tmp_path, name):
    held = []

    def parts():
        for k in range(5):
            part = _Part([Annotation(f"{k}.csv", "", 0.0, 1.0, "wave", 0.5, 0.9)])
            held.append(weakref.ref(part))
            yield part
            del part
            assert sum(each() is not None for each in held) <= 1

    WRITERS[name].stream(tmp_path / name, parts())
    assert len(held) == 5
