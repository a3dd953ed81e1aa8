"""A scan or photo of a print sheet: whose it is, and how true it was printed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.sheet.key import BAR_MM, CODE_MM, THICK_MM, X_BAR, Y_BAR, SheetKey, parse_key

if TYPE_CHECKING:
    from cmpdesign.files.images import Image

Points = NDArray[np.float64]
# Codes are looked for in pictures of about this size; larger scans are reduced first.
SEARCH_PX = (2400, 1800, 1200)
# An end is searched this far from where the code says that it is, and measured over this part of the bar's
# width.
REACH_MM, ACROSS_MM, INSIDE_MM = 2.5, 0.6 * THICK_MM, 3.0
LEAST_CONTRAST = 40.0
REFINE_PASSES = 3
MM_PER_INCH = 25.4
NO_CODE = "no print sheet's code was found; scan the whole sheet, lying straight, at 150 dpi or more"


@dataclass(frozen=True, eq=False)
class SheetBars:
    """A sheet's code, and its bars as they lie in the picture.

    Attributes:
        key: the code's text.
        x_px, y_px: (2, 2) first and last end of each bar.
    """

    key: SheetKey
    x_px: Points
    y_px: Points


@dataclass(frozen=True)
class SheetReading:
    """What a sheet's picture tells.

    Attributes:
        key: the code's text.
        dpi: the picture's resolution in x and y, if it is known.
        length_x_px, length_y_px: of the two bars.
        scale_x, scale_y: print over design; None without the picture's resolution.
        ratio: scale_x / scale_y, which needs no resolution.
        skew_deg: by how much the angle between the x and the y bar exceeds 90 degrees.
        rotation_deg: of the x bar in the picture, clockwise.
        perspective_mm: how far the bars' ends lie off any print however stretched and skewed, as they do when
            a camera looks from aside; ratio and skew are then the camera's, too.
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
    """Find a sheet's code and bars, or say in a few words why that fails.

    Args:
        image: (H, W, 3) BGR, 8 or 16 bits.
    """
    grey = _gray_image(image)
    reason = NO_CODE
    for key, corners in _find_codes(grey):
        x_bar, y_bar = (_measure_bar(grey, corners, *bar) for bar in (X_BAR, Y_BAR))
        if x_bar is not None and y_bar is not None:
            return SheetBars(key, x_bar, y_bar)
        reason = "the code was read, but a scale bar beside it is covered, cut off or too pale"
    return reason


def measure_sheet(bars: SheetBars, dpi: tuple[float, float] | None = None) -> SheetReading:
    """The print's scales, as far as they are known, and its skew.

    Args:
        bars: as found.
        dpi: the scan's resolution in x and y; without it pixels are taken for square, and only the ratio of the
            scales is known.
    """
    per_px = np.ones(2) if dpi is None else MM_PER_INCH / np.array(dpi)
    x, y = (np.diff(ends, axis=0)[0] * per_px for ends in (bars.x_px, bars.y_px))
    length_x, length_y = float(np.hypot(*x)), float(np.hypot(*y))
    # The y bar runs up the page, against the image's y.
    between = np.degrees(np.arctan2(x[1] * y[0] - x[0] * y[1], x @ y))
    return SheetReading(
        key=bars.key,
        dpi=dpi,
        length_x_px=float(np.hypot(*(bars.x_px[1] - bars.x_px[0]))),
        length_y_px=float(np.hypot(*(bars.y_px[1] - bars.y_px[0]))),
        scale_x=None if dpi is None else length_x / BAR_MM,
        scale_y=None if dpi is None else length_y / BAR_MM,
        ratio=length_x / length_y,
        skew_deg=float(between) - 90.0,
        rotation_deg=float(np.degrees(np.arctan2(x[1], x[0]))),
        perspective_mm=_perspective_mm(bars),
    )


def _perspective_mm(bars: SheetBars) -> float:
    """What is left of the four ends when the best affine map is taken away."""
    ends = np.column_stack([np.array([*X_BAR, *Y_BAR]), np.ones(4)])
    seen = np.concatenate([bars.x_px, bars.y_px])
    affine, *_ = np.linalg.lstsq(ends, seen, rcond=None)
    off_mm = (ends @ affine - seen) @ np.linalg.inv(affine[:2])
    return float(np.hypot(*off_mm.T).max())


def _gray_image(image: Image) -> NDArray[np.uint8]:
    import cv2

    eight = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    return np.asarray(cv2.cvtColor(eight, cv2.COLOR_BGR2GRAY))


def _find_codes(grey: NDArray[np.uint8]) -> Iterator[tuple[SheetKey, Points]]:
    """Keys and their codes' (4, 2) corners: upper left, upper right, lower right, lower left.

    The detector misses codes that are small in a large picture, or of a size that it dislikes: several sizes
    are tried, and the picture's quarters; corners differ in quality, too.
    """
    import cv2

    detectors = (cv2.QRCodeDetectorAruco(), cv2.QRCodeDetector())
    for left, top, part in _search_regions(grey):
        # Pictures smaller than a size are taken as they are, once.
        factors = dict.fromkeys(min(1.0, side / max(part.shape)) for side in SEARCH_PX)
        for factor, detector in product(factors, detectors):
            size = cv2.INTER_AREA
            small = part if factor == 1 else cv2.resize(part, None, fx=factor, fy=factor, interpolation=size)
            text, corners, _ = detector.detectAndDecode(small)
            key = parse_key(text) if text else None
            if key is not None and corners is not None:
                # From the reduced picture's pixel centres to the whole one's.
                yield key, (corners.reshape(4, 2).astype(np.float64) + 0.5) / factor - 0.5 + (left, top)
    return None


def _search_regions(grey: NDArray[np.uint8]) -> Iterator[tuple[int, int, NDArray[np.uint8]]]:
    """The picture, then its overlapping quarters, with their upper left corners."""
    yield 0, 0, grey
    height, width = grey.shape
    tall, wide = (3 * height) // 5, (3 * width) // 5
    for top in (height - tall, 0):
        for left in (0, width - wide):
            yield left, top, grey[top : top + tall, left : left + wide]


def _measure_bar(
    grey: NDArray[np.uint8], corners: Points, first: tuple[float, float], last: tuple[float, float]
) -> Points | None:
    """(2, 2) both ends of a bar in the picture, to a fraction of a pixel."""
    ends = np.array([first, last])
    found = ends
    basis = _fit_code_affine(corners)
    # Ends that were found replace the code's poorer prediction of direction and scale.
    for _ in range(REFINE_PASSES):
        places = ends @ basis[:, :2].T + basis[:, 2]
        along = (places[1] - places[0]) / BAR_MM
        start, end = _find_bar_end(grey, places[0], -along), _find_bar_end(grey, places[1], along)
        if start is None or end is None:
            return None
        found = np.array([start, end])
        basis = _correct_affine(basis, ends, found)
    return found


def _fit_code_affine(corners: Points) -> Points:
    """(2, 3) affine map from mm beside the code to pixels."""
    code = np.array([(0, 0), (CODE_MM, 0), (CODE_MM, CODE_MM), (0, CODE_MM)])
    solution, *_ = np.linalg.lstsq(np.column_stack([code, np.ones(4)]), corners, rcond=None)
    return np.asarray(solution.T)


def _correct_affine(basis: Points, ends: Points, found: Points) -> Points:
    """The map corrected by a similarity so that it takes the ends to where they were found."""
    a, b = (complex(*p) for p in ends @ basis[:, :2].T + basis[:, 2])
    c, d = (complex(*p) for p in found)
    turn = (d - c) / (b - a)
    shift = c - turn * a
    matrix = np.array([(turn.real, -turn.imag), (turn.imag, turn.real)])
    return np.column_stack([matrix @ basis[:, :2], matrix @ basis[:, 2] + (shift.real, shift.imag)])


def _find_bar_end(grey: NDArray[np.uint8], place: Points, outward: Points) -> Points | None:
    """The middle of a bar's end; ``outward`` is a millimetre along the bar, in pixels."""
    side = np.array([-outward[1], outward[0]])
    # Across, a little inside the end: ink between two edges.
    inside = place - INSIDE_MM * outward
    edges = [_locate_edge_mm(grey, inside, direction, outward, THICK_MM / 2) for direction in (side, -side)]
    if edges[0] is None or edges[1] is None:
        return None
    middle = place + (edges[0] - edges[1]) / 2 * side
    along = _locate_edge_mm(grey, middle, outward, side, 0.0)
    return None if along is None else middle + along * outward


def _locate_edge_mm(
    grey: NDArray[np.uint8], place: Points, towards: Points, beside: Points, expected_mm: float
) -> float | None:
    """How far from ``place`` (mm) the mean brightness along ``beside`` is half way from ink to paper."""
    import cv2

    step_mm = 0.25 / float(np.hypot(*towards))
    reach = np.arange(expected_mm - REACH_MM, expected_mm + REACH_MM, step_mm)
    width = np.linspace(-ACROSS_MM / 2, ACROSS_MM / 2, 9)
    maps = (place + reach[:, None, None] * towards + width[None, :, None] * beside).astype(np.float32)
    values = cv2.remap(grey, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profile = values.astype(np.float64).mean(axis=1)
    dark, bright = np.percentile(profile, [10, 90])
    if bright - dark < LEAST_CONTRAST:
        return None
    level = (dark + bright) / 2
    rising = np.flatnonzero((profile[:-1] < level) & (profile[1:] >= level))
    if not len(rising):
        return None
    k = int(rising[np.argmin(np.abs(reach[rising] - expected_mm))])
    return float(reach[k] + (level - profile[k]) / (profile[k + 1] - profile[k]) * step_mm)
