"""What a library is made with: whatever can be made can be opened again, and what cannot be used is not made."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from kineme import DMP, ActionLibrary, Recognizer
from kineme.errors import SpecificationError
from kineme.library.storage.connection import FILE
from kineme.library.storage.rows import seal
from kineme.movements.preparation.resample import Resample
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, ROW_REPRESENTATIONS
from movement_samples import draw_shapes


@pytest.mark.parametrize(
    "made_with",
    [
        {"dmp": DMP("bio-inspired", fit="trajectory", n_basis=40, stiffness=250_000)},  # a whole number, no size
        {"dmp": DMP("bio-inspired", fit="trajectory", n_basis=40, preprocessing=(Resample(200_000),))},
        {"recognizer": Recognizer(cutoff=200_000)},
        {"recognizer": Recognizer(weights=(1_000_000, 1, 0, 0, 0, 0, 0))},
        {"recognizer": Recognizer(max_angle=0)},
    ],
    ids=["stiffness", "resample", "cutoff", "weights", "max_angle"],
)
def test_a_library_with_large_numbers_is_opened_again(tmp_path, made_with):
    with ActionLibrary(tmp_path / "actions", create=True, **made_with) as library:
        specification = library.specification
    with ActionLibrary(tmp_path / "actions") as library:
        assert library.specification == specification


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"cutoff": 1e-20}, "cutoff"),
        ({"scale": "size"}, "scale"),
        ({"translation": 1}, "translation"),
        ({"mean": "median"}, "mean"),
        ({"classifier": "tree"}, "classifier"),
        ({"max_angle": -1.0}, "max_angle"),
        ({"weights": (1.0,)}, "weights"),
        ({"weights": (1.0, -1.0, 1.0)}, "weights"),
        ({"representations": ()}, "representations"),
    ],
)
def test_no_library_is_made_that_could_not_be_opened(tmp_path, parameters, message):
    with pytest.raises(SpecificationError, match=message):
        ActionLibrary(tmp_path / "actions", create=True, recognizer=Recognizer(**parameters))
    assert not (tmp_path / "actions").exists()


def _without_details(folder):
    """Write what a library said that could not tell yet whether movements are signals, or in detail."""
    with closing(sqlite3.connect(folder / FILE)) as connection, connection:
        (text,) = connection.execute("SELECT value FROM meta WHERE key = 'recognizer'").fetchone()
        meta = json.loads(text)
        assert meta.pop("weights") == "own"
        for fields in meta["representations"]:
            assert (fields.pop("detailed"), fields.pop("signal")) == (False, False)
        text = json.dumps(meta | {"weights": "auto"})
        row = (text, seal("meta", ("recognizer", text)))
        connection.execute("UPDATE meta SET value = ?, crc = ? WHERE key = 'recognizer'", row)


@pytest.mark.parametrize("d", [1, 2])
@pytest.mark.parametrize("representations", [DEFAULT_REPRESENTATIONS[:5], ROW_REPRESENTATIONS], ids=["five", "rows"])
def test_a_library_stored_before_answers_as_before(tmp_path, d, representations):
    """Signals stay paths, and weights those of the representations, however many movements are shown."""
    as_paths = tuple(replace(one, signal=False) for one in representations)
    demos, asked = draw_shapes([4, 3, 5], d, spread=0.5), draw_shapes([2, 2, 2], d, spread=0.8)
    recognizer = Recognizer(as_paths, weights="own")
    with ActionLibrary(tmp_path / "actions", create=True, recognizer=recognizer) as library:
        library.learn(demos)
        features = library.features()
    _without_details(tmp_path / "actions")
    with ActionLibrary(tmp_path / "actions") as library:
        assert library.verify() == []
        np.testing.assert_array_equal(library.features(), features)
        assert library.specification.representations == as_paths
        assert library.specification.weights == "own"
        answers = library.recognize(asked)
        again = library.learn(demos[:1]).ids
        np.testing.assert_array_equal(library.features(again)[0], features[0])
    expected = recognizer.fit(demos).recognize(asked)
    for ours, theirs in zip(answers, expected, strict=True):
        assert (ours.label, ours.ranked) == (theirs.label, theirs.ranked)
        assert ours.nearest[0].similarity == pytest.approx(theirs.nearest[0].similarity, abs=1e-4)
        assert ours.responsibilities == pytest.approx(theirs.responsibilities, abs=1e-3)


def test_a_library_says_that_movements_are_signals_or_in_detail(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        specification = library.specification
    with ActionLibrary(tmp_path / "actions") as library:
        assert library.specification == specification
        assert library.specification.representations == DEFAULT_REPRESENTATIONS
        assert library.specification.weights == "auto"
