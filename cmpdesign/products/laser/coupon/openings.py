"""Profiles across the openings of a coupon, and their widths.

An opening's width is the sum, across it, of the light in excess of the sheet's, divided by the excess inside. Blur
spreads light and does not change the sum. A square shows its own excess. A blurred slot is too narrow to show its own
excess: its excess is the excess of its patch's square, at the light that falls on the slot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.coupon.design import Coupon, Opening
from cmpdesign.products.laser.coupon.picture import CouponPicture, PhotoError, Values

# Width of the sheet beside an opening that a profile includes; the outer half of it gives the sheet's light.
GROUND_MM, GROUND_SHARE = 1.0, 0.5
# Share of an opening's length in use, away from its round corners.
LENGTH_SHARE = 0.6
# An opening at least this wide shows its own light, further than this from its edges.
WIDE_MM, INNER_MM = 1.5, 0.5
# Bands along an opening; each gives one profile.
BANDS = 8
SPACING_PX = 0.5
# Least difference of light (0 to 255) between an opening and the sheet.
MIN_CONTRAST = 8.0
# Standard deviation of the illumination's fit, as a share of the light, and of its terms over the coupon's size.
LIGHT_DEVIATION, TERM_DEVIATION = 0.004, 0.3


class Across(NamedTuple):
    """One opening measured across: its patch's number, its shape, and the direction."""

    patch: int
    opening: Opening
    along_x: bool

    @property
    def width_mm(self) -> float:
        """Nominal width in the direction of measuring."""
        return self.opening.width_mm if self.along_x else self.opening.height_mm

    @property
    def length_mm(self) -> float:
        """Nominal length across the direction of measuring."""
        return self.opening.height_mm if self.along_x else self.opening.width_mm

    @property
    def wide(self) -> bool:
        """The opening shows its own light."""
        return min(self.opening.width_mm, self.opening.height_mm) >= WIDE_MM


@dataclass(frozen=True, eq=False)
class OpeningProfile:
    """The light across an opening.

    Attributes:
        across: the opening and the direction.
        place_mm: (N,) places across the opening, from its centre.
        light: (BANDS, N) light of each band.
        sheet: (BANDS, N) light of the sheet, a straight line through both ends.
        excess: (BANDS, N) light of the opening over the sheet's.
    """

    across: Across
    place_mm: Values
    light: Values
    sheet: Values
    excess: Values

    @property
    def share(self) -> Values:
        """(BANDS, N): 0 on the sheet, 1 in the opening."""
        return np.asarray((self.light - self.sheet) / self.excess)

    @property
    def widths_mm(self) -> Values:
        """(BANDS,) widths."""
        return np.asarray(self.share.sum(axis=1) * (self.place_mm[1] - self.place_mm[0]))


def measured_directions(coupon: Coupon) -> list[Across]:
    """The measured directions: both directions of a square, the direction across a slot."""
    found = []
    for number, patch in enumerate(coupon.patches):
        for opening in patch.openings:
            if opening.height_mm >= opening.width_mm:
                found.append(Across(number, opening, True))
            if opening.width_mm >= opening.height_mm:
                found.append(Across(number, opening, False))
    return found


def sheet_and_opening_points(across: Across) -> tuple[Values, Values]:
    """(N, 2) places on the sheet beside an opening, and inside the opening (none for a narrow opening), in mm."""
    half = across.width_mm / 2
    place = np.linspace(-half - GROUND_MM, half + GROUND_MM, 201)
    points = _grid(across, place, 24).reshape(-1, 2)
    distance = np.abs(np.tile(place, 24))
    inside = distance < (half - INNER_MM if across.wide else -1.0)
    return points[distance > half + (1 - GROUND_SHARE) * GROUND_MM], points[inside]


def read_profiles(coupon: Coupon, picture: CouponPicture) -> list[OpeningProfile]:
    """The profiles of ``measured_directions``, in that order.

    Raises:
        PhotoError: an opening lies outside the picture, differs too little from the sheet, or no patch is wide.
    """
    raw = [_raw_profile(across, picture) for across in measured_directions(coupon)]
    missing = set(range(len(coupon.patches))) - {one.across.patch for one in raw if one.across.wide}
    if missing:
        raise PhotoError(f"patch {min(missing)} has no opening of {WIDE_MM:g} mm; use a coupon.json of build")
    illumination = _fit_illumination(raw)
    return [_with_excess(one, raw, illumination) for one in raw]


class _RawProfile(NamedTuple):
    """A profile before its excess is known; ``own`` (BANDS, N) is the excess of a wide opening."""

    across: Across
    place_mm: Values
    light: Values
    sheet: Values
    own: Values


def _grid(across: Across, place: Values, rows: int) -> Values:
    """(rows, N, 2) points of an opening: rows along the opening, ``place`` across."""
    along = (np.arange(rows) + 0.5) / rows - 0.5
    u, v = np.meshgrid(place, along * LENGTH_SHARE * across.length_mm)
    centre = (across.opening.x_mm, across.opening.y_mm)
    return np.asarray(np.stack([u, v] if across.along_x else [v, u], axis=-1) + centre)


def _raw_profile(across: Across, picture: CouponPicture) -> _RawProfile:
    half = across.width_mm / 2 + GROUND_MM
    count = int(np.ceil(2 * half * picture.scale / SPACING_PX))
    place = ((np.arange(count) + 0.5) / count - 0.5) * 2 * half
    rows = BANDS * max(int(np.ceil(LENGTH_SHARE * across.length_mm * picture.scale / BANDS)), 4)
    values = picture.sample(_grid(across, place, rows))
    light = values.reshape(BANDS, -1, count).mean(axis=1)
    sheet = _line(light, place, np.abs(place) > half - GROUND_SHARE * GROUND_MM)
    own = np.zeros_like(light)
    if across.wide:
        own = _line(light, place, np.abs(place) < across.width_mm / 2 - INNER_MM) - sheet
        if np.abs(own).min() < MIN_CONTRAST:
            raise PhotoError(
                f"an opening at ({across.opening.x_mm:g}, {across.opening.y_mm:g}) mm differs from the sheet by "
                f"{np.abs(own).min():.0f} of 255 in light, limit {MIN_CONTRAST:g}; light the sheet evenly and put a "
                "dark or bright ground behind it"
            )
    return _RawProfile(across, place, light, sheet, own)


def _line(light: Values, place: Values, where: NDArray[np.bool_]) -> Values:
    """(BANDS, N) a straight line along each profile, fitted to the points of a mask."""
    basis = np.stack([np.ones_like(place), place])
    return np.asarray(light[:, where] @ np.linalg.pinv(basis[:, where]) @ basis)


class _Illumination(NamedTuple):
    """The relative light over the coupon: exp of a quadratic polynomial."""

    centre: Values
    size: float
    terms: Values

    def at(self, across: Across) -> float:
        place = (np.array([across.opening.x_mm, across.opening.y_mm]) - self.centre) / self.size
        return float(np.exp(_quadratic(place[None]) @ self.terms)[0])


def _quadratic(xy: Values) -> Values:
    x, y = xy.T
    return np.asarray(np.stack([x, y, x * x, x * y, y * y], axis=1))


def _fit_illumination(raw: list[_RawProfile]) -> _Illumination:
    """Fit the light to the values of sheet and wide openings; each is even, up to a factor."""
    places = np.array([(one.across.opening.x_mm, one.across.opening.y_mm) for one in raw])
    centre, size = places.mean(axis=0), float(np.ptp(places, axis=0).max()) / 2
    basis = _quadratic((places - centre) / size)
    wide = np.array([one.across.wide for one in raw])
    sheet = np.array([one.sheet.mean() for one in raw])
    own = np.array([abs(one.own.mean()) for one in raw])[wide]
    # A dark sheet shows stray light rather than the light that falls on it.
    sheet_deviation = LIGHT_DEVIATION * max(float(np.median(own) / np.median(sheet)), 1.0)
    rows = [
        np.column_stack([np.ones(len(own)), np.zeros(len(own)), basis[wide]]) / LIGHT_DEVIATION,
        np.column_stack([np.zeros(len(sheet)), np.ones(len(sheet)), basis]) / sheet_deviation,
        np.column_stack([np.zeros((5, 2)), np.eye(5)]) / TERM_DEVIATION,
    ]
    values = [
        np.log(own) / LIGHT_DEVIATION,
        np.log(np.maximum(sheet, 1e-3)) / sheet_deviation,
        np.zeros(5),
    ]
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    return _Illumination(centre, size, solution[2:])


def _with_excess(one: _RawProfile, raw: list[_RawProfile], illumination: _Illumination) -> OpeningProfile:
    excess = one.own
    if not one.across.wide:
        wide = [other for other in raw if other.across.wide and other.across.patch == one.across.patch]
        level = np.mean([other.own.mean() / illumination.at(other.across) for other in wide])
        excess = np.full_like(one.light, level * illumination.at(one.across))
    return OpeningProfile(one.across, one.place_mm, one.light, one.sheet, excess)
