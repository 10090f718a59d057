"""One long text costs its own length, not that of a table as wide as it."""

from __future__ import annotations

import tracemalloc

import pytest
from library_samples import draw_movements

from kineme import ActionLibrary
from kineme.errors import SpecificationError
from kineme.library.storage.schema import MAX_TEXT

LONG = 1 << 20


@pytest.fixture(scope="module")
def long_labeled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("long") / "actions"
    with ActionLibrary(folder, create=True) as library:
        library.learn(draw_movements(200, n_samples=8), labels=["x" * LONG, *["wave", "nod"] * 99, "wave"])
    return folder


@pytest.mark.parametrize(
    "read",
    [
        lambda library: library.movements().labels,
        lambda library: library.primitives().labels,
        lambda library: library.recognize(library.movements(ids=[2, 3])),
        lambda library: library.review(),
        lambda library: library.join(),
        lambda library: library.nearest("wave"),
    ],
)
def test_one_long_name_does_not_make_all_as_wide(long_labeled, read):
    """An array of texts would take 200 times 4 MiB."""
    with ActionLibrary(long_labeled, read_only=True) as library:
        tracemalloc.start()
        try:
            read(library)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
    assert peak < 60 * LONG


def test_a_text_that_no_library_holds_is_refused_before_it_is_stored(tmp_path):
    huge = "x" * (MAX_TEXT + 1)
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(4, n_samples=8, labels=["wave", "nod"] * 2))
        for store in (
            lambda: library.rename("wave", huge),
            lambda: library.learn(draw_movements(1, seed=1, n_samples=8), labels=[huge]),
            lambda: library.assign([1], huge),
            lambda: library.annotate("wave", 4 * huge),
        ):
            with pytest.raises(SpecificationError, match=r"expected a (name|description) of at most [\d,]+ bytes, got"):
                store()
        assert library.version == 1
        assert library.verify() == []
