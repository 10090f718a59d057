"""Data sets of real recordings that are installed with the package."""

from kineme.datasets.lasa import LASA_26, LASA_30, PAPER_LETTERS, load_lasa

__all__ = ["LASA_26", "LASA_30", "PAPER_LETTERS", "load_lasa"]
