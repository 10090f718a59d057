"""Data sets that are installed with the package: recordings, and movements to begin with."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
