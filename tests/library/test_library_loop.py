"""What is learned comes back: recordings, features, primitives, symbols."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import ActionLibrary


@pytest.fixture(scope="module")
def lasa():
    return kineme.load_lasa(["CShape", "Sine", "Zshape"])


def test_what_is_learned_comes_back(tmp_path, lasa):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        report = library.learn(lasa)
        back = library.movements(ids=report.ids)
        np.testing.assert_allclose(back.positions, lasa.positions, rtol=0, atol=2**-24 * np.ptp(lasa.positions))
        assert [symbol.name for symbol in library.symbols()] == ["CShape", "Sine", "Zshape"]
        assert back.labels.tolist() == lasa.labels.tolist()


def test_learning_again_does_not_duplicate(tmp_path, lasa):
    with ActionLibrary(tmp_path, create=True) as library:
        first = library.learn(lasa)
        again = library.learn(lasa)
        assert (again.added, again.known, len(library), library.version) == (0, len(lasa), len(lasa), first.version)
        assert again.ids.tolist() == first.ids.tolist()
