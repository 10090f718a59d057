"""The widths of the paper, Table 3."""

from __future__ import annotations

from typing import NamedTuple

from kineme.kernels.rbf import RBF
from kineme.kernels.truncated import TruncatedEuclidean


class PaperKernels(NamedTuple):
    """The two kernels that the paper applies to one feature of one formulation."""

    rbf: RBF
    truncated: TruncatedEuclidean


#: (feature, formulation), as `DMPFeatures` and `DMP` name them -> the kernels of the paper, Table 3.
PAPER_WIDTHS: dict[tuple[str, str], PaperKernels] = {
    ("weights", "original"): PaperKernels(RBF(500), TruncatedEuclidean(750, 1)),
    ("weights", "bio-inspired"): PaperKernels(RBF(3.5e7), TruncatedEuclidean(1e7, 1)),
    ("forcing", "original"): PaperKernels(RBF(6e4), TruncatedEuclidean(1e4, 1)),
    ("forcing", "bio-inspired"): PaperKernels(RBF(7000), TruncatedEuclidean(350, 1)),
}
