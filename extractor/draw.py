"""Pictures of the results: an image with its markers, and one picture for every stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.image.input import convert_to_bgr, in_native_order
from extractor.layout.reference import Reference
from extractor.result import Markers, Status

if TYPE_CHECKING:
    from extractor.cells.cell_mesh import CellMesh
    from extractor.cells.cells import Cells
    from extractor.cells.region_growing import Regions
    from extractor.cells.seeds import Seeds
    from extractor.cells.triangle_fit import Triangles
    from extractor.image.ink_segmentation import Segmentation
    from extractor.image.target_area import Target

Picture = NDArray[np.uint8]

SHORT_SIDE_PX = 1000  # smaller images are enlarged to about this side, so that ids are legible
ID_EDGE_PX = 30  # length of the edges from which ids are drawn
SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
# of no ink, red, green and blue
INK_BGR = np.array([[40, 40, 40], [60, 60, 230], [80, 190, 60], [230, 110, 60]], np.uint8)
STATUS_BGR = {
    Status.MEASURED: (80, 255, 255),
    Status.REPAIRED: (0, 160, 255),
    Status.FITTED: (255, 120, 255),
}
WHITE_BGR = (255, 255, 255)
CAPTION_BGR = (25, 25, 25)


class CaptionPart(NamedTuple):
    """A text of a caption, after a sample of what the text explains: "dot", "ring" or "line"; without a color, none."""

    text: str
    color: tuple[int, int, int] | None = None
    sample: str = "dot"


def draw_markers(image: NDArray[Any], reference: Reference, markers: Markers) -> Picture:
    """The image with its gridlines, markers (colored by status), ids, and a caption that is the legend.

    Args:
        image: as for ``Extractor.extract``.
        reference: the layout of the markers.
        markers: the markers of the image.

    Returns:
        (H * s, W * s, 3) uint8 BGR, enlarged by a whole number s where the image is small.
    """
    base = _bgr_picture(image)
    scale = _enlargement(base)
    canvas = _enlarged(base, scale, 0.7)
    points = _picture_coordinates(markers.xy_px, scale)
    _draw_edges(canvas, reference, points)
    legend = _summary(markers)
    if _draw_reference(canvas, reference, points):
        legend.append(CaptionPart("marker 0 of the white cell", WHITE_BGR, "ring"))
    if _draw_fiducials(canvas, reference, points):
        legend[-1] = CaptionPart("marker 0, and registration marks", WHITE_BGR, "ring")
    edge = _median_edge(reference, points)
    radius = float(np.clip(edge / 9, 1.5, 6.0))
    for status, color in STATUS_BGR.items():
        for x, y in points[markers.status == status]:
            _draw_dot(canvas, x, y, radius, color)
    if edge >= ID_EDGE_PX:
        _draw_ids(canvas, points, edge)
        legend.append(CaptionPart("numbers: ids"))
    draw_caption(canvas, legend)
    return canvas


def draw_stages(image: NDArray[Any], reference: Reference, markers: Markers) -> dict[str, Picture]:
    """One picture (H * s, W * s, 3) uint8 BGR for every stage that was reached, by the stage's name, in order.

    Args:
        image: as for ``Extractor.extract``.
        reference: the layout of the markers.
        markers: the markers of the image, with their ``stages``.
    """
    base = _bgr_picture(image)
    scale = _enlargement(base)
    results = markers.stages
    pictures: dict[str, Picture] = {}
    if results.get("target") is not None:
        pictures["target"] = _draw_target(base, scale, results["target"])
    if results.get("segment") is not None:
        pictures["segment"] = _resized_to_picture(INK_BGR[results["segment"].label], base, scale)
    if "seeds" in results:
        pictures["seeds"] = _draw_seeds(base, scale, results["segment"], results["seeds"])
    if "grow" in results:
        pictures["grow"] = _draw_regions(base, scale, results["grow"])
    if "triangles" in results:
        pictures["triangles"] = _draw_triangles(base, scale, results["triangles"])
    if results.get("mesh") is not None:
        pictures["mesh"] = _draw_mesh(base, scale, results["cells"], results["mesh"])
    if "place" in results:
        pictures["number"] = _draw_spiral(base, scale, reference, results["place"].xy_px)
        pictures["markers"] = draw_markers(image, reference, markers)
    return pictures


def _bgr_picture(image: NDArray[Any]) -> Picture:
    bgr = convert_to_bgr(image)
    if bgr is not None:
        return bgr
    gray = image if image.dtype == np.uint8 else cv2.convertScaleAbs(in_native_order(image), alpha=1 / 257)
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)  # type: ignore[return-value]


def _enlargement(base: Picture) -> int:
    return max(1, round(SHORT_SIDE_PX / int(min(base.shape[:2]))))


def _enlarged(base: Picture, scale: int, brightness: float) -> Picture:
    """The picture enlarged without smoothing, so that pixels stay visible, and dimmed as a background."""
    height, width = base.shape[:2]
    large = cv2.resize(base, (width * scale, height * scale), interpolation=cv2.INTER_NEAREST)
    return cv2.convertScaleAbs(large, alpha=brightness)  # type: ignore[return-value]


def _resized_to_picture(picture: Picture, base: Picture, scale: int) -> Picture:
    size = (base.shape[1] * scale, base.shape[0] * scale)
    return cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST)  # type: ignore[return-value]


def _picture_coordinates(xy_px: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Image coordinates (pixel centers at integers) in the enlarged picture."""
    return (xy_px + 0.5) * scale - 0.5


def _draw_dot(
    canvas: Picture, x: float, y: float, radius: float, color: tuple[int, int, int], thickness: int = -1
) -> None:
    unit = 1 << SHIFT
    center = round(x * unit), round(y * unit)
    cv2.circle(canvas, center, round(radius * unit), color, thickness, cv2.LINE_AA, SHIFT)


def _draw_lines(
    canvas: Picture, lines: NDArray[np.float64], color: tuple[int, int, int], thickness: int = 1
) -> None:
    """Draw N closed polygons (N, K, 2), or open lines (N, 2, 2)."""
    fixed = np.round(lines * (1 << SHIFT)).astype(np.int32)
    cv2.polylines(canvas, list(fixed), lines.shape[1] > 2, color, thickness, cv2.LINE_AA, SHIFT)


def _draw_edges(canvas: Picture, reference: Reference, points: NDArray[np.float64]) -> None:
    lines = points[reference.edges]
    _draw_lines(canvas, lines[np.isfinite(lines).all(axis=(1, 2))], (190, 190, 190))


def _draw_reference(canvas: Picture, reference: Reference, points: NDArray[np.float64]) -> bool:
    """Draw the white cell and a ring around its marker, and return whether their place is known."""
    corners = points[reference.cell_corners[reference.reference_cell]]
    if not np.isfinite(corners).all():
        return False
    _draw_lines(canvas, corners[None], WHITE_BGR, 2)
    x, y = points[reference.reference_marker]
    _draw_dot(canvas, x, y, 9.0, WHITE_BGR, 2)
    return True


def _draw_fiducials(canvas: Picture, reference: Reference, points: NDArray[np.float64]) -> bool:
    """Draw rings where the registration marks must be by the markers' homography, and return whether any was drawn."""
    known = np.isfinite(points[:, 0])
    if len(reference.fiducials_mm) == 0 or known.sum() < 4:
        return False
    homography, _ = cv2.findHomography(reference.xy_mm[known], points[known])
    if homography is None:
        return False
    angles = np.linspace(0.0, 2 * np.pi, 33)[:-1]
    ring = 0.5 * reference.fiducial_diameter_mm * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings_mm = (reference.fiducials_mm[:, None] + ring).reshape(-1, 1, 2)
    rings = np.asarray(cv2.perspectiveTransform(rings_mm, homography), np.float64)
    _draw_lines(canvas, rings.reshape(-1, len(ring), 2), WHITE_BGR, 2)
    return True


def _median_edge(reference: Reference, points: NDArray[np.float64]) -> float:
    lines = points[reference.edges]
    lengths = np.linalg.norm(lines[:, 0] - lines[:, 1], axis=1)
    known = lengths[np.isfinite(lengths)]
    return float(np.median(known)) if len(known) else 0.0


def _draw_ids(canvas: Picture, points: NDArray[np.float64], edge: float) -> None:
    size = float(np.clip(edge / 110, 0.3, 0.6))
    for marker in np.flatnonzero(np.isfinite(points[:, 0])):
        x, y = points[marker]
        corner = (round(x + edge * 0.08), round(y - edge * 0.08))
        cv2.putText(canvas, str(marker), corner, cv2.FONT_HERSHEY_SIMPLEX, size, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(canvas, str(marker), corner, cv2.FONT_HERSHEY_SIMPLEX, size, WHITE_BGR, 1, cv2.LINE_AA)


def _summary(markers: Markers) -> list[CaptionPart]:
    if markers.reason is not None and not np.any(markers.status):
        return [CaptionPart(f"nothing found: {markers.reason.replace('_', ' ')}")]
    counts = {status: int(np.sum(markers.status == status)) for status in STATUS_BGR}
    parts = [
        CaptionPart(f"{n} {status.name.lower()}", STATUS_BGR[status]) for status, n in counts.items() if n
    ]
    side = "back" if markers.mirrored else "front"
    return [*parts, CaptionPart(f"of {len(markers.status)} markers, seen from the {side}")]


def draw_caption(canvas: Picture, parts: Sequence[CaptionPart], at_top: bool = False) -> None:
    """Draw texts with their samples in a dark strip at the lower or upper side of a picture."""
    height, width = canvas.shape[:2]
    size = float(np.clip(width / 1600, 0.4, 1.0))
    top, x = 0 if at_top else height - round(34 * size), 12 * size
    cv2.rectangle(canvas, (0, top), (width, top + round(34 * size)), CAPTION_BGR, -1)
    for part in parts:
        if part.color is not None:
            _draw_sample(canvas, x + 9 * size, top + 17 * size, 7 * size, part)
            x += 26 * size
        text = part.text.encode("ascii", "replace").decode()
        origin = (round(x), top + round(23 * size))
        cv2.putText(canvas, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.7 * size, WHITE_BGR, 1, cv2.LINE_AA)
        x += cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.7 * size, 1)[0][0] + 22 * size


def _draw_sample(canvas: Picture, x: float, y: float, radius: float, part: CaptionPart) -> None:
    assert part.color is not None
    if part.sample == "line":
        _draw_lines(canvas, np.array([[(x - radius, y), (x + radius, y)]]), part.color)
    else:
        _draw_dot(canvas, x, y, radius, part.color, 2 if part.sample == "ring" else -1)


def _draw_target(base: Picture, scale: int, target: Target) -> Picture:
    height, width = base.shape[:2]
    tile_px = target.tile_px
    large = cv2.resize(target.mask, None, fx=tile_px, fy=tile_px, interpolation=cv2.INTER_NEAREST)
    mask = cv2.resize(large, (width, height), interpolation=cv2.INTER_NEAREST)
    return _enlarged(np.where(mask[..., None] > 0, base, base // 4).astype(np.uint8), scale, 1.0)


def _draw_seeds(base: Picture, scale: int, segmentation: Segmentation, seeds: Seeds) -> Picture:
    canvas = _resized_to_picture((INK_BGR[segmentation.label] // 2).astype(np.uint8), base, scale)
    total_scale = _level_scale(base, scale, segmentation.label)
    for x, y in _picture_coordinates(seeds.xy.astype(np.float64), total_scale):
        _draw_dot(canvas, x, y, 4.0, WHITE_BGR)
    return canvas


def _draw_regions(base: Picture, scale: int, regions: Regions) -> Picture:
    ink = np.concatenate([[0], regions.ink]).astype(np.uint8)
    return _resized_to_picture(INK_BGR[ink[regions.region_map]], base, scale)


def _level_scale(base: Picture, scale: int, level: NDArray[Any]) -> float:
    """Pixels of the enlarged picture for one pixel of the level in which the seeds were found."""
    return float(scale * round(base.shape[1] / level.shape[1]))


def _bright_color(ink: int) -> tuple[int, int, int]:
    blue, green, red = (min(int(level) + 60, 255) for level in INK_BGR[ink])
    return blue, green, red


def _draw_triangles(base: Picture, scale: int, triangles: Triangles) -> Picture:
    canvas = _enlarged(base, scale, 0.4)
    for ink in (1, 2, 3):
        corners = _picture_coordinates(triangles.corner_px[triangles.ink == ink], scale)
        _draw_lines(canvas, corners, _bright_color(ink), 2)
    return canvas


def _draw_mesh(base: Picture, scale: int, cells: Cells, mesh: CellMesh) -> Picture:
    """The faces between three centers, which are markers or black cells; faces that turn clockwise are yellow."""
    canvas = _enlarged(base, scale, 0.4)
    centers = _picture_coordinates(cells.center_px, scale)
    for turn, color in ((-1, (150, 150, 150)), (1, (80, 255, 255))):
        corners = centers[mesh.faces[mesh.orientation == turn]]
        middle = corners.mean(axis=1, keepdims=True)
        _draw_lines(canvas, middle + 0.8 * (corners - middle), color)
    for ink in (1, 2, 3):
        for x, y in centers[cells.ink == ink]:
            _draw_dot(canvas, x, y, 4.0, _bright_color(ink))
    return canvas


def _draw_spiral(base: Picture, scale: int, reference: Reference, xy_px: NDArray[np.float64]) -> Picture:
    """The order of the ids, blue to red: from the white cell's bottom corner around every layer."""
    canvas = _enlarged(base, scale, 0.4)
    points = _picture_coordinates(xy_px, scale)
    found = np.flatnonzero(np.isfinite(points[:, 0]))
    shades = cv2.applyColorMap(
        np.linspace(0, 255, max(len(found), 1)).astype(np.uint8)[:, None], cv2.COLORMAP_TURBO
    )
    for start, end, shade in zip(found[:-1], found[1:], shades[:, 0], strict=False):
        if end == start + 1:
            _draw_lines(canvas, points[[start, end]][None], tuple(int(c) for c in shade), 2)  # type: ignore[arg-type]
    _draw_reference(canvas, reference, points)
    return canvas
