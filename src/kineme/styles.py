"""Many demonstrations of one movement: their average with its spread, and the styles in which they differ."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
