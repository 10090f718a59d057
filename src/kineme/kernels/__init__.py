"""Distance-based kernels: feature rows in, Gram matrices out (Section 3.2)."""

from kineme.kernels.average import Averaged, averaged
from kineme.kernels.base import Kernel
from kineme.kernels.canberra import Canberra
from kineme.kernels.distance import DistanceKernel
from kineme.kernels.laplacian import Laplacian
from kineme.kernels.means import MEANS
from kineme.kernels.presets import PAPER_WIDTHS
from kineme.kernels.rbf import RBF
from kineme.kernels.table import KERNELS
from kineme.kernels.truncated import TruncatedEuclidean

__all__ = [
    "KERNELS",
    "MEANS",
    "PAPER_WIDTHS",
    "RBF",
    "Averaged",
    "Canberra",
    "DistanceKernel",
    "Kernel",
    "Laplacian",
    "TruncatedEuclidean",
    "averaged",
]
