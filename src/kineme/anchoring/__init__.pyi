# How alike movements are
from kineme.similarity.describe import describe as describe
from kineme.similarity.describe import describe_rows as describe_rows
from kineme.similarity.similarity import similarities as similarities

# New symbols, and changed ones
from kineme.anchoring.proposals import propose as propose
from kineme.anchoring.proposals import Proposal as Proposal
from kineme.anchoring.proposals import Proposals as Proposals
from kineme.anchoring.assignment import assign as assign
from kineme.anchoring.assignment import Assignment as Assignment
from kineme.anchoring.assignment import suggest_merges as suggest_merges
from kineme.anchoring.assignment import suggest_splits as suggest_splits
from kineme.anchoring.assignment import Merge as Merge
from kineme.anchoring.assignment import Split as Split

# What follows what
from kineme.anchoring.grammar import estimate_grammar as estimate_grammar
from kineme.anchoring.grammar import most_probable as most_probable
from kineme.anchoring.grammar import Grammar as Grammar

# What symbols mean
from kineme.anchoring.grounding import prototype as prototype
from kineme.anchoring.grounding import Prototype as Prototype
from kineme.anchoring.space import conceptual_space as conceptual_space
from kineme.anchoring.space import ConceptualSpace as ConceptualSpace
from kineme.anchoring.space import morph as morph
from kineme.anchoring.grounding import ground as ground
from kineme.anchoring.grounding import SymbolName as SymbolName
from kineme.anchoring.grounding import grounding_schema as grounding_schema
from kineme.anchoring.grounding import primitive_from as primitive_from

# Pictures
from kineme.anchoring.figures import draw_map as draw_map
from kineme.anchoring.figures import draw_proposal as draw_proposal
from kineme.anchoring.figures import draw_proposals as draw_proposals
