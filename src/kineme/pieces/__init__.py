"""Archives beyond the memory of one machine: shards of features, and the nearest movements among all of them."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
