"""A few damaged and hostile libraries, always the same; `make fuzz` tries others."""

from __future__ import annotations

import numpy as np
import pytest
from library_mutants import MUTANTS, exported, read_mutant

from kineme.errors import KinemeError


@pytest.mark.parametrize("kind", MUTANTS)
def test_what_is_read_of_a_mutant_is_good_or_refused(kind):
    rng = np.random.default_rng(7)
    read = refused = 0
    for _ in range(12):
        try:
            read += read_mutant(MUTANTS[kind](rng, exported())) > 0
        except KinemeError:
            refused += 1
    assert refused > 5
    assert read + refused == 12
