# Kernels
from kineme.kernels.base import Kernel as Kernel
from kineme.kernels.table import RBF as RBF
from kineme.kernels.table import TruncatedEuclidean as TruncatedEuclidean
from kineme.kernels.table import Laplacian as Laplacian
from kineme.kernels.table import Canberra as Canberra
from kineme.kernels.table import DistanceKernel as DistanceKernel
from kineme.kernels.table import averaged as averaged
from kineme.kernels.table import Averaged as Averaged
from kineme.kernels.random_binning import RandomBinning as RandomBinning

# Tables
from kineme.kernels.table import KERNELS as KERNELS
from kineme.kernels.table import MEANS as MEANS
from kineme.kernels.table import PAPER_WIDTHS as PAPER_WIDTHS
