"""kineme: learn movements as Dynamical Movement Primitives, recognize them, name them, move again.

The public names are listed in the stub ``__init__.pyi`` and load on first use, so that ``import kineme`` costs next to
nothing.
"""

from kineme._lazy import lazy_names as _lazy_names

__version__ = "0.2.0"  # the one place: pyproject.toml takes it from here
__getattr__, __dir__, __all__ = _lazy_names(__name__)
