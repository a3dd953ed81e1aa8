"""The fiducials of a coupon in a picture, and the map from the coupon to the picture."""

from __future__ import annotations

from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.coupon.design import Coupon
from cmpdesign.products.laser.coupon.picture import LightImage, PhotoError, PointMap, Values

# Least 4 pi area / perimeter^2 of a fiducial's hull.
MIN_ROUNDNESS = 0.84
# Regions of similar size that are tried as fiducials at a time.
MAX_CANDIDATES = 9
# Largest distance of the fifth fiducial from its predicted place, as a share of a fiducial's diameter.
MAX_FIFTH_MARK_ERROR = 0.35
# Largest log ratio of sizes. A tilt by 50 degrees makes fiducials 1.6 times as wide as high (log 1.6 = 0.45).
MAX_STRETCH = 0.7


def find_fiducials(gray: NDArray[np.uint8], coupon: Coupon) -> Values:
    """(5, 2) approximate centres of the fiducials in the coupon's order, px.

    Raises:
        PhotoError: there are no five round regions in the coupon's places.
    """
    marks = np.array(coupon.fiducials_mm)
    best: tuple[float, Values] | None = None
    for candidates in _find_round_regions(gray):
        found = _assign_fiducials(candidates, marks, coupon.fiducial_diameter_mm)
        if found is not None and (best is None or found[0] < best[0]):
            best = found
    if best is None:
        raise PhotoError(
            "the coupon's five round marks were not found; show the whole coupon, sharp, on an even ground that is "
            "much darker or brighter than the sheet"
        )
    return best[1]


def _find_round_regions(gray: NDArray[np.uint8]) -> list[Values]:
    """The dark and then the bright round regions: each (N, 3) x, y, area in px, the largest first."""
    import cv2

    found = []
    for kind in (cv2.THRESH_BINARY_INV, cv2.THRESH_BINARY):
        _, binary = cv2.threshold(gray, 0, 255, kind + cv2.THRESH_OTSU)
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
        for four in _plausible_assignments(similar, marks):
            found = _score_assignment(similar, four, marks, diameter_mm)
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        if best is not None:
            return best
    return None


def _plausible_assignments(similar: Values, marks: Values) -> list[tuple[int, ...]]:
    """Four candidates for the first four marks, of which the fifth mark's place has another candidate near.

    The homography by determinants: it maps the mark s_i to a multiple of the candidate t_i, in homogeneous coordinates.
    """
    fours = np.array(list(permutations(range(len(similar)), 4)))
    places = np.column_stack([similar[:, :2], np.ones(len(similar))])
    weights = _shares(np.column_stack([marks[:4], np.ones(4)])[None])[0]
    fifth = np.linalg.solve(np.column_stack([marks[:3], np.ones(3)]).T, [*marks[4], 1.0])
    chosen = places[fours]
    mapped = np.einsum("pi,pij->pj", _shares(chosen) * (fifth / weights), chosen[:, :3])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.linalg.norm(similar[None, :, :2] - (mapped[:, :2] / mapped[:, 2:])[:, None], axis=2)
    away /= np.sqrt(4 * similar[:, 2] / np.pi)
    np.put_along_axis(away, fours, np.inf, axis=1)
    # the places by float32, in the scoring, differ a little
    return [tuple(four) for four in fours[away.min(axis=1) < 1.5 * MAX_FIFTH_MARK_ERROR].tolist()]


def _shares(four: Values) -> Values:
    """(P, 3): the fourth of (P, 4, 3) points as a sum of the first three, times their determinant."""
    with_fourth = np.stack([four[:, [3, 1, 2]], four[:, [0, 3, 2]], four[:, [0, 1, 3]]], axis=1)
    shares: Values = np.linalg.det(with_fourth)
    return shares


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
    others = [i for i in range(len(similar)) if i not in four]
    fifth = _project_points(homography, marks[4:])
    if not others or not np.isfinite(fifth).all():
        return None
    # most assignments fail here, so that the places of the rims come later
    distance = np.linalg.norm(np.subtract(similar[others, :2], fifth), axis=1)
    five = similar[[*four, others[int(distance.argmin())]]]
    diameter = np.sqrt(4 * five[:, 2] / np.pi)
    fifth_error = float(distance.min()) / float(diameter[4])
    if fifth_error > MAX_FIFTH_MARK_ERROR:
        return None
    compass = diameter_mm / 2 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    rims = _project_points(homography, (marks[:, None] + compass).reshape(-1, 2)).reshape(5, 4, 2)
    width = np.linalg.norm(rims[:, 0] - rims[:, 1], axis=1)
    height = np.linalg.norm(rims[:, 2] - rims[:, 3], axis=1)
    if not np.isfinite(rims).all() or min(width.min(), height.min()) <= 1:
        return None
    stretch = max(np.abs(np.log(diameter / np.sqrt(width * height)))) + max(np.abs(np.log(width / height)))
    if stretch > MAX_STRETCH:
        return None
    return float(fifth_error + stretch), five[:, :2]


def _project_points(homography: NDArray[Any], points: Values) -> Values:
    """(N, 2) points mapped by a (3, 3) homography."""
    projected = np.column_stack([points, np.ones(len(points))]) @ homography.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(projected[:, :2] / projected[:, 2:])


class FiducialFit(NamedTuple):
    """The map from coupon (mm) to image (px).

    Attributes:
        to_image: (N, 2) coupon -> (N, 2) image.
        to_coupon: (N, 2) image -> (N, 2) coupon.
        rms_mm: RMS misfit of the fiducials.
        scale: px per mm.
        from_back: the picture is taken from the coupon's back.
    """

    to_image: PointMap
    to_coupon: PointMap
    rms_mm: float
    scale: float
    from_back: bool


def fit_fiducials(approximate: Values, coupon: Coupon, light: LightImage) -> FiducialFit:
    """Fit the map to the centres of the fiducials, refined in the light from approximate centres (5, 2) in px."""
    import cv2

    marks = np.array(coupon.fiducials_mm)
    homography = cv2.findHomography(marks, approximate)[0]
    local = _project_points(homography, np.vstack([marks, marks + (0.5, 0)]))
    radii = np.hypot(*(local[5:] - local[:5]).T) * coupon.fiducial_diameter_mm
    centres = np.array(
        [_refine_centroid(light, xy, radius) for xy, radius in zip(approximate, radii, strict=True)]
    )
    homography = cv2.findHomography(marks, centres)[0]
    scale = float(2 * np.median(radii) / coupon.fiducial_diameter_mm)
    # Five marks give ten equations for eight unknowns: two degrees of freedom remain for the RMS.
    residual = _project_points(homography, marks) - centres
    rms_mm = float(np.sqrt((residual**2).sum() / 2)) / scale
    turn = np.linalg.det(np.diff(centres[:3], axis=0)) * np.linalg.det(np.diff(marks[:3], axis=0))
    # The y axis of the image points down, so the map mirrors a coupon that is shown from the front.
    inverse = np.linalg.inv(homography)
    return FiducialFit(
        lambda points: _project_points(homography, points),
        lambda points: _project_points(inverse, points),
        rms_mm,
        scale,
        from_back=bool(turn > 0),
    )


def _refine_centroid(light: LightImage, centre: Values, radius: float) -> Values:
    """(2,) centroid of a fiducial's light over its surroundings, px; blur does not move the centroid."""
    reach = int(np.ceil(1.5 * radius))
    x, y = np.rint(centre).astype(int)
    top, left = max(y - reach, 0), max(x - reach, 0)
    window = light[top : y + reach + 1, left : x + reach + 1].astype(np.float64)
    rows, columns = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
    distance = np.hypot(columns - centre[0], rows - centre[1])
    ground = float(np.median(window[(distance > 1.25 * radius) & (distance < 1.5 * radius)]))
    weight = np.where(distance < 1.25 * radius, window - ground, 0)
    return np.asarray(np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum())
