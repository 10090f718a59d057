"""The kernels by name, with their properties, and those of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kineme.kernels.base import Kernel
from kineme.kernels.canberra import Canberra
from kineme.kernels.laplacian import Laplacian
from kineme.kernels.means import MEANS
from kineme.kernels.rbf import RBF
from kineme.kernels.truncated import TruncatedEuclidean


@dataclass(frozen=True)
class KernelRow:
    """One kernel that can be built from its name.

    Attributes
    ----------
    kernel : type
        Called without arguments it takes its widths from the data.
    formula, equation : str
        Equation number of the paper, empty where the paper has none.
    psd : bool
        Whether it is proved positive semi-definite for all its parameters.
    infinitely_divisible : bool
        Whether its powers k^t, t > 0, are proved so too.
    """

    kernel: type[Kernel]
    formula: str
    equation: str
    psd: bool
    infinitely_divisible: bool

    @property
    def widths(self) -> tuple[str, ...]:
        """Names of the parameters of the kernel."""
        return self.kernel._width_names()

    @property
    def psd_means(self) -> tuple[str, ...]:
        """Means of `MEANS` whose average of this kernel is proved positive semi-definite."""
        proved = {"always": self.psd, "infinitely divisible": self.infinitely_divisible, "not claimed": False}
        return tuple(name for name, mean in MEANS.items() if proved[mean.psd])


#: Name of a kernel -> its class, its formula, and what is proved of it.
KERNELS: dict[str, KernelRow] = {
    "rbf": KernelRow(RBF, "exp(-‖x - y‖² / (2 σ²))", "(6)", psd=True, infinitely_divisible=True),
    "truncated": KernelRow(
        TruncatedEuclidean,
        "1/n Σ max(0, m - min(m, |x_i - y_i|) / σ)",
        "(7)-(8)",
        psd=True,
        infinitely_divisible=False,
    ),
    "laplacian": KernelRow(Laplacian, "exp(-Σ |x_i - y_i| / σ)", "", psd=True, infinitely_divisible=True),
    "canberra": KernelRow(
        Canberra, "1/n Σ (1 - |x_i - y_i| / (|x_i| + |y_i|))", "", psd=True, infinitely_divisible=False
    ),
}


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
for _kernels in PAPER_WIDTHS.values():
    hash(_kernels)  # they are constants: a kernel that was hashed refuses set_params
