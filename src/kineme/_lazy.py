"""Public names that load on first use, from one table: the stub that lies beside a module.

A stub says where each name is defined, ``from kineme.errors import DataError as DataError``, one on a line and in the
order of the flow. Type checkers and editors read it; so do `lazy_names` and `docs/make_reference.py`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module


def names_in(stub: str) -> dict[str, tuple[str, str]]:
    """Of the text of a stub: public name -> the module that it is in, and its name there."""
    lines = [line.split() for line in stub.splitlines() if line.startswith("from kineme")]
    return {words[5]: (words[1], words[3]) for words in lines}


def lazy_names(module: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return what a module assigns to ``__getattr__, __dir__, __all__`` so that it has the names of its stub.

    Parameters
    ----------
    module : str
        Its ``__name__``.

    Raises
    ------
    ImportError
        There is no stub beside the module: whoever packaged the installed files left it out.
    """
    names = names_in(_stub_of(module))

    def load(name: str) -> object:
        if name in names:
            home, there = names[name]
            value = import_module(f"{home}.{there}") if home == module else getattr(import_module(home), there)
        elif (value := _module_below(module, name)) is None:
            raise AttributeError(_unknown(module, name, list(names)))
        setattr(sys.modules[module], name, value)
        return value

    def listed() -> list[str]:
        return [*names, *(name for name in vars(sys.modules[module]) if name.startswith("__"))]

    return load, listed, list(names)


def _stub_of(module: str) -> str:
    spec = sys.modules[module].__spec__
    path = spec.origin.removesuffix("c") + "i"  # type: ignore[union-attr]
    try:
        return spec.loader.get_data(path).decode()  # type: ignore[union-attr]
    except OSError as error:
        raise ImportError(
            f"expected the public names of {module} in {path}, found no such file; kineme needs its .pyi files when it "
            "runs, not for types alone: install it again, or put them into the package that you made of it"
        ) from error


def _module_below(package: str, name: str) -> object | None:
    """The module of that name in a package, as an attribute whether or not somebody imported it."""
    from importlib.util import find_spec

    if name.startswith("_") or not name.isidentifier() or not hasattr(sys.modules[package], "__path__"):
        return None
    return import_module(f"{package}.{name}") if find_spec(f"{package}.{name}") else None


def _unknown(module: str, name: str, names: list[str]) -> str:
    from difflib import get_close_matches

    alike = get_close_matches(name, names, 1)
    meant = f" (did you mean {alike[0]!r}?)" if alike else ""
    return f"module {module!r} has no attribute {name!r}{meant}; it has {', '.join(names)}"
