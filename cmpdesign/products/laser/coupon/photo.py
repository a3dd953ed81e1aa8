"""The kerf from a photo or scan of a coupon.

The fiducials give the map from the coupon to the picture. Every opening is measured by a profile across its sides. The
sum of the level differences to the sheet, divided by the difference of a wide opening, is the opening's width. Blur
moves brightness but does not change the sum, so the width does not depend on blur.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import Image
from cmpdesign.products.laser.coupon.design import Coupon, Opening, Patch

Values = NDArray[np.float64]
# Width of the sheet beside an opening that the profile includes, and the share of the opening's length in use.
GROUND_MM, LENGTH_SHARE = 1.0, 0.6
# Bands along an opening; each gives one profile.
PROFILE_BANDS = 8
SAMPLE_SPACING_PX = 0.5
# Least 4 pi area / perimeter^2 of a fiducial's hull.
MIN_ROUNDNESS = 0.84
# Regions of similar size that are tried as fiducials at a time.
MAX_CANDIDATES = 9
# Largest distance of the fifth fiducial from its predicted place, as a share of a fiducial's diameter.
MAX_FIFTH_MARK_ERROR = 0.35
# Largest log ratio of sizes. A tilt by 50 degrees makes fiducials 1.6 times as wide as high (log 1.6 = 0.45).
MAX_STRETCH = 0.7
SMALLEST_SCALE_PX_MM = 6.0
# Least difference of levels (0 to 255) between an opening and the sheet.
LEAST_CONTRAST = 20.0


class PhotoError(CmpDesignError, ValueError):
    """A picture in which the coupon cannot be measured."""


@dataclass(frozen=True)
class MeasuredWidth:
    """A width in mm with its standard deviation."""

    value_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class PatchKerf:
    """The kerf of one patch: ``x`` of cuts along y, ``y`` of cuts along x."""

    patch: Patch
    x: MeasuredWidth
    y: MeasuredWidth


@dataclass(frozen=True)
class CouponReading:
    """The measures of a coupon's picture.

    Attributes:
        patches: the kerf of each patch.
        scale_px_mm: pixels per millimetre.
        fit_mm: RMS distance of the fiducials from their places by the fitted map.
        from_back: the picture shows the coupon's back.
    """

    patches: tuple[PatchKerf, ...]
    scale_px_mm: float
    fit_mm: float
    from_back: bool


def read_coupon(coupon: Coupon, image: Image) -> CouponReading:
    """Measure the kerf of every patch.

    Args:
        coupon: the coupon that was cut.
        image: (H, W, 3) uint8 or uint16 BGR; openings are darker or brighter than the sheet.

    Raises:
        PhotoError: the coupon is not found, too small, or has too little contrast.
    """
    gray = np.asarray(image, dtype=np.float64).mean(axis=2) / (256.0 if image.dtype == np.uint16 else 1.0)
    gray = np.ascontiguousarray(gray, dtype=np.float32)
    marks = np.array(coupon.fiducials_mm)
    centres = _find_fiducials(gray, coupon, marks)
    fit = _fit_homography(marks, centres, coupon, gray)
    if fit.scale < SMALLEST_SCALE_PX_MM:
        raise PhotoError(
            f"the photo has {fit.scale:.1f} px in a mm, limit {SMALLEST_SCALE_PX_MM:g} px; go nearer, "
            "or scan at 300 dpi"
        )
    scale_deviation = fit.rms_mm / float(np.ptp(marks, axis=0).max())
    opening_level = _fit_opening_level(coupon, gray, fit.to_image)
    picture = _CouponImage(gray, fit.to_image, fit.scale, scale_deviation, opening_level)
    patches = _measure_patches(coupon, picture)
    turn = np.linalg.det(np.diff(fit.to_image(marks[:3]), axis=0)) * np.linalg.det(np.diff(marks[:3], axis=0))
    # The y axis of the image points down, so the map mirrors a coupon that is shown from the front.
    return CouponReading(patches, fit.scale, fit.rms_mm, bool(turn > 0))


PointMap = Callable[[Values], Values]


@dataclass(frozen=True, eq=False)
class _CouponImage:
    """The picture of a coupon with its map and levels.

    Attributes:
        gray: (H, W) float32, 0 to 255.
        to_image: (N, 2) coupon (mm) -> (N, 2) image (px).
        scale: px per mm.
        scale_deviation: relative deviation of lengths by the map.
        opening_level: (..., 2) mm -> level of a wide opening at this place.
    """

    gray: NDArray[np.float32]
    to_image: PointMap
    scale: float
    scale_deviation: float
    opening_level: PointMap


def _find_fiducials(gray: NDArray[np.float32], coupon: Coupon, marks: Values) -> Values:
    """(5, 2) approximate centres of the fiducials in the coupon's order, px."""
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
    """The dark and then the bright round regions: each (N, 3) x, y, area in px, the largest first."""
    import cv2

    gray_8_bit = np.clip(gray, 0, 255).astype(np.uint8)
    found = []
    for kind in (cv2.THRESH_BINARY_INV, cv2.THRESH_BINARY):
        _, binary = cv2.threshold(gray_8_bit, 0, 255, kind + cv2.THRESH_OTSU)
        contours, _ = cv2.findContours(binary, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        regions = []
        for contour in contours:
            hull = cv2.convexHull(contour)
            area, length = cv2.contourArea(hull), cv2.arcLength(hull, True)
            if (
                area > 30
                and cv2.contourArea(contour) > 0.9 * area
                and 4 * np.pi * area / length**2 > MIN_ROUNDNESS
            ):
                moments = cv2.moments(hull)
                x, y = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
                regions.append((x, y, area))
        regions.sort(key=lambda region: -region[2])
        found.append(np.array(regions).reshape(-1, 3))
    return found


def _assign_fiducials(candidates: Values, marks: Values, diameter_mm: float) -> tuple[float, Values] | None:
    """The assignment of candidates to the five marks with the least misfit: the misfit and (5, 2) centres, px.

    The picture may show larger round objects, so candidates are tried in groups of similar size.
    """
    best: tuple[float, Values] | None = None
    for start in range(max(len(candidates) - 4, 0)):
        similar = candidates[start:][candidates[start:, 2] > 0.4 * candidates[start, 2]][:MAX_CANDIDATES]
        for four in permutations(range(len(similar)), 4):
            found = _score_assignment(similar, four, marks, diameter_mm)
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        if best is not None:
            return best
    return None


def _score_assignment(
    similar: Values, four: tuple[int, ...], marks: Values, diameter_mm: float
) -> tuple[float, Values] | None:
    """Score an assignment of four candidates to the first four marks.

    Returns:
        The misfit (error of the fifth mark's place, and of all sizes) and (5, 2) centres in px; None if rejected.
    """
    import cv2

    source = marks[:4].astype(np.float32)
    homography = cv2.getPerspectiveTransform(source, similar[list(four), :2].astype(np.float32))
    compass = diameter_mm / 2 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    rims = _project_points(homography, (marks[:, None] + compass).reshape(-1, 2)).reshape(5, 4, 2)
    width = np.linalg.norm(rims[:, 0] - rims[:, 1], axis=1)
    height = np.linalg.norm(rims[:, 2] - rims[:, 3], axis=1)
    others = [i for i in range(len(similar)) if i not in four]
    if not others or not np.isfinite(rims).all() or min(width.min(), height.min()) <= 1:
        return None
    fifth = _project_points(homography, marks[4:])
    distance = np.linalg.norm(np.subtract(similar[others, :2], fifth), axis=1)
    five = similar[[*four, others[int(distance.argmin())]]]
    diameter = np.sqrt(4 * five[:, 2] / np.pi)
    stretch = max(np.abs(np.log(diameter / np.sqrt(width * height)))) + max(np.abs(np.log(width / height)))
    fifth_error = float(distance.min()) / float(diameter[4])
    if fifth_error > MAX_FIFTH_MARK_ERROR or stretch > MAX_STRETCH:
        return None
    return float(fifth_error + stretch), five[:, :2]


def _project_points(homography: NDArray[Any], points: Values) -> Values:
    """(N, 2) points mapped by a (3, 3) homography."""
    projected = np.column_stack([points, np.ones(len(points))]) @ homography.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(projected[:, :2] / projected[:, 2:])


class _HomographyFit(NamedTuple):
    """The map from coupon (mm) to image (px), the RMS misfit of the fiducials in mm, and the scale in px per mm."""

    to_image: PointMap
    rms_mm: float
    scale: float


def _fit_homography(
    marks: Values, approximate: Values, coupon: Coupon, gray: NDArray[np.float32]
) -> _HomographyFit:
    """Fit the map to the centres of the fiducials, refined from approximate centres (5, 2) in px."""
    import cv2

    homography = cv2.findHomography(marks, approximate)[0]
    local = _project_points(homography, np.vstack([marks, marks + (0.5, 0)]))
    radii = np.hypot(*(local[5:] - local[:5]).T) * coupon.fiducial_diameter_mm
    centres = np.array(
        [_refine_centroid(gray, xy, radius) for xy, radius in zip(approximate, radii, strict=True)]
    )
    homography = cv2.findHomography(marks, centres)[0]
    scale = float(2 * np.median(radii) / coupon.fiducial_diameter_mm)
    # Five marks give ten equations for eight unknowns: two degrees of freedom remain for the RMS.
    residual = _project_points(homography, marks) - centres
    rms_mm = float(np.sqrt((residual**2).sum() / 2)) / scale
    return _HomographyFit(lambda points: _project_points(homography, points), rms_mm, scale)


def _refine_centroid(gray: NDArray[np.float32], centre: Values, radius: float) -> Values:
    """(2,) centroid of a fiducial's level over its surroundings, px; blur does not move the centroid."""
    reach = int(np.ceil(1.5 * radius))
    x, y = np.rint(centre).astype(int)
    top, left = max(y - reach, 0), max(x - reach, 0)
    window = gray[top : y + reach + 1, left : x + reach + 1].astype(np.float64)
    rows, columns = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
    distance = np.hypot(columns - centre[0], rows - centre[1])
    ground = float(np.median(window[(distance > 1.25 * radius) & (distance < 1.5 * radius)]))
    weight = np.where(distance < 1.25 * radius, window - ground, 0)
    return np.asarray(np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum())


def _fit_opening_level(coupon: Coupon, gray: NDArray[np.float32], to_image: PointMap) -> PointMap:
    """The level inside openings as a plane over the coupon, fitted to the widest opening of every patch.

    A blurred slot is too narrow to show its level, and the light may be uneven.
    """
    widest = [
        max(p.openings, key=lambda opening: min(opening.width_mm, opening.height_mm)) for p in coupon.patches
    ]
    places = np.array([(opening.x_mm, opening.y_mm) for opening in widest])
    levels = np.array([_opening_level(opening, gray, to_image) for opening in widest])
    centre = places.mean(axis=0)
    plane = np.linalg.lstsq(np.column_stack([np.ones(len(places)), places - centre]), levels, rcond=None)[0]
    return lambda points: np.asarray(plane[0] + (points - centre) @ plane[1:])


def _measure_patches(coupon: Coupon, picture: _CouponImage) -> tuple[PatchKerf, ...]:
    """Both kerfs of every patch: a square gives both, a slot the kerf across the slot."""
    x = [
        [_measure_excess_width(o, True, picture) for o in p.openings if o.height_mm >= o.width_mm]
        for p in coupon.patches
    ]
    y = [
        [_measure_excess_width(o, False, picture) for o in p.openings if o.width_mm >= o.height_mm]
        for p in coupon.patches
    ]
    kerfs = zip(coupon.patches, _pool_widths(x), _pool_widths(y), strict=True)
    return tuple(PatchKerf(patch, across_x, across_y) for patch, across_x, across_y in kerfs)


def _measure_excess_width(opening: Opening, across_x: bool, picture: _CouponImage) -> MeasuredWidth:
    """Measured less nominal width of an opening; the deviation combines the scatter of bands and the map's scale."""
    width, length = opening.width_mm, opening.height_mm
    if not across_x:
        width, length = length, width
    half = width / 2 + GROUND_MM
    along = (np.arange(PROFILE_BANDS * 4) + 0.5) / (PROFILE_BANDS * 4) - 0.5
    count = int(np.ceil(2 * half * picture.scale / SAMPLE_SPACING_PX))
    across = ((np.arange(count) + 0.5) / count - 0.5) * 2 * half
    place, band = np.meshgrid(across, along * LENGTH_SHARE * length)
    points = np.stack([place, band] if across_x else [band, place], axis=-1) + (opening.x_mm, opening.y_mm)
    profile = _band_means(_sample_image(picture.gray, picture.to_image, points))
    ground = _fit_ground_level(profile, across, half)
    contrast = _band_means(picture.opening_level(points)) - ground
    if np.abs(contrast).min() < LEAST_CONTRAST:
        raise PhotoError(
            f"an opening at ({opening.x_mm:g}, {opening.y_mm:g}) mm differs from the sheet by "
            f"{np.abs(contrast).min():.0f} of 255, limit {LEAST_CONTRAST:g}; light the sheet evenly and put a dark or "
            "bright ground behind it"
        )
    widths = ((profile - ground) / contrast).sum(axis=1) * (2 * half / count)
    scatter = float(widths.std(ddof=1)) / np.sqrt(PROFILE_BANDS)
    deviation = float(np.hypot(scatter, picture.scale_deviation * width))
    return MeasuredWidth(float(widths.mean()) - width, deviation)


def _band_means(values: Values) -> Values:
    """(PROFILE_BANDS, N) means of neighbouring rows."""
    return np.asarray(values.reshape(PROFILE_BANDS, -1, values.shape[1]).mean(axis=1))


def _fit_ground_level(profile: Values, across: Values, half: float) -> Values:
    """(PROFILE_BANDS, N) level of the sheet along each profile: a straight line fitted to both ends."""
    ends = np.abs(across) > half - 0.5 * GROUND_MM
    basis = np.stack([np.ones_like(across), across])
    coefficients = profile[:, ends] @ np.linalg.pinv(basis[:, ends])
    return np.asarray(coefficients @ basis)


def _opening_level(opening: Opening, gray: NDArray[np.float32], to_image: PointMap) -> float:
    """The mean level of the inner half (in width and height) of an opening."""
    share = (np.arange(16) + 0.5) / 16 - 0.5
    x, y = np.meshgrid(0.5 * opening.width_mm * share, 0.5 * opening.height_mm * share)
    points = np.stack([x + opening.x_mm, y + opening.y_mm], axis=-1)
    return float(_sample_image(gray, to_image, points).mean())


def _sample_image(gray: NDArray[np.float32], to_image: PointMap, points_mm: Values) -> Values:
    """Levels at (..., 2) points of the coupon, by bilinear interpolation."""
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

    The variance between the openings of a patch is pooled over all patches, because a patch has few openings.
    """
    values = [np.array([width.value_mm for width in widths]) for widths in patches]
    freedom = sum(len(v) - 1 for v in values)
    between = sum(float(((v - v.mean()) ** 2).sum()) for v in values) / max(freedom, 1)
    means = []
    for widths, in_patch in zip(patches, values, strict=True):
        within = sum(width.sigma_mm**2 for width in widths) / len(widths) ** 2
        means.append(MeasuredWidth(float(in_patch.mean()), float(np.sqrt(within + between / len(widths)))))
    return means
