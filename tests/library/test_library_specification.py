"""What a library is made with: whatever can be made can be opened again, and what cannot be used is not made."""

from __future__ import annotations

import pytest

from kineme import DMP, ActionLibrary, Recognizer
from kineme.errors import SpecificationError
from kineme.movements.preparation.resample import Resample


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
