"""The quiver plot: the displacements of one frame's markers from rest, as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.drawing.svg import scale_length_mm

if TYPE_CHECKING:
    from extractor.layout.reference import Reference
    from extractor.track.displacement import Rest
    from extractor.track.tracker import Tracked

Picture = NDArray[np.uint8]

SIDE_PX = 1000  # the longer side of the drawing
MARGIN_PX = 60
FOOT_PX = 70
BAR_PX = 300
LONGEST_EDGES = 1.5  # length of the longest arrow (about), in median edges
NOISE_EDGES = 0.15  # largest length of an arrow of the noise's standard deviation, in median edges
NOISE_BGR = (60, 60, 200)
FIXED_BITS = 4  # fractional bits of OpenCV's coordinates
GRID_BGR = (215, 215, 215)
TEXT_BGR = (40, 40, 40)


def draw_quiver(reference: Reference, rest: Rest, frame: Tracked) -> Picture:
    """Draw the gridlines at rest and an arrow for every marker with a displacement.

    Arrows have the direction of the image. They are magnified by the integer factor in the caption and colored by
    their length. The legend has the colors, an arrow of a round length, and a circle with the radius of the noise,
    both magnified like the arrows; noise alone is not magnified to visible arrows.

    Returns:
        (H, W, 3) uint8 BGR.
    """
    import cv2

    known = np.isfinite(frame.displacement_px[:, 0])
    scale, origin = _drawing_scale(rest.xy_px)
    points = (rest.xy_px - origin) * scale + MARGIN_PX
    size = np.nanmax(points, axis=0) + MARGIN_PX
    canvas = np.full((int(size[1]) + FOOT_PX, int(size[0]), 3), 255, np.uint8)
    lines = points[reference.edges]
    _draw_polylines(canvas, lines[np.isfinite(lines).all(axis=(1, 2))], GRID_BGR, 1)
    length = np.linalg.norm(frame.displacement_px[known], axis=1)
    largest = float(length.max()) if len(length) else 0.0
    noise_px = displacement_sigma_px(frame)
    magnification = _magnification(lines, largest * scale, noise_px * scale)
    tips = points[known] + frame.displacement_px[known] * scale * magnification
    shade = np.round(255 * length / max(largest, 1e-12)).astype(np.uint8)
    colors = cv2.applyColorMap(shade[:, None], cv2.COLORMAP_VIRIDIS)[:, 0] if len(shade) else shade
    for start, tip, color in zip(points[known], tips, colors, strict=True):
        _draw_arrow(canvas, start, tip, tuple(int(c) for c in color))
    _draw_footer(canvas, frame, largest, magnification)
    _draw_scale_arrow(canvas, largest, scale * magnification)
    _draw_noise(canvas, noise_px, noise_px * scale * magnification)
    return canvas


def _drawing_scale(xy_px: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """The scale from image to drawing, and (2,) the image point at the drawing's margin."""
    low, high = np.nanmin(xy_px, axis=0), np.nanmax(xy_px, axis=0)
    return (SIDE_PX - 2 * MARGIN_PX) / max(float((high - low).max()), 1.0), low


def displacement_sigma_px(frame: Tracked) -> float:
    """The standard deviation of a displacement per axis: from the frame's measured markers, with the same deviation at
    rest.

    0 where no marker is measured.
    """
    variances = frame.markers.cov_px2[frame.markers.status == 1][:, (0, 1), (0, 1)]
    return float(np.sqrt(2 * np.median(variances))) if variances.size else 0.0


def _magnification(lines: NDArray[np.float64], longest: float, noise: float) -> int:
    """The factor for arrows, from (E, 2, 2) edges, the longest arrow and the noise in the drawing, px."""
    edge = float(np.nanmedian(np.linalg.norm(lines[:, 0] - lines[:, 1], axis=1)))
    factors = [
        edges * edge / size for edges, size in ((LONGEST_EDGES, longest), (NOISE_EDGES, noise)) if size > 0
    ]
    return max(1, int(min(factors))) if longest > 0 else 1


def _draw_polylines(canvas: Picture, lines: NDArray[np.float64], color: Any, thickness: int) -> None:
    import cv2

    fixed = np.round(lines * (1 << FIXED_BITS)).astype(np.int32)
    cv2.polylines(canvas, list(fixed), False, color, thickness, cv2.LINE_AA, FIXED_BITS)


def _draw_arrow(canvas: Picture, start: NDArray[np.float64], tip: NDArray[np.float64], color: Any) -> None:
    direction = tip - start
    length = float(np.hypot(*direction))
    if length < 0.5:
        return
    head = direction / length * min(0.35 * length, 9.0)
    half_width = 0.5 * np.array([-head[1], head[0]])
    _draw_polylines(canvas, np.stack([start, tip])[None], color, 2)
    _draw_polylines(canvas, np.stack([tip - head + half_width, tip, tip - head - half_width])[None], color, 2)


def _draw_footer(canvas: Picture, frame: Tracked, largest_px: float, magnification: int) -> None:
    import cv2

    height, width = canvas.shape[:2]
    bar = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[None], cv2.COLORMAP_VIRIDIS)
    top, left = height - FOOT_PX + 15, MARGIN_PX
    right = min(left + BAR_PX, width - MARGIN_PX)
    canvas[top : top + 14, left:right] = cv2.resize(bar, (right - left, 14))
    mm = np.linalg.norm(frame.displacement_mm, axis=1)
    largest_mm = f" = {np.nanmax(mm):.4g} mm" if np.isfinite(mm).any() else ""
    text = f"0 to {largest_px:.3g} px{largest_mm}; arrows x {magnification} from rest (gray); frame {frame.index}"
    baseline = (left, top + 42)
    cv2.putText(canvas, text, baseline, cv2.FONT_HERSHEY_SIMPLEX, 0.6, TEXT_BGR, 1, cv2.LINE_AA)


def _draw_scale_arrow(canvas: Picture, largest_px: float, magnified: float) -> None:
    """Draw an arrow of a round length in image pixels beside the colors; ``magnified`` is its scale in the drawing."""
    import cv2

    if not largest_px * magnified >= 1:
        return
    length_px = scale_length_mm(2 * largest_px)
    start = np.array([MARGIN_PX + BAR_PX + 40.0, canvas.shape[0] - FOOT_PX + 22.0])
    tip = start + (length_px * magnified, 0)
    _draw_arrow(canvas, start, tip, TEXT_BGR)
    place = (round(tip[0]) + 10, round(tip[1]) + 6)
    cv2.putText(canvas, f"{length_px:g} px", place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, TEXT_BGR, 1, cv2.LINE_AA)


def _draw_noise(canvas: Picture, noise_px: float, radius: float) -> None:
    """Draw the standard deviation of a displacement as a circle in the scale of the arrows, with its value."""
    import cv2

    height, width = canvas.shape[:2]
    x, y = width - MARGIN_PX - 20, height - FOOT_PX // 2
    fixed = 1 << FIXED_BITS
    cv2.circle(canvas, (x * fixed, y * fixed), round(radius * fixed), NOISE_BGR, 1, cv2.LINE_AA, FIXED_BITS)
    text = f"noise {noise_px:.2g} px (1 sigma)"
    size = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)[0]
    place = (x - size[0] - 25, y + size[1] // 2 - 12)
    cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, NOISE_BGR, 1, cv2.LINE_AA)
