"""Pictures of the results: an image with its markers, and one picture for every stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.image.input import convert_to_bgr, in_native_order
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.reference import Reference
from extractor.result import Markers, Status

if TYPE_CHECKING:
    from extractor.cells.cell_mesh import CellMesh
    from extractor.cells.cells import Cells
    from extractor.numbering.lattice_walk import Walk
    from extractor.numbering.missing_cells import NumberedTriangles

Picture = NDArray[np.uint8]

SHORT_SIDE_PX = 1000  # smaller images are enlarged to about this side, so that ids are legible
ID_EDGE_PX = 30  # length of the edges from which ids are drawn
SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
INK_BGR = ((120, 120, 255), (140, 250, 120), (255, 170, 120))  # red, green and blue
CLASS_BGR = ((255, 220, 60), (255, 90, 220), (60, 220, 255))  # of (q - r) mod 3, before inks have names
STATUS_BGR = {
    Status.MEASURED: (80, 255, 255),
    Status.REPAIRED: (0, 160, 255),
    Status.FITTED: (255, 120, 255),
}
WHITE_BGR = (255, 255, 255)
GRAY_BGR = (150, 150, 150)
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
    if "walk" in results:
        pictures["seeds"] = _draw_cells(base, scale, results["seeds"])
        cells = results["seeds"]
        # growing may have been tried at another scale than that of the walk
        if "grow" in results and len(results["grow"].area_px) == len(cells.area_px):
            cells = results["grow"]
            pictures["grow"] = _draw_cells(base, scale, cells)
        pictures["mesh"] = _draw_mesh(base, scale, cells, results["mesh"])
        pictures["walk"] = _draw_walk(base, scale, cells, results["walk"])
    if "place" in results:
        pictures["triangles"] = _draw_triangles(base, scale, reference, results["triangles"])
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


def _picture_coordinates(xy_px: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Image coordinates (pixel centres at integers) in the enlarged picture."""
    return (xy_px + 0.5) * scale - 0.5


def _draw_dot(
    canvas: Picture, x: float, y: float, radius: float, color: tuple[int, int, int], thickness: int = -1
) -> None:
    unit = 1 << SHIFT
    centre = round(x * unit), round(y * unit)
    cv2.circle(canvas, centre, round(radius * unit), color, thickness, cv2.LINE_AA, SHIFT)


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


def _draw_cells(base: Picture, scale: int, cells: Cells) -> Picture:
    """The triangles of the regions that may be cells."""
    canvas = _enlarged(base, scale, 0.4)
    _draw_lines(canvas, _picture_coordinates(cells.corner_px, scale), WHITE_BGR)
    return canvas


def _draw_mesh(base: Picture, scale: int, cells: Cells, mesh: CellMesh) -> Picture:
    """The links between the centres of cells; cells without a link are gray dots."""
    canvas = _enlarged(base, scale, 0.4)
    centres = _picture_coordinates(cells.centre_px, scale)
    one, step = np.nonzero(mesh.links.neighbours >= 0)
    other = mesh.links.neighbours[one, step]
    _draw_lines(canvas, np.stack([centres[one], centres[other]], axis=1), STATUS_BGR[Status.MEASURED])
    for (x, y), is_linked in zip(centres, mesh.is_linked, strict=True):
        _draw_dot(canvas, x, y, 4.0, WHITE_BGR if is_linked else GRAY_BGR)
    return canvas


def _draw_walk(base: Picture, scale: int, cells: Cells, walk: Walk) -> Picture:
    """The cells with the color of their class; those of the largest part are filled."""
    canvas = _enlarged(base, scale, 0.4)
    corners = _picture_coordinates(cells.corner_px, scale)
    _draw_lines(canvas, corners[walk.part < 0], GRAY_BGR)
    largest = int(walk.sizes.argmax()) if len(walk.sizes) else -1
    kind = (walk.axial[:, 0] - walk.axial[:, 1]) % 3
    for number, color in enumerate(CLASS_BGR):
        own = (kind == number) & (walk.part >= 0)
        _draw_lines(canvas, corners[own], color, 2)
        filled = np.round(corners[own & (walk.part == largest)] * (1 << SHIFT)).astype(np.int32)
        for corner in filled:
            cv2.fillConvexPoly(canvas, corner, color, cv2.LINE_AA, SHIFT)
    return canvas


def _draw_triangles(base: Picture, scale: int, reference: Reference, triangles: NumberedTriangles) -> Picture:
    """The measured triangles with the color of their ink."""
    canvas = _enlarged(base, scale, 0.4)
    is_measured = np.isfinite(triangles.corner_px[:, 0, 0])
    ink = lattice_of(reference).ink[triangles.cell]
    for number, color in enumerate(INK_BGR):
        corners = triangles.corner_px[is_measured & (ink == number + 1)]
        _draw_lines(canvas, _picture_coordinates(corners, scale), color, 2)
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
