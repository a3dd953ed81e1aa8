"""The documents that commands print with ``--json``: one model for each; the JSON Schema is made from the model.

In: the result of a command. Out: a checked document of stated format and version.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmpdesign.documents import calibration, data, designs, reading, runs

__all__ = ["calibration", "data", "designs", "reading", "runs"]


def __getattr__(name: str) -> Any:
    """A module of documents, which is loaded at its first use: its models need a library that takes time to load."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")
