"""Widgets in the cells of a notebook: draw movements, see them recognized, drag a goal (extra `notebook`)."""

from kineme._lazy import lazy_names as _lazy_names

_load, __dir__, __all__ = _lazy_names(__name__)


def __getattr__(name: str) -> object:
    from kineme.io.records import needs

    with needs("anywidget", "show widgets in a notebook", "notebook"):
        return _load(name)
