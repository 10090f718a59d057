# An archive in pieces
from kineme.pieces.planning import plan as plan
from kineme.pieces.planning import Plan as Plan
from kineme.pieces.planning import Piece as Piece

# A function over all pieces, and what it left in a folder
from kineme.pieces.mapping import map as map  # noqa: A004
from kineme.pieces.run import Outcome as Outcome
from kineme.pieces.gather import check as check
from kineme.pieces.gather import Checked as Checked
