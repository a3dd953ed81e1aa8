"""preview.png: a dimensioned drawing of the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, COLORS

LONG_SIDE_PX = 1000
MARGIN_PX = 70
TITLE_PX = 60
# The pattern is drawn larger by this factor and averaged: smooth edges, and the same pixels on every machine.
_SUPERSAMPLING = 4
# Fractional bits of OpenCV's fixed-point coordinates.
_SUBPIXEL_BITS = 8
# Ids are drawn when the median edge has at least this length.
_ID_EDGE_PX = 34

_PAPER_BGR = (250, 250, 248)
_TEXT_BGR = (60, 52, 44)
_FAINT_BGR = (150, 142, 134)

Image = NDArray[np.uint8]


def preview_png(layout: Layout, pictures: Mapping[str, Image] | None = None) -> bytes:
    """Draw the preview: pattern, overall dimensions, key figures, and ids where edges are long enough.

    Args:
        layout: the pattern.
        pictures: name -> (H, W, 3) uint8 BGR pictures of other products, placed right of and below the drawing.

    Returns:
        The bytes of a PNG file.
    """
    import cv2

    image = draw_preview(layout)
    if pictures:
        from cmpdesign.products.drawing.preview_pictures import compose_pictures

        image = compose_pictures(image, pictures, _PAPER_BGR)
    return bytes(cv2.imencode(".png", image)[1])


def draw_preview(layout: Layout) -> Image:
    """Draw the preview without pictures of other products.

    Returns:
        (H, W, 3) uint8 BGR; the longer side of the pattern's outline measures ``LONG_SIDE_PX``.
    """
    scale = LONG_SIDE_PX / max(layout.size_mm)
    width, height = (int(np.ceil(scale * side)) for side in layout.size_mm)
    image: Image = np.full(
        (height + 2 * MARGIN_PX + TITLE_PX, width + 2 * MARGIN_PX, 3), _PAPER_BGR, np.uint8
    )
    frame = _PixelFrame(MARGIN_PX, MARGIN_PX + TITLE_PX, width, height)
    top_left_mm = layout.outline_mm.min(axis=0)[0], layout.outline_mm.max(axis=0)[1]

    def to_px(xy_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.array([frame.left, frame.top]) + scale * (xy_mm - top_left_mm) * (1, -1))

    image = _cells_image(image, layout, to_px(layout.outline_mm), to_px(layout.marker_xy_mm))
    _draw_ids(image, layout, to_px(layout.marker_xy_mm))
    _draw_dimensions(image, layout, frame)
    _draw_title(image, layout)
    return image


class _PixelFrame(NamedTuple):
    """The bounding box of the drawn pattern, px."""

    left: int
    top: int
    width: int
    height: int


def _cells_image(
    image: Image, layout: Layout, outline_px: NDArray[np.float64], marker_px: NDArray[np.float64]
) -> Image:
    """A picture of the size of ``image`` with the ground and the colored cells."""
    import cv2

    large: Image = np.empty((image.shape[0] * _SUPERSAMPLING, image.shape[1] * _SUPERSAMPLING, 3), np.uint8)
    large[:] = _PAPER_BGR
    _draw_polygons(large, [outline_px], _ink_bgr(layout, BLACK))
    for color in range(len(COLORS)):
        if color != BLACK:
            cells = layout.cell_corners[layout.cell_color == color]
            _draw_polygons(large, list(marker_px[cells]), _ink_bgr(layout, color))
    small = cv2.resize(large, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _draw_polygons(large: Image, polygons: list[NDArray[np.float64]], color: tuple[int, int, int]) -> None:
    import cv2

    # OpenCV puts pixel centres at whole numbers, so the grid of the large image lies half a pixel off.
    unit = 1 << _SUBPIXEL_BITS
    for polygon in polygons:
        points = np.rint((_SUPERSAMPLING * polygon - 0.5) * unit).astype(np.int32)
        cv2.fillConvexPoly(large, points, color, cv2.LINE_8, _SUBPIXEL_BITS)


def _draw_ids(image: Image, layout: Layout, marker_px: NDArray[np.float64]) -> None:
    """Draw the id above every marker that is present, if edges are long enough."""
    ends = marker_px[layout.edges]
    edge_px = float(np.median(np.hypot(*(ends[:, 1] - ends[:, 0]).T)))
    if edge_px < _ID_EDGE_PX:
        return
    size = min(0.5, edge_px / 130)
    for marker in np.flatnonzero(layout.present).tolist():
        place = marker_px[marker] + (0, -0.16 * edge_px)
        _draw_text(image, str(marker), place, size, (255, 255, 255), outline=True)


def _draw_dimensions(image: Image, layout: Layout, frame: _PixelFrame) -> None:
    """Draw the overall width below the pattern and the overall height right of it."""
    right, bottom = frame.left + frame.width, frame.top + frame.height
    line_y, line_x = bottom + MARGIN_PX // 2, right + MARGIN_PX // 2
    for x in (frame.left, right):
        _draw_line(image, (x, bottom + 8), (x, line_y + 8), _FAINT_BGR)
    for y in (frame.top, bottom):
        _draw_line(image, (right + 8, y), (line_x + 8, y), _FAINT_BGR)
    _draw_arrow(image, (frame.left, line_y), (right, line_y))
    _draw_arrow(image, (line_x, frame.top), (line_x, bottom))
    middle_x, middle_y = frame.left + frame.width / 2, frame.top + frame.height / 2
    _draw_label(image, f"{layout.size_mm[0]:.2f} mm", (middle_x, line_y), upright=False)
    _draw_label(image, f"{layout.size_mm[1]:.2f} mm", (line_x, middle_y), upright=True)


def _draw_title(image: Image, layout: Layout) -> None:
    name = str(layout.parameters.get("name") or layout.pattern)
    virtual = len(layout.edges) * layout.virtual_per_edge
    facts = [
        layout.pattern,
        f"{layout.parameters['layers']} layers",
        f"pitch {float(layout.parameters['pitch_mm']):.4g} mm",
        f"{int(layout.present.sum())} markers",
        f"{virtual} virtual",
        f"{len(layout.cell_corners)} cells",
        *(["seen from the front, used from the back"] if layout.mirrored else []),
    ]
    _draw_text(image, name, (MARGIN_PX, 46), 0.9, _TEXT_BGR, left=True, weight=2)
    _draw_text(image, "   ".join(facts), (MARGIN_PX, 82), 0.5, _FAINT_BGR, left=True)


def _draw_arrow(image: Image, start: tuple[int, int], end: tuple[int, int]) -> None:
    import cv2

    _draw_line(image, start, end, _TEXT_BGR)
    direction = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    normal = np.array([-direction[1], direction[0]])
    for tip, inward in ((np.array(start), direction), (np.array(end), -direction)):
        head = np.array([tip, tip + 14 * inward + 4 * normal, tip + 14 * inward - 4 * normal])
        points = np.rint(head * 256).astype(np.int32)
        cv2.fillConvexPoly(image, points, _TEXT_BGR, cv2.LINE_AA, 8)


def _draw_line(
    image: Image, start: tuple[int, int], end: tuple[int, int], color: tuple[int, int, int]
) -> None:
    import cv2

    cv2.line(image, [int(v) for v in start], [int(v) for v in end], color, 1, cv2.LINE_AA)


def _draw_label(image: Image, text: str, middle: tuple[float, float], upright: bool) -> None:
    """Draw a label over the middle of a dimension line; an upright label reads from below to above."""
    import cv2

    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
    patch: Image = np.full((height + 10, width + 20, 3), _PAPER_BGR, np.uint8)
    cv2.putText(patch, text, (10, height + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.6, _TEXT_BGR, 1, cv2.LINE_AA)
    if upright:
        patch = np.ascontiguousarray(np.rot90(patch))
    rows, columns = patch.shape[:2]
    x, y = max(0, int(middle[0] - columns / 2)), max(0, int(middle[1] - rows / 2))
    target = image[y : y + rows, x : x + columns]
    target[:] = patch[: target.shape[0], : target.shape[1]]


def _draw_text(
    image: Image,
    text: str,
    place: NDArray[np.float64] | tuple[float, float],
    size: float,
    color: tuple[int, int, int],
    left: bool = False,
    outline: bool = False,
    weight: int = 1,
) -> None:
    """Draw a text with its middle, or (``left``) the left end of its base line, at a place in px."""
    import cv2

    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, weight)
    x, y = (place[0], place[1]) if left else (place[0] - width / 2, place[1] + height / 2)
    start = [round(float(x)), round(float(y))]
    if outline:
        for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            shifted = [start[0] + dx, start[1] + dy]
            cv2.putText(image, text, shifted, cv2.FONT_HERSHEY_SIMPLEX, size, (0, 0, 0), weight, cv2.LINE_AA)
    cv2.putText(image, text, start, cv2.FONT_HERSHEY_SIMPLEX, size, color, weight, cv2.LINE_AA)


def _ink_bgr(layout: Layout, color: int) -> tuple[int, int, int]:
    """Blue, green, red (0 to 255) of an index into ``COLORS``."""
    text = layout.palette[COLORS[color]]
    return int(text[5:7], 16), int(text[3:5], 16), int(text[1:3], 16)
