"""Anchoring: movements gathered into symbols, and symbols brought back to movements. Arrays in, records out."""

from typing import Any as _Any

from kineme.anchoring.grounding.ground import SymbolName, ground
from kineme.anchoring.grounding.grounding_io import grounding_schema, primitive_from
from kineme.anchoring.grounding.morph import morph
from kineme.anchoring.grounding.prototypes import Prototype, prototype
from kineme.anchoring.grounding.space import ConceptualSpace, conceptual_space
from kineme.anchoring.proposals.assign import Placement, place
from kineme.anchoring.proposals.merge_split import Merge, Split, suggest_merges, suggest_splits
from kineme.anchoring.proposals.proposals import Proposal, Proposals
from kineme.anchoring.proposals.propose import propose
from kineme.comparison.describe import describe as see
from kineme.comparison.describe import describe_rows as see_rows
from kineme.comparison.similarity import similarities

_PICTURES = {  # Matplotlib loads on first use, not with the numbers
    "draw_map": "symbol_map",
    "draw_proposal": "proposal",
    "draw_proposals": "proposal_sheet",
}

__all__ = [
    "ConceptualSpace",
    "Merge",
    "Placement",
    "Proposal",
    "Proposals",
    "Prototype",
    "Split",
    "SymbolName",
    "conceptual_space",
    "draw_map",
    "draw_proposal",
    "draw_proposals",
    "ground",
    "grounding_schema",
    "morph",
    "place",
    "primitive_from",
    "propose",
    "prototype",
    "see",
    "see_rows",
    "similarities",
    "suggest_merges",
    "suggest_splits",
]


def __getattr__(name: str) -> _Any:
    if name not in _PICTURES:
        raise AttributeError(f"module 'kineme.anchoring' has no attribute {name!r}; it has {', '.join(__all__)}")
    from importlib import import_module

    return getattr(import_module(f"kineme.anchoring.figures.{_PICTURES[name]}"), name)
