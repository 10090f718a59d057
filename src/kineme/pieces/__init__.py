"""Archives beyond the memory of one machine: pieces, each done by a pure function, on any executor."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
