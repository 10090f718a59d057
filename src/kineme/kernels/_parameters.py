"""Parameters of kernels by name, as scikit-learn reads, sets and clones them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Self

from kineme.errors import SpecificationError


class Parameters:
    """Base of frozen dataclasses whose fields are parameters for scikit-learn's searches.

    scikit-learn clones an estimator with its kernel, then sets the parameters of the clone in place. `set_params` is
    therefore the one way to change such an object. It refuses one that was hashed, since its hash must stay as it is:
    a key of a dict or a member of a set never changes.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.__hash__ = Parameters.__hash__  # type: ignore[method-assign]  # else the dataclass makes one of its own

    def __hash__(self) -> int:
        object.__setattr__(self, "_hashed", True)
        return hash((type(self), *(getattr(self, name) for name in _names(self))))

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _names(self)}

    def __sklearn_clone__(self) -> Self:
        return replace(self, **{name: _copy(getattr(self, name)) for name in _names(self)})  # type: ignore[type-var]

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name.

        Parameters
        ----------
        deep : bool
            Whether to add the parameters of kernels inside, as ``kernel__sigma``, or ``kernel__0__sigma`` for the
            first of several.
        """
        parameters = {name: getattr(self, name) for name in _names(self)}
        if deep:
            for name in tuple(parameters):
                parameters |= _nested(name, parameters[name])
        return parameters

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name, in place, and return the kernel.

        Kernels inside are replaced, not changed: others may share them.

        Raises
        ------
        SpecificationError
            A name that is no parameter, a value out of range, or a kernel that was hashed. The kernel is unchanged.
        """
        if parameters and self.__dict__.get("_hashed"):
            raise SpecificationError(
                f"expected a kernel that was never hashed, got {self}, which may be a key of a dict or a constant; "
                "set the parameters of sklearn.base.clone(kernel)"
            )
        changed = self._with_parameters(parameters)
        for name in _names(self):
            object.__setattr__(self, name, getattr(changed, name))
        return self

    def _with_parameters(self, parameters: Mapping[str, Any]) -> Self:
        """A copy with other parameters."""
        changes: dict[str, Any] = {}
        for name, value in sorted(parameters.items()):  # "kernel" comes before "kernel__sigma"
            own, _, inner = name.partition("__")
            if own not in _names(self):
                raise SpecificationError(
                    f"expected parameters of {type(self).__name__}, {list(self.get_params())}, got {name!r}"
                )
            changes[own] = _changed(changes.get(own, getattr(self, own)), inner, value) if inner else value
        return replace(self, **changes)  # type: ignore[type-var]


def _names(parameters: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(parameters))


def _copy(value: Any) -> Any:
    if isinstance(value, Parameters):
        return value.__sklearn_clone__()
    return tuple(map(_copy, value)) if isinstance(value, tuple) else value


def _nested(name: str, value: Any) -> dict[str, Any]:
    if isinstance(value, Parameters):
        return {f"{name}__{inner}": part for inner, part in value.get_params().items()}
    parameters: dict[str, Any] = {}
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            parameters |= {f"{name}__{i}": part} | _nested(f"{name}__{i}", part)
    return parameters


def _changed(value: Any, name: str, new: Any) -> Any:
    """`value` with the parameter `name` inside it set to `new`."""
    if isinstance(value, Parameters):
        return value._with_parameters({name: new})
    index, _, inner = name.partition("__")
    if not (isinstance(value, tuple) and index.isdecimal() and int(index) < len(value)):
        raise SpecificationError(f"expected a kernel with the parameter {name!r}, got {value!r}")
    i = int(index)
    return (*value[:i], _changed(value[i], inner, new) if inner else new, *value[i + 1 :])
