"""Primitives as modules of PyTorch: tensors in, movements out, with gradients; on any device (extra `torch`)."""

from kineme._lazy import lazy_names as _lazy_names

_load, __dir__, __all__ = _lazy_names(__name__)


def __getattr__(name: str) -> object:
    from kineme.io.records import needs

    with needs("torch", "compute with tensors", "torch"):
        return _load(name)
