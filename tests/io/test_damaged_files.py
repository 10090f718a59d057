"""A small part of `make fuzz`, always the same: damaged files of every format, in a child with little memory."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from file_mutants import mutant, samples

from limited_child import MIB, LimitedChild
from soaking import SOAK

ROUNDS = 40 if SOAK else 12


@pytest.fixture(scope="module")
def child():
    with LimitedChild(("kineme", "file_mutants", "pyarrow.parquet"), memory=512 * MIB, seconds=20.0) as child:
        yield child


@pytest.mark.parametrize("name", samples())
def test_whole_files_are_read_and_damaged_ones_refused_in_words(child, name):
    assert child.call("file_mutants:read_mutant", name, samples()[name]).how == "done"
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    outcomes = [child.call("file_mutants:read_mutant", name, mutant(rng, samples()[name], name)) for _ in range(ROUNDS)]
    assert [outcome for outcome in outcomes if not outcome.is_good] == []
    assert any(outcome.how == "refused" for outcome in outcomes)


@pytest.mark.soak
def test_metadata_that_end_the_process_are_not_asked_for(child):
    """pyarrow aborts on damaged statistics of columns, if one looks at them."""
    data = samples()["wide.parquet"]
    begin = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    for at in range(begin, len(data), 2 if SOAK else 20):
        spoiled = data[:at] + bytes((data[at] ^ 3,)) + data[at + 1 :]
        outcome = child.call("file_mutants:read_mutant", "wide.parquet", spoiled)
        assert outcome.is_good, (at, outcome)
