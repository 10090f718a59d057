# How alike movements are
from kineme.similarity.describe import describe as describe
from kineme.similarity.describe import describe_rows as describe_rows
from kineme.similarity.similarity import similarities as similarities

# New symbols, and changed ones
from kineme.anchoring.proposals.propose import propose as propose
from kineme.anchoring.proposals.proposals import Proposal as Proposal
from kineme.anchoring.proposals.proposals import Proposals as Proposals
from kineme.anchoring.proposals.assign import assign as assign
from kineme.anchoring.proposals.assign import Assignment as Assignment
from kineme.anchoring.proposals.merge_split import suggest_merges as suggest_merges
from kineme.anchoring.proposals.merge_split import suggest_splits as suggest_splits
from kineme.anchoring.proposals.merge_split import Merge as Merge
from kineme.anchoring.proposals.merge_split import Split as Split

# What symbols mean
from kineme.anchoring.grounding.prototypes import prototype as prototype
from kineme.anchoring.grounding.prototypes import Prototype as Prototype
from kineme.anchoring.grounding.space import conceptual_space as conceptual_space
from kineme.anchoring.grounding.space import ConceptualSpace as ConceptualSpace
from kineme.anchoring.grounding.morph import morph as morph
from kineme.anchoring.grounding.ground import ground as ground
from kineme.anchoring.grounding.ground import SymbolName as SymbolName
from kineme.anchoring.grounding.grounding_io import grounding_schema as grounding_schema
from kineme.anchoring.grounding.grounding_io import primitive_from as primitive_from

# Pictures
from kineme.anchoring.figures.symbol_map import draw_map as draw_map
from kineme.anchoring.figures.proposal import draw_proposal as draw_proposal
from kineme.anchoring.figures.all_proposals import draw_proposals as draw_proposals
