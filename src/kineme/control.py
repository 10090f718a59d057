"""Live control of primitives: one step at a time, with a moving goal, obstacles and any tempo."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
