"""extractor: reads continuous marker patterns from images. It needs numpy, OpenCV, numba and scipy, and no CAD.

>>> from extractor import Extractor, load_layout
>>> markers = Extractor(load_layout("layout.json")).extract(image)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import ExtractorError, ImageError, LayoutError
from .types import Markers, Origin, Reason, Status, VirtualStatus

if TYPE_CHECKING:
    from .displacement import Rest
    from .pipeline import Extractor
    from .reference import Reference, load_layout, parse_layout
    from .tracking import FrameStatus, StartKind, Tracked, Tracker

__all__ = [
    "Extractor",
    "ExtractorError",
    "FrameStatus",
    "ImageError",
    "LayoutError",
    "Markers",
    "Origin",
    "Reason",
    "Reference",
    "Rest",
    "StartKind",
    "Status",
    "Tracked",
    "Tracker",
    "VirtualStatus",
    "load_layout",
    "parse_layout",
]

_HOMES = {
    "Extractor": "pipeline",
    "FrameStatus": "tracking",
    "Reference": "reference",
    "Rest": "displacement",
    "StartKind": "tracking",
    "Tracked": "tracking",
    "Tracker": "tracking",
    "load_layout": "reference",
    "parse_layout": "reference",
}


def __getattr__(name: str) -> Any:
    """Import numba and OpenCV only when something that needs them is asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
