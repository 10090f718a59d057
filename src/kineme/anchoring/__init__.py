"""Anchoring: movements gathered into symbols, and symbols brought back to movements. Arrays in, records out."""

from typing import Any as _Any

from kineme.anchoring.ground import SymbolName, ground
from kineme.anchoring.morph import morph
from kineme.anchoring.place import Placement, place
from kineme.anchoring.proposals import Proposal, Proposals
from kineme.anchoring.propose import propose
from kineme.anchoring.prototypes import Prototype, prototype
from kineme.anchoring.regain import grounding_schema, primitive_from
from kineme.anchoring.revise import Merge, Split, suggest_merges, suggest_splits
from kineme.anchoring.seen import see, see_rows
from kineme.anchoring.similarities import similarities
from kineme.anchoring.space import ConceptualSpace, conceptual_space

_PICTURES = {  # Matplotlib loads on first use, not with the numbers
    "draw_map": "map_figure",
    "draw_proposal": "proposal_figure",
    "draw_proposals": "sheet_figure",
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

    return getattr(import_module(f"kineme.anchoring.{_PICTURES[name]}"), name)
