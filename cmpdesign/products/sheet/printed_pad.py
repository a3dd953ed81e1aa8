"""One pad as it is printed: its side, its inks with bleed, and its crop marks, in the frame of a page."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.design.sheet_options import SheetOptions
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.outline import corner_offsets
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.sheet.page import FilledPolygons, TextLine

CROP_MM, CROP_APART_MM, HAIRLINE_MM = 4.0, 0.5, 0.1
# Sine of the least turn of a corner with crop marks: 30 to 150 degrees.
SHARP = 0.5 - 1e-9
Points = NDArray[np.float64]


class PrintSide(NamedTuple):
    """The print of a pad on a film.

    Attributes:
        film: "opaque": the camera sees the print directly; "clear": through the film.
        seen: the side of the pattern that the camera sees.
        mirror: the page shows the pattern mirrored.
        text: one line for the page.
    """

    film: str
    seen: str
    mirror: bool
    text: str


def print_side(design: Design) -> PrintSide:
    """The film, the printed side and the mirroring of a design.

    The print is as seen by the camera if the camera sees the ink directly, and mirrored if the camera sees the ink
    through the film.
    """
    seen = seen_side(design.mirrored)
    film = design.sheet.film or ("opaque" if seen == "front" else "clear")
    mirror = (seen == "back") != (film == "clear")
    text = f"camera sees the {seen}: "
    text += "print on the side that faces it" if film == "opaque" else "print on the far side of a clear film"
    if design.print_mirror:
        mirror, text = not mirror, f"{text}, by transfer"
    return PrintSide(film, seen, mirror, text)


def pad_items(layout: Layout, place: Points, design: Design) -> list[FilledPolygons | TextLine]:
    """The ground with bleed, then the cells color by color."""
    ground = page_from_layout(bleed_outline(layout, design.sheet), layout, place, design)
    items: list[FilledPolygons | TextLine] = [FilledPolygons([ground], layout.palette[COLORS[BLACK]])]
    for color, name in enumerate(COLORS):
        cells = layout.cell_corners[layout.cell_color == color]
        if color != BLACK and len(cells):
            corners = page_from_layout(layout.marker_xy_mm[cells], layout, place, design)
            items.append(FilledPolygons(list(corners), layout.palette[name]))
    return items


def bleed_outline(layout: Layout, option: SheetOptions) -> Points:
    """(K, 2) the pad's outline, ``bleed_mm`` further out."""
    outline: Points = layout.outline_mm + option.bleed_mm * corner_offsets(layout.outline_mm)
    return outline


def crop_mark_polygons(layout: Layout, place: Points, design: Design) -> list[Points]:
    """The crop marks of a pad on the page."""
    marks = crop_marks(layout.outline_mm, design.sheet.bleed_mm)
    return [page_from_layout(mark, layout, place, design) for mark in marks]


def page_from_layout(xy: Points, layout: Layout, place: Points, design: Design) -> Points:
    """(..., 2) points from the layout's frame to the page; ``place``: corner of the pad, see ``_pad_places``."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    x = high[0] - xy[..., 0] if print_side(design).mirror else xy[..., 0] - low[0]
    return np.stack([place[0] + x, place[1] + high[1] - xy[..., 1]], axis=-1)


def crop_marks(outline_mm: Points, bleed_mm: float) -> list[Points]:
    """Hairlines that continue the pad's sides beyond the corners; a ruler laid on two hairlines shows the cut.

    The marks of a round or non-convex outline are those of its bounding box.

    Args:
        outline_mm: (N, 2) counter-clockwise.
        bleed_mm: width of the bleed; the marks begin ``CROP_APART_MM`` outside the bleed.

    Returns:
        Two (4, 2) outlines per corner.
    """
    corners, sine = outline_mm, _turn_sines(outline_mm)
    if (sine < SHARP).any():
        (left, low), (right, high) = outline_mm.min(axis=0), outline_mm.max(axis=0)
        corners = np.array([(left, low), (right, low), (right, high), (left, high)])
        sine = np.ones(4)
    before, after = (
        _unit_directions(np.roll(corners, 1, axis=0), corners),
        _unit_directions(np.roll(corners, -1, axis=0), corners),
    )
    marks = []
    # A continued side leaves the bleed of the next side at this distance from the corner.
    distances = (bleed_mm + CROP_APART_MM) / sine
    for corner, distance, *directions in zip(corners, distances, before, after, strict=True):
        marks += [_hairline_polygon(corner + distance * direction, direction) for direction in directions]
    return marks


def _turn_sines(outline: Points) -> Points:
    """(N,) sine of the angle by which the outline turns to the left at each corner."""
    before = _unit_directions(np.roll(outline, 1, axis=0), outline)
    after = _unit_directions(outline, np.roll(outline, -1, axis=0))
    sines: Points = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return sines


def _unit_directions(start: Points, end: Points) -> Points:
    """(N, 2) unit vectors from start to end."""
    direction: Points = (end - start) / np.hypot(*(end - start).T)[:, None]
    return direction


def _hairline_polygon(start: Points, direction: Points) -> Points:
    """(4, 2) corners of a hairline of length ``CROP_MM``."""
    half = HAIRLINE_MM / 2 * np.array([-direction[1], direction[0]])
    end = start + CROP_MM * direction
    return np.array([start - half, end - half, end + half, start + half])
