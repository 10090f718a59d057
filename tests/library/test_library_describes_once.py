"""How often movements are described: once when they are learned or asked about, and never again."""

from __future__ import annotations

import numpy as np
import pytest
from library_samples import draw_movements

import kineme.anchoring
from kineme import ActionLibrary, Recognizer
from kineme.library.recognize import LibraryRecognizer
from kineme.similarity import describe


@pytest.fixture
def described(monkeypatch):
    """Counts the movements that are described."""
    counted, tile_rows = [], describe._tile_rows

    def count(demos, start, stop, *how):
        counted.append(stop - start)
        return tile_rows(demos, start, stop, *how)

    monkeypatch.setattr(describe, "_tile_rows", count)

    def since():
        n = sum(counted)
        counted.clear()
        return n

    return since


def _movements(labeled=24, unlabeled=8):
    """Three classes of near copies; the last ones have no label."""
    rng, shapes = np.random.default_rng(0), draw_movements(3, seed=1)
    which = np.arange(labeled + unlabeled) % 3
    arrays = [shapes[k].positions + 0.02 * rng.normal(size=(1, 2)) * shapes[k].positions for k in which]
    return arrays, [f"class {k}" if i < labeled else None for i, k in enumerate(which)]


def test_a_movement_is_described_when_it_is_learned_and_when_it_is_asked_about(tmp_path, described):
    arrays, labels = _movements()
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(arrays, labels)
        assert described() == len(arrays)
        library.learn(arrays, labels)
        assert described() == 0
        library.recognize(arrays[:5])
        assert described() == 5
        LibraryRecognizer(library.store, exhaustive=0).current()
        n_sampled = described()
        LibraryRecognizer(library.store, exhaustive=0).recognize(arrays[:5])
        assert described() == n_sampled + 5


def test_what_is_stored_is_proposed_assigned_and_reviewed_by_its_features(tmp_path, described):
    arrays, labels = _movements()
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(arrays, labels)
        described()
        library.propose()
        library.propose(method="agglomerative")
        library.review()
        library.nearest("class 0")
        library.join()
        assert described() == 0
        assert len(library.unlabeled()) < 8


def test_anchoring_describes_each_movement_once(described):
    arrays, labels = _movements()
    recognizer = Recognizer().fit(arrays[:24], labels[:24])
    assert described() == 24
    assigned = kineme.anchoring.assign(arrays[24:], recognizer)
    assert described() == 8
    assert len(assigned.labels) == 8
    kineme.anchoring.propose(arrays)
    assert described() == len(arrays)
    kineme.anchoring.suggest_splits(arrays[:24], labels[:24])
    assert described() == 24
