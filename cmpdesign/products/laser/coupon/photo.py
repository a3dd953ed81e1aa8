"""The kerf from a photo or scan of a coupon.

The fiducials give the map from the coupon to the picture. Every opening is then seen as a profile across its sides:
what it darkens (or lights up) over the sheet's brightness, summed and divided by its full depth, is its width. Blur
moves brightness about but does not change the sum, so the width is right however soft the picture is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import Image
from cmpdesign.products.laser.coupon.design import Coupon, Opening, Patch

Values = NDArray[np.float64]
# Bright or dark ground beyond an opening that its profile is measured from, and how much of its length is used.
GROUND_MM, LENGTH_SHARE = 1.0, 0.6
PROFILE_BANDS = 8
SAMPLE_SPACING_PX = 0.5
MIN_ROUNDNESS = 0.84
MAX_CANDIDATES = 9
# A fifth mark farther from its place than this share of a mark's diameter belongs to some other piece.
MAX_FIFTH_MARK_ERROR = 0.35
# Marks look alike from above; a tilt by 50 degrees makes them 1.6 times as wide as high (log 1.6 = 0.45).
MAX_STRETCH = 0.7
SMALLEST_SCALE_PX_MM = 6.0
LEAST_CONTRAST = 20.0


class PhotoError(CmpDesignError, ValueError):
    """A picture in which no coupon can be measured."""


@dataclass(frozen=True)
class MeasuredWidth:
    """A kerf in mm with its standard uncertainty (one sigma)."""

    value_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class PatchKerf:
    """The kerf of one patch: of cuts that run in y (x) and in x (y)."""

    patch: Patch
    x: MeasuredWidth
    y: MeasuredWidth


@dataclass(frozen=True)
class CouponReading:
    """What a photo of a coupon says.

    Attributes:
        patches: the kerf of each patch.
        scale_px_mm: pixels in a millimetre.
        fit_mm: RMS distance of the fiducials from where the map puts them.
        from_back: the picture shows the coupon's back.
    """

    patches: tuple[PatchKerf, ...]
    scale_px_mm: float
    fit_mm: float
    from_back: bool


def read_coupon(coupon: Coupon, image: Image) -> CouponReading:
    """Measure the kerf.

    Args:
        coupon: what was cut.
        image: (H, W, 3) uint8 or uint16 BGR; openings darker or brighter than the sheet.

    Raises:
        PhotoError: the coupon is not found, too small, or of too little contrast.
    """
    gray = np.asarray(image, dtype=np.float64).mean(axis=2) / (256.0 if image.dtype == np.uint16 else 1.0)
    gray = np.ascontiguousarray(gray, dtype=np.float32)
    marks = np.array(coupon.fiducials_mm)
    centres = _find_fiducials(gray, coupon, marks)
    image_from_coupon, fit_mm, scale = _fit_homography(marks, centres, coupon, gray)
    if scale < SMALLEST_SCALE_PX_MM:
        raise PhotoError(
            f"the photo has {scale:.1f} px in a mm, limit {SMALLEST_SCALE_PX_MM:g} px; go nearer, or scan at 300 dpi"
        )
    relative = fit_mm / float(np.ptp(marks, axis=0).max())
    view = _CouponImage(
        gray, image_from_coupon, scale, relative, _fit_opening_level(coupon, gray, image_from_coupon)
    )
    patches = _measure_patches(coupon, view)
    turn = np.linalg.det(np.diff(image_from_coupon(marks[:3]), axis=0)) * np.linalg.det(
        np.diff(marks[:3], axis=0)
    )
    # The image's y runs down: seen from the front, the map turns the frame over.
    return CouponReading(patches, scale, fit_mm, bool(turn > 0))


PointMap = Callable[[Values], Values]


@dataclass(frozen=True, eq=False)
class _CouponImage:
    """The picture and what is known of it.

    Attributes:
        gray: (H, W) float32.
        to_image: coupon (mm) to image (px).
        scale: px in a mm.
        relative: how far the map may stretch lengths, as a share of them.
        inside: (N, 2) mm to the brightness of a wide opening there.
    """

    gray: NDArray[np.float32]
    to_image: PointMap
    scale: float
    scale_deviation: float
    inside: PointMap


def _find_fiducials(gray: NDArray[np.float32], coupon: Coupon, marks: Values) -> Values:
    """(5, 2) px, rough centres of the fiducials in the coupon's order."""
    best: tuple[float, Values] | None = None
    for candidates in _find_round_regions(gray):
        found = _assign_fiducials(candidates, marks, coupon.fiducial_diameter_mm)
        if found is not None and (best is None or found[0] < best[0]):
            best = found
    if best is None:
        raise PhotoError(
            "the coupon's five round marks were not found; show all of it, sharp, on an even ground that is much "
            "darker or brighter than the sheet"
        )
    return best[1]


def _find_round_regions(gray: NDArray[np.float32]) -> list[Values]:
    """(N, 3) x, y, area in px of round regions, the largest first; dark ones, then bright ones."""
    import cv2

    eight = np.clip(gray, 0, 255).astype(np.uint8)
    found = []
    for kind in (cv2.THRESH_BINARY_INV, cv2.THRESH_BINARY):
        _, binary = cv2.threshold(eight, 0, 255, kind + cv2.THRESH_OTSU)
        contours, _ = cv2.findContours(binary, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        round_ones = []
        for contour in contours:
            hull = cv2.convexHull(contour)
            area, length = cv2.contourArea(hull), cv2.arcLength(hull, True)
            if (
                area > 30
                and cv2.contourArea(contour) > 0.9 * area
                and 4 * np.pi * area / length**2 > MIN_ROUNDNESS
            ):
                (x, y), _ = cv2.minEnclosingCircle(hull)
                moments = cv2.moments(hull)
                x, y = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
                round_ones.append((x, y, area))
        round_ones.sort(key=lambda mark: -mark[2])
        found.append(np.array(round_ones).reshape(-1, 3))
    return found


def _assign_fiducials(candidates: Values, marks: Values, diameter_mm: float) -> tuple[float, Values] | None:
    """The assignment of five candidates to the marks whose fifth lies best where the other four put it.

    Larger round things may lie about, so windows of candidates of like size are tried.
    """
    best: tuple[float, Values] | None = None
    for start in range(max(len(candidates) - 4, 0)):
        alike = candidates[start:][candidates[start:, 2] > 0.4 * candidates[start, 2]][:MAX_CANDIDATES]
        for four in permutations(range(len(alike)), 4):
            found = _score_assignment(alike, four, marks, diameter_mm)
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        if best is not None:
            return best
    return None


def _score_assignment(
    alike: Values, four: tuple[int, ...], marks: Values, diameter_mm: float
) -> tuple[float, Values] | None:
    """How badly an assignment of the first four fits (place of the fifth, sizes of all), and all five centres."""
    import cv2

    source = marks[:4].astype(np.float32)
    image_from_coupon = cv2.getPerspectiveTransform(source, alike[list(four), :2].astype(np.float32))
    compass = diameter_mm / 2 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    rims = _project_points(image_from_coupon, (marks[:, None] + compass).reshape(-1, 2)).reshape(5, 4, 2)
    wide = np.linalg.norm(rims[:, 0] - rims[:, 1], axis=1)
    high = np.linalg.norm(rims[:, 2] - rims[:, 3], axis=1)
    rest = [i for i in range(len(alike)) if i not in four]
    if not rest or not np.isfinite(rims).all() or min(wide.min(), high.min()) <= 1:
        return None
    fifth = _project_points(image_from_coupon, marks[4:])
    away = np.linalg.norm(np.subtract(alike[rest, :2], fifth), axis=1)
    five = alike[[*four, rest[int(away.argmin())]]]
    measured = np.sqrt(4 * five[:, 2] / np.pi)
    stretch = max(np.abs(np.log(measured / np.sqrt(wide * high)))) + max(np.abs(np.log(wide / high)))
    place = float(away.min()) / float(measured[4])
    if place > MAX_FIFTH_MARK_ERROR or stretch > MAX_STRETCH:
        return None
    return float(place + stretch), five[:, :2]


def _project_points(homography: NDArray[Any], points: Values) -> Values:
    lifted = np.column_stack([points, np.ones(len(points))]) @ homography.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(lifted[:, :2] / lifted[:, 2:])


def _fit_homography(
    marks: Values, rough: Values, coupon: Coupon, gray: NDArray[np.float32]
) -> tuple[PointMap, float, float]:
    """The map from coupon (mm) to image (px), the RMS of the fit in mm, and the scale in px in a mm."""
    import cv2

    homography = cv2.findHomography(marks, rough)[0]
    local = _project_points(homography, np.vstack([marks, marks + (0.5, 0)]))
    radii = np.hypot(*(local[5:] - local[:5]).T) * coupon.fiducial_diameter_mm
    centres = np.array([_refine_centroid(gray, xy, radius) for xy, radius in zip(rough, radii, strict=True)])
    homography = cv2.findHomography(marks, centres)[0]
    scale = float(2 * np.median(radii) / coupon.fiducial_diameter_mm)
    # Five marks hold ten numbers, the map eight: two are left to tell how well it fits.
    rest = _project_points(homography, marks) - centres
    fit_mm = float(np.sqrt((rest**2).sum() / 2)) / scale
    return lambda points: _project_points(homography, points), fit_mm, scale


def _refine_centroid(gray: NDArray[np.float32], centre: Values, radius: float) -> Values:
    """The centre of brightness of a mark against its ground; blur and soft rims do not move it."""
    reach = int(np.ceil(1.5 * radius))
    x, y = np.rint(centre).astype(int)
    top, left = max(y - reach, 0), max(x - reach, 0)
    part = gray[top : y + reach + 1, left : x + reach + 1].astype(np.float64)
    rows, columns = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
    away = np.hypot(columns - centre[0], rows - centre[1])
    ground = float(np.median(part[(away > 1.25 * radius) & (away < 1.5 * radius)]))
    weight = np.where(away < 1.25 * radius, part - ground, 0)
    return np.asarray(np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum())


def _fit_opening_level(coupon: Coupon, gray: NDArray[np.float32], to_image: PointMap) -> PointMap:
    """Brightness inside openings over the whole piece: the plane through the widest opening of every patch.

    A slot is too narrow to show how dark it is inside, and no light is quite even.
    """
    wide = [
        max(p.openings, key=lambda opening: min(opening.width_mm, opening.height_mm)) for p in coupon.patches
    ]
    places = np.array([(opening.x_mm, opening.y_mm) for opening in wide])
    levels = np.array([_opening_level(opening, gray, to_image) for opening in wide])
    centre = places.mean(axis=0)
    plane = np.linalg.lstsq(np.column_stack([np.ones(len(places)), places - centre]), levels, rcond=None)[0]
    return lambda points: np.asarray(plane[0] + (points - centre) @ plane[1:])


def _measure_patches(coupon: Coupon, view: _CouponImage) -> tuple[PatchKerf, ...]:
    """Both kerfs of every patch: a square tells both, a slot the one across it."""
    x = [
        [_measure_excess_width(o, True, view) for o in p.openings if o.height_mm >= o.width_mm]
        for p in coupon.patches
    ]
    y = [
        [_measure_excess_width(o, False, view) for o in p.openings if o.width_mm >= o.height_mm]
        for p in coupon.patches
    ]
    kerfs = zip(coupon.patches, _pool_widths(x), _pool_widths(y), strict=True)
    return tuple(PatchKerf(patch, across_x, across_y) for patch, across_x, across_y in kerfs)


def _measure_excess_width(opening: Opening, across_x: bool, view: _CouponImage) -> MeasuredWidth:
    """Measured less nominal width of an opening, with what its bands and the map's scale leave uncertain."""
    width, length = opening.width_mm, opening.height_mm
    if not across_x:
        width, length = length, width
    half = width / 2 + GROUND_MM
    along = (np.arange(PROFILE_BANDS * 4) + 0.5) / (PROFILE_BANDS * 4) - 0.5
    count = int(np.ceil(2 * half * view.scale / SAMPLE_SPACING_PX))
    across = ((np.arange(count) + 0.5) / count - 0.5) * 2 * half
    place, band = np.meshgrid(across, along * LENGTH_SHARE * length)
    points = np.stack([place, band] if across_x else [band, place], axis=-1) + (opening.x_mm, opening.y_mm)
    profile = _band_means(_sample_image(view.gray, view.to_image, points))
    ground = _fit_ground_level(profile, across, half)
    depth = _band_means(view.inside(points)) - ground
    if np.abs(depth).min() < LEAST_CONTRAST:
        raise PhotoError(
            f"an opening at ({opening.x_mm:g}, {opening.y_mm:g}) mm differs from the sheet by "
            f"{np.abs(depth).min():.0f} of 255, limit {LEAST_CONTRAST:g}; light the sheet evenly and put a dark or "
            "bright ground behind it"
        )
    widths = ((profile - ground) / depth).sum(axis=1) * (2 * half / count)
    scatter = float(widths.std(ddof=1)) / np.sqrt(PROFILE_BANDS)
    return MeasuredWidth(float(widths.mean()) - width, float(np.hypot(scatter, view.scale_deviation * width)))


def _band_means(values: Values) -> Values:
    """(BANDS, N) means of neighbouring rows."""
    return np.asarray(values.reshape(PROFILE_BANDS, -1, values.shape[1]).mean(axis=1))


def _fit_ground_level(profile: Values, across: Values, half: float) -> Values:
    """The sheet's brightness along each profile: a straight line through both ends."""
    ends = np.abs(across) > half - 0.5 * GROUND_MM
    basis = np.stack([np.ones_like(across), across])
    weights = profile[:, ends] @ np.linalg.pinv(basis[:, ends])
    return np.asarray(weights @ basis)


def _opening_level(opening: Opening, gray: NDArray[np.float32], to_image: PointMap) -> float:
    """Of the inner half of an opening."""
    share = (np.arange(16) + 0.5) / 16 - 0.5
    x, y = np.meshgrid(0.5 * opening.width_mm * share, 0.5 * opening.height_mm * share)
    points = np.stack([x + opening.x_mm, y + opening.y_mm], axis=-1)
    return float(_sample_image(gray, to_image, points).mean())


def _sample_image(gray: NDArray[np.float32], to_image: PointMap, points_mm: Values) -> Values:
    import cv2

    xy = to_image(points_mm.reshape(-1, 2)).reshape(points_mm.shape).astype(np.float32)
    height, width = gray.shape
    inside = (xy >= 0).all() and (xy[..., 0] < width).all() and (xy[..., 1] < height).all()
    if not inside:
        raise PhotoError("a part of the coupon lies outside the picture; show all of it")
    sampled = cv2.remap(gray, xy[..., 0], xy[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, dtype=np.float64)


def _pool_widths(patches: list[list[MeasuredWidth]]) -> list[MeasuredWidth]:
    """The mean of each patch's widths.

    A patch has too few openings to tell by itself how much they differ; all patches together tell it.
    """
    values = [np.array([width.value_mm for width in widths]) for widths in patches]
    freedom = sum(len(v) - 1 for v in values)
    between = sum(float(((v - v.mean()) ** 2).sum()) for v in values) / max(freedom, 1)
    means = []
    for widths, found in zip(patches, values, strict=True):
        own = sum(width.sigma_mm**2 for width in widths) / len(widths) ** 2
        means.append(MeasuredWidth(float(found.mean()), float(np.sqrt(own + between / len(widths)))))
    return means
