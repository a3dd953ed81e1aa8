"""Pickling of frozen dataclasses whose mappings and arrays are read-only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any


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
