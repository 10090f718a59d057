"""Movements and a planner: skills within what was shown, operators learned from states, plans, their execution."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
