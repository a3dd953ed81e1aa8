"""The error of a contact that cannot be solved."""

from __future__ import annotations

from cmpdesign.errors import CmpDesignError


class ContactError(CmpDesignError, ValueError):
    """A layer, an object or a motion whose values are out of range, or that do not meet."""


def require(good: bool, name: str, value: object, limit: str) -> None:
    """Raise the error for one value.

    Raises:
        ContactError: ``good`` is false; names the value and its limit.
    """
    if not good:
        raise ContactError(f"{name} is {value}; it must be {limit}")
