"""Damaged files of every format are read right or refused in words; nothing crashes, hangs or eats the memory."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from file_mutants import mutant, samples

from limited_child import MIB, LimitedChild

MODULES = ("kineme", "file_mutants", "scipy.io", "pyarrow.parquet", "rosbags.rosbag1", "rosbags.rosbag2")


@pytest.mark.parametrize("name", samples())
def test_mutants(tmp_path, fuzz_seed, fuzz_rounds, name):
    rng = np.random.default_rng([fuzz_seed, zlib.crc32(name.encode())])
    found: dict[str, int] = {}
    with LimitedChild(MODULES, memory=512 * MIB, seconds=20.0) as child:
        for k in range(fuzz_rounds):
            data = mutant(rng, samples()[name], name)
            outcome = child.call("file_mutants:read_mutant", name, data)
            found[outcome.how] = found.get(outcome.how, 0) + 1
            if not outcome.is_good:
                (tmp_path / name).write_bytes(data)
                pytest.fail(f"seed {fuzz_seed}, round {k}, kept in {tmp_path / name}: {outcome.how}\n{outcome.what}")
    assert found.get("refused")
