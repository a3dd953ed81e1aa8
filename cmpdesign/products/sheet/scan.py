"""Measurement of a scan or photo of a print sheet: the key in the QR code, and the scales and skew of the print."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.sheet.key import BAR_MM, CODE_MM, THICK_MM, X_BAR, Y_BAR, SheetKey, parse_key

if TYPE_CHECKING:
    from cmpdesign.files.images import Image

Points = NDArray[np.float64]
# Longer sides to which a scan is reduced before the search for codes.
SEARCH_PX = (2400, 1800, 1200)
# A bar's end is searched within REACH_MM of its predicted place and measured over ACROSS_MM of the bar's width. The
# bar's sides are measured INSIDE_MM from the end.
REACH_MM, ACROSS_MM, INSIDE_MM = 2.5, 0.6 * THICK_MM, 3.0
# Least difference of gray levels between ink and paper.
MIN_CONTRAST = 40.0
# Passes of measuring a bar with a prediction corrected by the pass before.
REFINE_PASSES = 3
MM_PER_INCH = 25.4
NO_CODE = "no print sheet's code was found; scan the whole sheet, lying straight, at 150 dpi or more"


@dataclass(frozen=True, eq=False)
class SheetBars:
    """The key of a sheet and the places of the bars in the picture.

    Attributes:
        key: content of the code.
        x_px, y_px: (2, 2) first and last end of each bar, px.
    """

    key: SheetKey
    x_px: Points
    y_px: Points


@dataclass(frozen=True)
class SheetReading:
    """The measures of a print sheet's picture.

    Attributes:
        key: content of the code.
        dpi: resolution of the picture in x and y; None if unknown.
        length_x_px, length_y_px: lengths of the two bars.
        scale_x, scale_y: print over design; None without a resolution.
        ratio: scale_x / scale_y, which needs no resolution.
        skew_deg: angle between the x and the y bar, less 90 degrees.
        rotation_deg: angle of the x bar in the picture, clockwise.
        perspective_mm: largest distance of a bar's end from the best affine map of the design. A camera that looks
            at an angle makes this distance large; ratio and skew then contain an error by the camera's angle.
    """

    key: SheetKey
    dpi: tuple[float, float] | None
    length_x_px: float
    length_y_px: float
    scale_x: float | None
    scale_y: float | None
    ratio: float
    skew_deg: float
    rotation_deg: float
    perspective_mm: float

    def to_json(self) -> dict[str, Any]:
        return {"name": self.key.name, "digest": self.key.digest} | {
            name: getattr(self, name) for name in self.__dataclass_fields__ if name != "key"
        }


def find_sheet_bars(image: Image) -> SheetBars | str:
    """Find the code and the bars of a sheet.

    Args:
        image: (H, W, 3) BGR, uint8 or uint16.

    Returns:
        The code's key with the bars, or a text that states the reason for the failure.
    """
    gray = _gray_image(image)
    reason = NO_CODE
    for key, corners in _find_codes(gray):
        x_bar, y_bar = (_measure_bar(gray, corners, np.array(bar)) for bar in (X_BAR, Y_BAR))
        if x_bar is not None and y_bar is not None:
            return SheetBars(key, x_bar, y_bar)
        reason = "the code was read, but a scale bar beside it is covered, cut off or too pale"
    return reason


def measure_sheet(bars: SheetBars, dpi: tuple[float, float] | None = None) -> SheetReading:
    """Measure the scales and the skew of a print.

    Args:
        bars: from ``find_sheet_bars``.
        dpi: resolution of the scan in x and y. Without a resolution, pixels count as square and only the ratio of
            the scales is known.
    """
    unit_per_px = np.ones(2) if dpi is None else MM_PER_INCH / np.array(dpi)
    x, y = (np.diff(ends, axis=0)[0] * unit_per_px for ends in (bars.x_px, bars.y_px))
    length_x, length_y = float(np.hypot(*x)), float(np.hypot(*y))
    # The y bar points up the page, against the y axis of the image.
    angle_deg = np.degrees(np.arctan2(x[1] * y[0] - x[0] * y[1], x @ y))
    return SheetReading(
        key=bars.key,
        dpi=dpi,
        length_x_px=float(np.hypot(*(bars.x_px[1] - bars.x_px[0]))),
        length_y_px=float(np.hypot(*(bars.y_px[1] - bars.y_px[0]))),
        scale_x=None if dpi is None else length_x / BAR_MM,
        scale_y=None if dpi is None else length_y / BAR_MM,
        ratio=length_x / length_y,
        skew_deg=float(angle_deg) - 90.0,
        rotation_deg=float(np.degrees(np.arctan2(x[1], x[0]))),
        perspective_mm=_perspective_mm(bars),
    )


def _perspective_mm(bars: SheetBars) -> float:
    """The largest residual of the four ends after the least-squares affine map from design to picture, mm."""
    ends = np.column_stack([np.array([*X_BAR, *Y_BAR]), np.ones(4)])
    measured = np.concatenate([bars.x_px, bars.y_px])
    affine, *_ = np.linalg.lstsq(ends, measured, rcond=None)
    residual_mm = (ends @ affine - measured) @ np.linalg.inv(affine[:2])
    return float(np.hypot(*residual_mm.T).max())


def _gray_image(image: Image) -> NDArray[np.uint8]:
    import cv2

    eight = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    return np.asarray(cv2.cvtColor(eight, cv2.COLOR_BGR2GRAY))


def _find_codes(gray: NDArray[np.uint8]) -> Iterator[tuple[SheetKey, Points]]:
    """Keys with the (4, 2) corners of their codes: upper left, upper right, lower right, lower left, px.

    The detectors miss codes that are small in a large picture, and codes of certain sizes. The picture is therefore
    searched at several sizes, whole and in quarters, with two detectors whose corners differ in accuracy.
    """
    import cv2

    detectors = (cv2.QRCodeDetectorAruco(), cv2.QRCodeDetector())
    for region in _search_regions(gray):
        # A picture smaller than a search size is searched at its own size, once.
        factors = dict.fromkeys(min(1.0, side / max(region.gray.shape)) for side in SEARCH_PX)
        for factor, detector in product(factors, detectors):
            area = cv2.INTER_AREA
            reduced = (
                region.gray
                if factor == 1
                else cv2.resize(region.gray, None, fx=factor, fy=factor, interpolation=area)
            )
            try:
                text, corners, _ = detector.detectAndDecode(reduced)
            except cv2.error:  # raised for some ordinary pictures, as where corners lie on a line
                continue
            key = parse_key(text) if text else None
            if key is not None and corners is not None:
                # From pixel centres of the reduced region to those of the whole picture.
                in_region = (corners.reshape(4, 2).astype(np.float64) + 0.5) / factor - 0.5
                yield key, in_region + (region.left, region.top)
    return None


class _SearchRegion(NamedTuple):
    """A part of the picture with its upper left corner, px."""

    left: int
    top: int
    gray: NDArray[np.uint8]


def _search_regions(gray: NDArray[np.uint8]) -> Iterator[_SearchRegion]:
    """The picture, then four overlapping parts of 3/5 of its width and height."""
    yield _SearchRegion(0, 0, gray)
    height, width = gray.shape
    part_height, part_width = (3 * height) // 5, (3 * width) // 5
    for top in (height - part_height, 0):
        for left in (0, width - part_width):
            yield _SearchRegion(left, top, gray[top : top + part_height, left : left + part_width])


def _measure_bar(gray: NDArray[np.uint8], corners: Points, ends: Points) -> Points | None:
    """(2, 2) both ends of a bar in the picture, px; ``ends``: (2, 2) their places in mm."""
    found = ends
    affine = _fit_code_affine(corners)
    # Measured ends replace the code's less accurate prediction of direction and scale.
    for _ in range(REFINE_PASSES):
        places = ends @ affine[:, :2].T + affine[:, 2]
        along = (places[1] - places[0]) / BAR_MM
        start, end = _find_bar_end(gray, places[0], -along), _find_bar_end(gray, places[1], along)
        if start is None or end is None:
            return None
        found = np.array([start, end])
        affine = _correct_affine(affine, ends, found)
    return found


def _fit_code_affine(corners: Points) -> Points:
    """(2, 3) affine map from mm (see ``key``) to pixels, from the corners of the code."""
    code = np.array([(0, 0), (CODE_MM, 0), (CODE_MM, CODE_MM), (0, CODE_MM)])
    solution, *_ = np.linalg.lstsq(np.column_stack([code, np.ones(4)]), corners, rcond=None)
    return np.asarray(solution.T)


def _correct_affine(affine: Points, ends: Points, found: Points) -> Points:
    """(2, 3) the map followed by the similarity that takes the mapped ends to the found ends."""
    a, b = (complex(*p) for p in ends @ affine[:, :2].T + affine[:, 2])
    c, d = (complex(*p) for p in found)
    turn = (d - c) / (b - a)
    shift = c - turn * a
    matrix = np.array([(turn.real, -turn.imag), (turn.imag, turn.real)])
    return np.column_stack([matrix @ affine[:, :2], matrix @ affine[:, 2] + (shift.real, shift.imag)])


def _find_bar_end(gray: NDArray[np.uint8], place: Points, outward: Points) -> Points | None:
    """(2,) middle of a bar's end, px; ``outward``: one millimetre along the bar, px."""
    across = np.array([-outward[1], outward[0]])
    # The bar's two sides, a little inside the end.
    inside = place - INSIDE_MM * outward
    sides = [
        _locate_edge_mm(gray, inside, direction, outward, THICK_MM / 2) for direction in (across, -across)
    ]
    if sides[0] is None or sides[1] is None:
        return None
    middle = place + (sides[0] - sides[1]) / 2 * across
    along = _locate_edge_mm(gray, middle, outward, across, 0.0)
    return None if along is None else middle + along * outward


def _locate_edge_mm(
    gray: NDArray[np.uint8], place: Points, direction: Points, across: Points, expected_mm: float
) -> float | None:
    """Distance of the edge from ink to paper from ``place`` along ``direction``; None without an edge.

    At the edge the mean level along ``across`` is half way from ink to paper. ``direction`` and ``across`` are one
    millimetre long, in px.
    """
    import cv2

    spacing_mm = 0.25 / float(np.hypot(*direction))
    distances = np.arange(expected_mm - REACH_MM, expected_mm + REACH_MM, spacing_mm)
    width = np.linspace(-ACROSS_MM / 2, ACROSS_MM / 2, 9)
    points = place + distances[:, None, None] * direction + width[None, :, None] * across
    maps = points.astype(np.float32)
    values = cv2.remap(gray, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profile = values.astype(np.float64).mean(axis=1)
    dark, bright = np.percentile(profile, [10, 90])
    if bright - dark < MIN_CONTRAST:
        return None
    level = (dark + bright) / 2
    rising = np.flatnonzero((profile[:-1] < level) & (profile[1:] >= level))
    if not len(rising):
        return None
    k = int(rising[np.argmin(np.abs(distances[rising] - expected_mm))])
    return float(distances[k] + (level - profile[k]) / (profile[k + 1] - profile[k]) * spacing_mm)
