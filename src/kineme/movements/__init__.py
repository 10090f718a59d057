"""Movements: trajectories, their preparation, and the segmentation of long recordings."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
