# An archive in pieces
from kineme.pieces.planning import plan as plan
from kineme.pieces.planning import Plan as Plan
from kineme.pieces.planning import Piece as Piece

# A function over all pieces, and what it left in a folder
from kineme.pieces.mapping import map as map  # noqa: A004
from kineme.pieces.run import Outcome as Outcome
from kineme.pieces.gather import check as check
from kineme.pieces.gather import Checked as Checked

# Features of an archive in shards, and the nearest movements among them
from kineme.pieces.search import open_shards as open_shards
from kineme.pieces.search import Shards as Shards
from kineme.pieces.search import Near as Near
from kineme.pieces.shards import fit_reduction as fit_reduction
from kineme.pieces.shards import write_reduction as write_reduction
from kineme.pieces.shards import write_shard as write_shard
