"""The side of the pattern that the camera sees, and the pattern with this side up."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from cmpdesign.layout.layout import Layout

Side = Literal["front", "back"]


def seen_side(mirrored: bool) -> Side:
    """The side that the camera sees: the back for ``mirrored``, else the front. Every product uses this function."""
    return "back" if mirrored else "front"


def turned_over(layout: Layout) -> Layout:
    """The layout as seen from the back: x is mirrored; ids, colors and edges are kept; corners are
    counter-clockwise.
    """
    mirror = np.array([-1.0, 1.0])
    return replace(
        layout,
        marker_xy_mm=layout.marker_xy_mm * mirror + 0.0,
        cell_corners=np.ascontiguousarray(layout.cell_corners[:, ::-1]),
        outline_mm=layout.outline_mm[::-1] * mirror + 0.0,
        fiducials_mm=layout.fiducials_mm * mirror + 0.0,
        as_made=None,
    )
