"""Anchoring: movements gathered into symbols, and symbols brought back to movements. Arrays in, records out."""

from typing import Any as _Any

from kineme.anchoring.grounding.ground import SymbolName, ground
from kineme.anchoring.grounding.grounding_io import grounding_schema, primitive_from
from kineme.anchoring.grounding.morph import morph
from kineme.anchoring.grounding.prototypes import Prototype, prototype
from kineme.anchoring.grounding.space import ConceptualSpace, conceptual_space
from kineme.anchoring.proposals.assign import Assignment, assign
from kineme.anchoring.proposals.merge_split import Merge, Split, suggest_merges, suggest_splits
from kineme.anchoring.proposals.proposals import Proposal, Proposals
from kineme.anchoring.proposals.propose import propose
from kineme.comparison.describe import describe, describe_rows
from kineme.comparison.similarity import similarities

_PICTURES = {  # Matplotlib loads on first use, not with the numbers
    "draw_map": "symbol_map",
    "draw_proposal": "proposal",
    "draw_proposals": "all_proposals",
}
_RENAMED = {"Placement": "Assignment", "place": "assign", "see": "describe", "see_rows": "describe_rows"}

__all__ = [
    "Assignment",
    "ConceptualSpace",
    "Merge",
    "Proposal",
    "Proposals",
    "Prototype",
    "Split",
    "SymbolName",
    "assign",
    "conceptual_space",
    "describe",
    "describe_rows",
    "draw_map",
    "draw_proposal",
    "draw_proposals",
    "ground",
    "grounding_schema",
    "morph",
    "primitive_from",
    "propose",
    "prototype",
    "similarities",
    "suggest_merges",
    "suggest_splits",
]


def __getattr__(name: str) -> _Any:
    from importlib import import_module
    from warnings import warn

    if name in _RENAMED:
        new = _RENAMED[name]
        warn(f"kineme.anchoring.{name} is now kineme.anchoring.{new}", DeprecationWarning, stacklevel=2)
        return globals()[new]
    if name not in _PICTURES:
        raise AttributeError(f"module 'kineme.anchoring' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(f"kineme.anchoring.figures.{_PICTURES[name]}"), name)
