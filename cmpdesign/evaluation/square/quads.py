"""The former method's recognition: squares of a checkerboard from their contours.

    image -> adaptive threshold -> light and dark squares, separated by erosion -> contours -> quads

Neighbouring squares of one shade touch at their corners, and blur joins them. Therefore the mask is eroded, and
the quads' sides are moved back outward, as in the quad-based chessboard finder of OpenCV (V. Vezhnevets). Of a
few erosions the one with the most quads is used. Squares that stay joined have a contour
with more than four corners and are lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

EROSION_STEPS_PX = (1, 2, 3, 4)
EROSION_KERNEL = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
# A quad's area and its corners' distance from its outline, in units of the square at rest.
QUAD_AREA_RANGE = (0.1, 3.0)
OUTLINE_TOLERANCE = 0.12
RED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Quads:
    """Squares found in an image.

    Attributes:
        corners_px: (Q, 4, 2) float64, clockwise as the image shows them (y points down).
        light: (Q,) bool, the squares lighter than their surroundings, including the reference cell.
        reference: the row of the colored reference cell; None if it was not found.
    """

    corners_px: NDArray[np.float64]
    light: NDArray[np.bool_]
    reference: int | None


def find_quads(bgr: NDArray[np.uint8], edge_px: float) -> Quads:
    """The squares of a checkerboard whose edges are about ``edge_px`` long at rest."""
    import cv2

    # In the brightest channel the colored reference cell is light too.
    value = np.ascontiguousarray(bgr.max(axis=2))
    block = 2 * round(edge_px) + 1
    mask = np.asarray(
        cv2.adaptiveThreshold(value, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, block, 0), np.uint8
    )
    light = _find_most_quads(mask, edge_px)
    dark = _find_most_quads(~mask, edge_px)
    corners = np.concatenate([light, dark])
    shade = np.arange(len(corners)) < len(light)
    return Quads(corners, shade, _find_reference_cell(bgr, light))


def _find_most_quads(mask: NDArray[np.uint8], edge_px: float) -> NDArray[np.float64]:
    """(Q, 4, 2) px: the quads of the erosion with the most quads; of equals the weakest erosion."""
    return max((_quads_from_mask(mask, times, edge_px) for times in EROSION_STEPS_PX), key=len)


def _quads_from_mask(mask: NDArray[np.uint8], eroded_px: int, edge_px: float) -> NDArray[np.float64]:
    import cv2

    contours, _ = cv2.findContours(
        cv2.erode(mask, EROSION_KERNEL, iterations=eroded_px), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE
    )
    # The contour's number of pixels around a disc of the smallest area.
    shortest = 2 * np.sqrt(np.pi * QUAD_AREA_RANGE[0]) * edge_px / np.sqrt(2)
    long = (contour for contour in contours if len(contour) >= shortest)
    quads = [quad for contour in long if (quad := _fit_quad(contour, edge_px)) is not None]
    if not quads:
        return np.empty((0, 4, 2))
    return _offset_quads(np.stack(quads), float(eroded_px))


def _fit_quad(contour: NDArray[Any], edge_px: float) -> NDArray[np.float64] | None:
    """(4, 2) px: corners of a contour that is a convex quadrilateral of about the right size, else None."""
    import cv2

    area = cv2.contourArea(contour)
    if not QUAD_AREA_RANGE[0] * edge_px**2 < area < QUAD_AREA_RANGE[1] * edge_px**2:
        return None
    outline = cv2.approxPolyDP(contour, OUTLINE_TOLERANCE * np.sqrt(area), True)
    if len(outline) != 4 or not cv2.isContourConvex(outline):
        return None
    corners = outline[:, 0].astype(np.float64)
    # With y down, a positive area appears clockwise.
    return corners if cv2.contourArea(outline, True) > 0 else corners[::-1]


def _offset_quads(quads: NDArray[np.float64], by_px: float) -> NDArray[np.float64]:
    """Quads (Q, 4, 2), clockwise with y down, with every side moved outward by ``by_px``."""
    along = np.roll(quads, -1, axis=1) - quads
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2)  # outward of the side from corner i
    before = np.roll(normal, 1, axis=1)
    # The mitre point: its distances from both sides through the corner grow by ``by_px``.
    cosine = (normal * before).sum(axis=2, keepdims=True)
    return np.asarray(quads + by_px * (normal + before) / np.maximum(1 + cosine, 0.3))


def _find_reference_cell(bgr: NDArray[np.uint8], light: NDArray[np.float64]) -> int | None:
    """The only light quad with a redness above ``RED_SHARE``; None if there is none or more than one."""
    centres = light.mean(axis=1)
    shares = [_redness(bgr, centre) for centre in centres]
    red = np.flatnonzero(np.asarray(shares) > RED_SHARE)
    return int(red[0]) if len(red) == 1 else None


def _redness(bgr: NDArray[np.uint8], centre: NDArray[np.float64]) -> float:
    """Excess of red over the larger other channel around a point, as a share of red."""
    x, y = np.rint(centre).astype(int)
    patch = bgr[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].reshape(-1, 3).astype(np.float64)
    if not len(patch):
        return 0.0
    blue, green, red = patch.mean(axis=0)
    return float((red - max(green, blue)) / max(red, 1.0))
