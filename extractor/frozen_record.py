"""Frozen dataclasses: pickling where mappings and arrays are read-only, and attributes that are computed later."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self


class FrozenRecord:
    """Base of dataclasses that are pickled and copied as the arguments of their constructor.

    A copy is made by the constructor, which makes mappings and arrays read-only again: ``MappingProxyType`` cannot be
    pickled, and numpy does not keep the flag of an array.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        values = [getattr(self, field.name) for field in fields(self)]  # type: ignore[arg-type]
        return type(self), tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in values)

    def _freeze_mappings(self, *names: str) -> None:
        """Replace the mappings of these attributes by read-only copies."""
        for name in names:
            entries: Mapping[Any, Any] = getattr(self, name)
            object.__setattr__(self, name, MappingProxyType(dict(entries)))


class LateRecord(FrozenRecord):
    """Base of dataclasses of which some attributes can be computed when they are first asked for."""

    @classmethod
    def with_later(cls, later: Mapping[tuple[str, ...], Callable[[], Iterable[Any]]], **values: Any) -> Self:
        """A record whose attributes are computed at their first use, once.

        Args:
            later: names of attributes -> what computes them, in this order, from values that do not change.
            values: all other attributes.
        """
        late = [name for names in later for name in names]
        made = cls(**values, **dict.fromkeys(late))
        for name in late:
            del made.__dict__[name]
        made.__dict__["_later"] = later
        return made

    if not TYPE_CHECKING:  # it is called for an attribute that is not there

        def __getattr__(self, name: str) -> Any:
            """An attribute, computed with those of its group."""
            for names, compute in self.__dict__.get("_later", {}).items():
                if name in names:
                    self.__dict__.update(zip(names, compute(), strict=True))
                    return self.__dict__[name]
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
