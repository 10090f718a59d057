"""Damaged and hostile libraries are read right or refused in words; nothing crashes, hangs or eats the memory."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from library_mutants import MUTANTS, exported

from limited_child import MIB, LimitedChild

MODULES = (
    "kineme",
    "library_mutants",
    "sklearn.svm",
    "kineme.anchoring.propose",
    "kineme.recognition.recognizer",
)


@pytest.mark.parametrize("kind", MUTANTS)
def test_mutants(tmp_path, fuzz_seed, fuzz_rounds, kind):
    rng = np.random.default_rng([fuzz_seed, zlib.crc32(kind.encode())])
    found: dict[str, int] = {}
    with LimitedChild(MODULES, memory=512 * MIB, seconds=60.0) as child:
        for k in range(fuzz_rounds):
            data = MUTANTS[kind](rng, exported())
            outcome = child.call("library_mutants:read_mutant", data)
            found[outcome.how] = found.get(outcome.how, 0) + 1
            if not outcome.is_good:
                (tmp_path / "export").write_bytes(data)
                pytest.fail(
                    f"seed {fuzz_seed}, round {k}, kept in {tmp_path / 'export'}: {outcome.how}\n{outcome.what}"
                )
    assert found.get("refused")
    assert found.get("done")
