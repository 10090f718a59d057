"""Files: read recordings, write movements, and save learned models. No pickle; writes are atomic."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
