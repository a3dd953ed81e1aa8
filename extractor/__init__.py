"""extractor: reads continuous marker patterns from images. It needs numpy, OpenCV, numba and scipy, and no CAD.

>>> from extractor import Extractor, load_layout
>>> markers = Extractor(load_layout("layout.json")).extract(image)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import ExtractorError, ImageError, LayoutError, PoseError, RigError
from .types import Markers, Origin, Reason, Status, VirtualStatus

if TYPE_CHECKING:
    from .camera import View
    from .dense import Field
    from .displacement import Rest
    from .pipeline import Extractor
    from .reference import Reference, load_layout, parse_layout
    from .rig import Rig, load_rig, parse_rig
    from .stereo import Reconstructor, Shape
    from .tracking import FrameStatus, StartKind, Tracked, Tracker
    from .triangulation import PointReason, triangulate
    from .views import ShapeFrame, ShapeTracker, ViewExtractor

__all__ = [
    "Extractor",
    "ExtractorError",
    "Field",
    "FrameStatus",
    "ImageError",
    "LayoutError",
    "Markers",
    "Origin",
    "PointReason",
    "PoseError",
    "Reason",
    "Reconstructor",
    "Reference",
    "Rest",
    "Rig",
    "RigError",
    "Shape",
    "ShapeFrame",
    "ShapeTracker",
    "StartKind",
    "Status",
    "Tracked",
    "Tracker",
    "View",
    "ViewExtractor",
    "VirtualStatus",
    "load_layout",
    "load_rig",
    "parse_layout",
    "parse_rig",
    "triangulate",
]

_HOMES = {
    "Extractor": "pipeline",
    "Field": "dense",
    "FrameStatus": "tracking",
    "PointReason": "triangulation",
    "Reconstructor": "stereo",
    "Reference": "reference",
    "Rest": "displacement",
    "Rig": "rig",
    "Shape": "stereo",
    "ShapeFrame": "views",
    "ShapeTracker": "views",
    "StartKind": "tracking",
    "Tracked": "tracking",
    "Tracker": "tracking",
    "View": "camera",
    "ViewExtractor": "views",
    "load_layout": "reference",
    "load_rig": "rig",
    "parse_layout": "reference",
    "parse_rig": "rig",
    "triangulate": "triangulation",
}


def __getattr__(name: str) -> Any:
    """Import numba and OpenCV only when something that needs them is asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
