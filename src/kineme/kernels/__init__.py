"""Distance-based kernels: feature rows in, Gram matrices out (Section 3.2)."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
