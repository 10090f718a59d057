"""Names of earlier versions work, and say what they are called now."""

from __future__ import annotations

import pytest

import kineme.anchoring
from kineme.anchoring.grounding.space import conceptual_space
from unlabeled_samples import draw_kinds

RENAMED = {"place": "assign", "Placement": "Assignment", "see": "describe", "see_rows": "describe_rows"}


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_old_names_lead_to_the_new_ones(old, new):
    with pytest.warns(DeprecationWarning, match=rf"kineme\.anchoring\.{old} is now kineme\.anchoring\.{new}"):
        assert getattr(kineme.anchoring, old) is getattr(kineme.anchoring, new)
    assert old not in kineme.anchoring.__all__
    assert new in kineme.anchoring.__all__


def test_the_index_of_a_symbol_was_its_place():
    space = conceptual_space("ab", draw_kinds([1, 1]))
    with pytest.warns(DeprecationWarning, match=r"ConceptualSpace\.place is now ConceptualSpace\.index"):
        assert space.place("b") == space.index("b") == 1
