"""Orientations as unit quaternions (w, x, y, z), and poses: learn them, move again, describe them."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
