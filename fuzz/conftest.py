"""Random damage: every run another seed, which the header shows and `FUZZ_SEED` sets; `FUZZ_ROUNDS` is the effort."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS), *(str(TESTS / part) for part in ("io", "library"))]

SEED = int(os.environ.get("FUZZ_SEED") or time.time_ns() % 2**32)
ROUNDS = int(os.environ.get("FUZZ_ROUNDS") or 400)


def pytest_report_header():
    return f"fuzz: FUZZ_SEED={SEED} FUZZ_ROUNDS={ROUNDS}"


@pytest.fixture(scope="session")
def fuzz_seed():
    return SEED


@pytest.fixture(scope="session")
def fuzz_rounds():
    """Mutants of each sample."""
    return ROUNDS
