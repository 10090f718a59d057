# Features of an archive in shards, and the nearest movements among them
from kineme.pieces.search import open_shards as open_shards
from kineme.pieces.search import Shards as Shards
from kineme.pieces.search import Near as Near
from kineme.pieces.shards import fit_reduction as fit_reduction
from kineme.pieces.shards import write_reduction as write_reduction
from kineme.pieces.shards import write_shard as write_shard
