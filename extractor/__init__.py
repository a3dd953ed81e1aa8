"""extractor: reads continuous marker patterns from images. It needs numpy and OpenCV, and no CAD.

>>> from extractor import Extractor
>>> markers = Extractor("layout.json").extract(image)  # doctest: +SKIP

The rooms (folders and modules) in their order; a room imports only rooms before it, and the small modules ``errors``,
``quality``, ``result`` and ``presets``:

- ``numeric``: sampling of images, nearest points, homographies.
- ``layout``: ``layout.json`` and the tables of a layout.
- ``image``: the image as BGR, at several scales, and its light.
- ``cells``: from pixels to cells by contrast, grown by AGA, and their mesh.
- ``localmap``: local maps from layout to image.
- ``numbering``: from cells to numbered markers, by the walk (SSA) and registration.
- ``refine``: all markers solved together, by profiles and synthesis.
- ``complete``: repair of lost markers, and virtual markers.
- ``pipeline``: the stages in their order, from an image to markers. ``draw`` shows their results.
- ``made``: places of the markers on one pad, learnt from pictures at rest.
- ``track``: sequences of images. ``space``: surfaces from two or more views.
- ``contact``: force, torque and regions from displacement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from extractor.errors import ExtractorError, GelError, ImageError, LayoutError, PoseError, RestError, RigError
from extractor.quality import Quality
from extractor.result import Markers, Origin, Reason, Status, VirtualStatus

if TYPE_CHECKING:
    from extractor.contact import ContactForce, ContactReader, ContactReason, ForceModel, Gel, load_gel
    from extractor.layout.layout_file import LayoutLike, layout_of, load_layout, parse_layout
    from extractor.layout.reference import Reference
    from extractor.made.learning import LearntLayout, learn_layout
    from extractor.pipeline import Extractor
    from extractor.space.camera import View
    from extractor.space.field import Field
    from extractor.space.medium import Medium, WindowPlane
    from extractor.space.reconstruction import Reconstructor, Shape
    from extractor.space.rig import Deviation, Rig, load_rig, parse_rig
    from extractor.space.triangulation import PointReason, triangulate
    from extractor.space.views import ContactTracker, ShapeFrame, ShapeTracker, ViewExtractor
    from extractor.track.displacement import Rest
    from extractor.track.tracker import FrameStatus, StartKind, Tracked, Tracker

__all__ = [
    "ContactForce",
    "ContactReader",
    "ContactReason",
    "ContactTracker",
    "Deviation",
    "Extractor",
    "ExtractorError",
    "Field",
    "ForceModel",
    "FrameStatus",
    "Gel",
    "GelError",
    "ImageError",
    "LayoutError",
    "LayoutLike",
    "LearntLayout",
    "Markers",
    "Medium",
    "Origin",
    "PointReason",
    "PoseError",
    "Quality",
    "Reason",
    "Reconstructor",
    "Reference",
    "Rest",
    "RestError",
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
    "WindowPlane",
    "layout_of",
    "learn_layout",
    "load_gel",
    "load_layout",
    "load_rig",
    "parse_layout",
    "parse_rig",
    "triangulate",
]

_HOMES = {
    "ContactForce": "extractor.contact",
    "ContactReader": "extractor.contact",
    "ContactReason": "extractor.contact",
    "ContactTracker": "extractor.space.views",
    "Deviation": "extractor.space.rig",
    "Extractor": "extractor.pipeline",
    "Field": "extractor.space.field",
    "ForceModel": "extractor.contact",
    "FrameStatus": "extractor.track.tracker",
    "Gel": "extractor.contact",
    "LayoutLike": "extractor.layout.layout_file",
    "LearntLayout": "extractor.made.learning",
    "Medium": "extractor.space.medium",
    "PointReason": "extractor.space.triangulation",
    "Reconstructor": "extractor.space.reconstruction",
    "Reference": "extractor.layout.reference",
    "Rest": "extractor.track.displacement",
    "Rig": "extractor.space.rig",
    "Shape": "extractor.space.reconstruction",
    "ShapeFrame": "extractor.space.views",
    "ShapeTracker": "extractor.space.views",
    "StartKind": "extractor.track.tracker",
    "Tracked": "extractor.track.tracker",
    "Tracker": "extractor.track.tracker",
    "View": "extractor.space.camera",
    "ViewExtractor": "extractor.space.views",
    "WindowPlane": "extractor.space.medium",
    "layout_of": "extractor.layout.layout_file",
    "learn_layout": "extractor.made.learning",
    "load_gel": "extractor.contact",
    "load_layout": "extractor.layout.layout_file",
    "load_rig": "extractor.space.rig",
    "parse_layout": "extractor.layout.layout_file",
    "parse_rig": "extractor.space.rig",
    "triangulate": "extractor.space.triangulation",
}


def __getattr__(name: str) -> Any:
    """Import OpenCV at the first use of a name that needs it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
