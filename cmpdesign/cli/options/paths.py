"""Checks of paths on the command line."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from cmpdesign.errors import CmpDesignError


def require_suffix(option: str, path: Path | None, expected: Collection[str]) -> None:
    """Check the ending of the name of a file to write, if a file is given; the ending states the format.

    Raises:
        CmpDesignError: another ending.
    """
    if path is not None and path.suffix.lower() not in expected:
        one_of = "one of " if len(expected) > 1 else ""
        raise CmpDesignError(f"{option} {path}: unknown ending; expected {one_of}{', '.join(expected)}")
