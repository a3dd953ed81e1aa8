"""The photograph of a grid: which windows are cut through, and how deep the others are.

A groove's shade is no measure of its depth. Depths follow from what is cut through: passes of one setting burn equally
deep, and neither less power nor more speed burns deeper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cmpdesign.files.images import Image
from cmpdesign.products.laser.coupon.design import Coupon, Face, Patch
from cmpdesign.products.laser.coupon.fiducials import find_fiducials, fit_fiducials
from cmpdesign.products.laser.coupon.photo import CouponReading, read_coupon
from cmpdesign.products.laser.coupon.picture import (
    CouponPicture,
    PhotoError,
    Values,
    decode_image,
    eight_bit_gray,
)
from cmpdesign.products.laser.coupon.stated_response import stated_response
from cmpdesign.products.laser.grid.design import APART_MM, field_of
from extractor.image.response import Response, light_of_values

WindowState = Literal["through", "marked", "unmarked"]
# Share of the ground's light inside a window that is open (the rest: a rim of soot, unevenness of the light).
OPEN_SHARE = 0.5
# Change of light along a window's outline, over the scatter of the sheet beside it, of a window that is marked.
MARKED_SIGMAS = 4.0
# A window is clear of its own outline and of the next window within these distances, mm.
CLEAR_MM, RIM_MM = 0.6, 0.35
# Least difference of light (0 to 255) between ground and sheet.
MIN_CONTRAST = 20.0
SAMPLES = 15


@dataclass(frozen=True)
class FieldReading:
    """One power and speed.

    Attributes:
        name: as on its label: "B2".
        power_percent, speed_mm_s: its settings.
        states: number of passes -> what the window shows.
        passes: the fewest passes that cut through, if all larger numbers do, too; None: none.
        depth_per_pass_mm: lower and upper bound of what one pass burns, by the windows of all fields; 0 and infinity
            where no window gives a bound.
        thickness_mm: of the sheet.
    """

    name: str
    power_percent: float
    speed_mm_s: float
    states: dict[int, WindowState]
    passes: int | None
    depth_per_pass_mm: tuple[float, float]
    thickness_mm: float

    @property
    def depths_mm(self) -> dict[int, tuple[float, float]]:
        """Number of passes -> lower and upper bound of a window's depth; the thickness where the window is open."""
        low, high = self.depth_per_pass_mm
        return {
            passes: (self.thickness_mm, self.thickness_mm)
            if state == "through"
            else (passes * low, min(passes * high, self.thickness_mm))
            for passes, state in self.states.items()
        }

    @property
    def time_s_mm(self) -> float:
        """Time to cut one mm of a path through; infinite where nothing is cut."""
        return (self.passes or float("inf")) / self.speed_mm_s


@dataclass(frozen=True)
class GridReading:
    """All fields; ``best`` is the quickest that cuts through with a pass in reserve, None if there is none."""

    fields: tuple[FieldReading, ...]
    scale_px_mm: float
    from_back: bool

    @property
    def best(self) -> FieldReading | None:
        cut = [one for one in self.fields if one.passes is not None and one.passes < max(one.states)]
        return min(cut, key=lambda one: one.time_s_mm, default=None)

    def to_json(self) -> dict[str, Any]:
        """The reading as in the document of ``kerf``."""
        fields = []
        for one in self.fields:
            low, high = one.depth_per_pass_mm
            fields.append(
                {
                    "name": one.name,
                    "power_percent": one.power_percent,
                    "speed_mm_s": one.speed_mm_s,
                    "windows": one.states,
                    "depths_mm": one.depths_mm,
                    "passes": one.passes,
                    "least_depth_per_pass_mm": low,
                    "most_depth_per_pass_mm": None if high == float("inf") else high,
                }
            )
        best = None if self.best is None else self.best.name
        scale = round(self.scale_px_mm, 4)
        return {"scale_px_mm": scale, "from_back": self.from_back, "best": best, "fields": fields}


def read_cut(
    coupon: Coupon, file: Path, image: Image, response: Response | None = None, face: Face | None = None
) -> CouponReading | GridReading:
    """Read the picture of a coupon, or of a grid.

    Args:
        coupon: the coupon or the grid.
        file: the picture's file, which may state its response.
        image, response, face: see ``read_coupon`` and ``read_grid``.

    Raises:
        PhotoError: see ``read_coupon`` and ``read_grid``.
    """
    if coupon.kind == "grid":
        return read_grid(coupon, image, response or "srgb")
    return read_coupon(coupon, image, response=response, stated=stated_response(file), face=face)


def read_grid(grid: Coupon, image: Image, response: Response = "srgb") -> GridReading:
    """Read the windows of a photographed grid, from which loose windows were pushed out.

    Args:
        grid: the grid that was burnt.
        image: (H, W, 3) uint8 or uint16 BGR, on a ground much darker or brighter than the sheet.
        response: relation of light and values.

    Raises:
        PhotoError: the grid is not found, or ground and sheet look alike.
    """
    light = decode_image(image, light_of_values(response))
    fit = fit_fiducials(find_fiducials(eight_bit_gray(image), grid), grid, light)
    picture = CouponPicture(light, fit.to_image, fit.scale)
    ground = _ground_light(grid, picture)
    states = [_state(patch, picture, ground) for patch in grid.patches]
    fields = []
    for _, windows in groupby(zip(grid.patches, states, strict=True), key=lambda pair: field_of(pair[0])):
        fields.append(_field(list(windows), grid.thickness_mm))
    return GridReading(_with_bounds_of_others(fields), fit.scale, fit.from_back)


def _with_bounds_of_others(fields: Sequence[FieldReading]) -> tuple[FieldReading, ...]:
    """A pass burns at most as deep as one of no less power and no more speed, and at least as deep as the reverse."""
    bounded = []
    for one in fields:
        stronger = [each for each in fields if _burns_as_deep(each, one)]
        weaker = [each for each in fields if _burns_as_deep(one, each)]
        low = max(each.depth_per_pass_mm[0] for each in weaker)
        high = min(each.depth_per_pass_mm[1] for each in stronger)
        bounded.append(replace(one, depth_per_pass_mm=(low, high)))
    return tuple(bounded)


def _burns_as_deep(one: FieldReading, other: FieldReading) -> bool:
    return one.power_percent >= other.power_percent and one.speed_mm_s <= other.speed_mm_s


def _ground_light(grid: Coupon, picture: CouponPicture) -> float:
    """The light of the ground, seen through the fiducials."""
    reach = np.linspace(-0.25, 0.25, SAMPLES) * grid.fiducial_diameter_mm
    inside = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    return float(np.median([picture.sample(inside + mark).mean() for mark in np.array(grid.fiducials_mm)]))


def _state(patch: Patch, picture: CouponPicture, ground: float) -> WindowState:
    (window,) = patch.openings
    centre, half = np.array([window.x_mm, window.y_mm]), np.array([window.width_mm, window.height_mm]) / 2
    sheet = picture.sample(centre + _ring(half + APART_MM / 2))
    level, scatter = float(np.median(sheet)), float(np.std(sheet))
    if abs(ground - level) < MIN_CONTRAST:
        raise PhotoError(
            f"window {patch.name}: ground and sheet differ by {abs(ground - level):.0f} of 255 in light, limit "
            f"{MIN_CONTRAST:g}; put a much darker or brighter ground behind the piece"
        )
    place = np.linspace(-1, 1, SAMPLES)
    grid = np.stack(np.meshgrid(place, place), axis=-1).reshape(-1, 2)
    inside = picture.sample(centre + grid * (half - CLEAR_MM))
    if float(np.median((inside - level) / (ground - level))) > OPEN_SHARE:
        return "through"
    outline = np.median([picture.sample(centre + _ring(half + off)) for off in (-0.05, 0.0, 0.05)], axis=0)
    change = abs(float(np.median(outline)) - level)
    return "marked" if change > MARKED_SIGMAS * max(scatter, 1.0) else "unmarked"


def _ring(half_mm: Values) -> Values:
    """(4 * SAMPLES, 2) places along a rectangle, from (2,) its half width and height."""
    along, one = np.linspace(-1, 1, SAMPLES), np.ones(SAMPLES)
    across = along * (1 - RIM_MM / half_mm[:, None])  # away from the corners
    x, y = half_mm
    sides = [
        (x * across[0], y * one),
        (x * across[0], -y * one),
        (x * one, y * across[1]),
        (-x * one, y * across[1]),
    ]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def _field(windows: Sequence[tuple[Patch, WindowState]], thickness_mm: float) -> FieldReading:
    states = {patch.passes: state for patch, state in sorted(windows, key=lambda pair: pair[0].passes)}
    closed = [passes for passes, state in states.items() if state != "through"]
    last_closed = max(closed, default=0)
    cut = [passes for passes in states if passes > last_closed]
    low = thickness_mm / min(cut) if cut else 0.0
    high = thickness_mm / last_closed if last_closed else float("inf")
    first = windows[0][0]
    return FieldReading(
        name=field_of(first),
        power_percent=first.power_percent,
        speed_mm_s=first.speed_mm_s,
        states=states,
        passes=min(cut, default=None),
        depth_per_pass_mm=(low, high),
        thickness_mm=thickness_mm,
    )
