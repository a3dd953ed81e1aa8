"""The error of a contact that cannot be solved."""

from __future__ import annotations

from cmpdesign.errors import CmpDesignError


class ContactError(CmpDesignError, ValueError):
    """An elastic layer, an object or a motion has a value out of range, or the object misses the solved area."""


def require(good: bool, name: str, value: object, limit: str) -> None:
    """Check one value.

    Raises:
        ContactError: ``good`` is false; the message names the value and its limit.
    """
    if not good:
        raise ContactError(f"{name} is {value}; it must be {limit}")
