"""Single cells under the two deformations of the article's Fig. 4, drawn and recognised.

The rule of recognition: the n most prominent corners of a cell's contour are convex, each at least 1.5 px from the
line between its neighbours. The contour deviates from the polygon of these corners by at most 3 px or 2 % of its
size. The rule of tracking: a corner gets the number of the corner at rest with the nearest direction from the cell's
centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
SUPERSAMPLING = 4  # samples along each side of a pixel
MIN_CORNER_HEIGHT_PX = 1.5  # the height of a pixel on a straight side is smaller
# Blur shortens the tip of a sharp corner by this many px; the same in units of the cell's size.
MAX_OUTLINE_DISTANCE_PX, MAX_OUTLINE_DISTANCE = 3.0, 0.02
BINARY_THRESHOLD = 127


def regular_cell(sides: int, edge: float = 1.0) -> Points:
    """(n, 2) the corners of a regular cell around the origin, the first one above it (y down)."""
    angle = np.radians(-90 + 360 / sides * np.arange(sides))
    return np.asarray(0.5 * edge / np.sin(np.pi / sides) * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def bend_corner(corners: Points, change_deg: float) -> Points:
    """The cell with its first corner moved along its bisector until its inner angle has grown by ``change_deg``.

    At an inner angle of 180 degrees the corner lies on the line between its neighbours, above that on the other side.
    """
    first_side, last_side = corners[1] - corners[0], corners[-1] - corners[0]
    at_rest = np.arccos(first_side @ last_side / (np.linalg.norm(first_side) * np.linalg.norm(last_side)))
    angle = at_rest + np.radians(change_deg)
    middle = 0.5 * (corners[1] + corners[-1])
    half = 0.5 * float(np.linalg.norm(corners[1] - corners[-1]))
    outward = (corners[0] - middle) / np.linalg.norm(corners[0] - middle)
    moved = corners.copy()
    moved[0] = middle + half / np.tan(angle / 2) * outward
    return moved


def turn_cell(corners: Points, angle_deg: float) -> Points:
    """The cell rotated about the origin."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]))


def draw_cell(corners_px: Points) -> tuple[NDArray[np.uint8], Points]:
    """A picture (H, W) uint8 of a light cell on black, blurred by 1 px, and (2,) px, the origin's position in it."""
    import cv2

    low = np.floor(corners_px.min(axis=0)) - 8
    width, height = (np.ceil(corners_px.max(axis=0)) + 8 - low).astype(int)
    fine = np.zeros((height * SUPERSAMPLING, width * SUPERSAMPLING), np.uint8)
    # Pixel centres are whole numbers at both scales.
    samples = (corners_px - low + 0.5) * SUPERSAMPLING - 0.5
    cv2.fillPoly(fine, [np.rint(samples * 16).astype(np.int32)], 255, cv2.LINE_8, 4)
    small = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), 1.0), np.uint8), -low


def find_cell_corners(picture: NDArray[np.uint8], sides: int) -> Points | None:
    """(n, 2) px: the corners of the cell in a picture; None if the rule of recognition is not met."""
    import cv2

    mask = (picture > BINARY_THRESHOLD).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if len(contours) != 1:
        return None
    contour = contours[0][:, 0].astype(np.float64)
    corners, height_px = simplify_contour(contour, sides)
    if (
        len(corners) < sides
        or height_px < MIN_CORNER_HEIGHT_PX
        or not cv2.isContourConvex(corners.astype(np.float32))
    ):
        return None
    allowed_px = max(
        MAX_OUTLINE_DISTANCE_PX, MAX_OUTLINE_DISTANCE * float(np.linalg.norm(np.ptp(corners, axis=0)))
    )
    return corners if outline_distance_px(contour, corners) <= allowed_px else None


def outline_distance_px(contour: Points, corners: Points) -> float:
    """The largest distance in px of a contour's points (N, 2) from the outline of the corners (n, 2)."""
    along = np.roll(corners, -1, axis=0) - corners
    arm = contour[:, None] - corners
    share = np.clip((arm * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-9), 0, 1)
    return float(np.linalg.norm(arm - share[..., None] * along, axis=2).min(axis=1).max())


def simplify_contour(contour: Points, count: int) -> tuple[Points, float]:
    """The ``count`` points of a closed contour that remain when the least prominent points are removed one by one.

    Returns:
        (count, 2) px, the points, and the smallest distance of a point from the line between its neighbours.
    """
    import cv2

    points = cv2.approxPolyDP(contour.astype(np.float32), 0.5, True)[:, 0].astype(np.float64)
    while True:
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        chord, arm = after - before, points - before
        area = np.abs(chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0])
        height = area / np.maximum(np.linalg.norm(chord, axis=1), 1e-9)
        if len(points) <= count:
            return points, float(height.min())
        points = np.delete(points, int(height.argmin()), axis=0)


def match_corners_by_direction(found: Points, at_rest: Points) -> NDArray[np.int64]:
    """(n,) int64: for every corner found, the corner at rest with the nearest direction from the centre."""
    directions = [points - points.mean(axis=0) for points in (found, at_rest)]
    directions = [direction / np.linalg.norm(direction, axis=1, keepdims=True) for direction in directions]
    return np.asarray((directions[0] @ directions[1].T).argmax(axis=1))


def is_shape_recognised(sides: int, edge_px: float, change_deg: float) -> bool:
    """Whether a cell with this change of shape is recognised, with the moved corner at its true position."""
    truth = bend_corner(regular_cell(sides, edge_px), change_deg)
    picture, origin = draw_cell(truth)
    found = find_cell_corners(picture, sides)
    if found is None:
        return False
    tolerance_px = max(MAX_OUTLINE_DISTANCE_PX, 0.1 * edge_px)
    return bool(np.linalg.norm(found - origin - truth[0], axis=1).min() <= tolerance_px)


def is_numbering_kept(sides: int, edge_px: float, angle_deg: float) -> bool:
    """Whether the corners of a cell with this rotation are recognised and get their own numbers."""
    at_rest = regular_cell(sides, edge_px)
    truth = turn_cell(at_rest, angle_deg)
    picture, origin = draw_cell(truth)
    found = find_cell_corners(picture, sides)
    if found is None:
        return False
    found = found - origin
    nearest = np.linalg.norm(found[:, None] - truth[None], axis=2).argmin(axis=1)
    return bool((match_corners_by_direction(found, at_rest) == nearest).all())
