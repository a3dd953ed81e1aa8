"""Independent of the code under test: a small GRBL, a raster sweep of the beam; a camera for coupons."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.coupons.photograph import CouponView, photograph_coupon
from cmpdesign.design.design import load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.products.laser.coupon.design import Coupon
from cmpdesign.products.laser.job import LaserJob, make_job
from cmpdesign.products.laser.setup import complete_setup

Points = NDArray[np.float64]
PIXEL_MM = 0.002


@cache
def made_job(name: str = "honeycomb", **options: str) -> LaserJob:
    """A small design's job; options with "__" for "." ("laser__corner")."""
    overrides = {"layers": "3", "pitch_mm": "1.5"} | {key.replace("__", "."): v for key, v in options.items()}
    design = load_design(name, overrides)
    return make_job(design.name, built(name, tuple(overrides.items())), complete_setup(design.laser))


@cache
def built(name: str, overrides: tuple[tuple[str, str], ...]) -> Layout:
    return build_layout(load_design(name, dict(overrides)))


@dataclass
class Burn:
    """The moves of a program.

    burnt: (x0, y0, x1, y1, S) of every straight move with the beam on; dark: the same of every other move.
    starts: how many moves had been burnt at each dark one. pauses: the same at each M0.
    """

    burnt: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    dark: list[tuple[float, float, float, float]] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    feeds: set[float] = field(default_factory=set)
    pauses: list[int] = field(default_factory=list)
    ended_dark: bool = False

    @property
    def segments(self) -> Points:
        return np.array(self.burnt)[:, :4]


_WORD = re.compile(r"([A-Z])(-?(?:\d+\.?\d*|\.\d+))")


def run_gcode(text: str, s_max: float = 1000.0) -> Burn:
    """A GRBL 1.1 in laser mode, by its documentation; an unknown word stops the test."""
    burn, modes = Burn(), {"G": None, "M": 5.0, "F": None, "S": 0.0, "unit": None, "distance": None}
    x = y = 0.0
    for line in text.splitlines():
        code = line.split(";")[0].strip()
        assert re.fullmatch(rf"(?:{_WORD.pattern}\s*)*", code), line
        words = [(letter, float(value)) for letter, value in _WORD.findall(code)]
        target: dict[str, float] = {}
        for letter, value in words:
            if letter == "G" and value in (0, 1):
                modes["G"] = value
            elif letter == "G":
                known = {
                    20: ("unit", 25.4),
                    21: ("unit", 1.0),
                    90: ("distance", 90.0),
                    94: ("F", modes["F"]),
                    17: ("plane", 17),
                }
                name, setting = known[int(value)]
                modes[name] = setting
            elif letter == "M" and value in (3, 4, 5):
                modes["M"] = value
            elif letter == "M":
                assert value in (0, 2)
                burn.ended_dark = value == 2 and modes["M"] == 5
                if value == 0:
                    burn.pauses.append(len(burn.burnt))
            elif letter in "XY":
                target[letter] = value
            else:
                assert letter in "FS", line
                assert letter != "S" or 0 <= value <= s_max, line
                modes[letter] = value
        if target:
            assert modes["unit"] == 1.0 and modes["distance"] == 90.0
            new = target.get("X", x), target.get("Y", y)
            if modes["G"] == 1 and modes["M"] == 4 and modes["S"]:
                assert modes["F"]
                burn.feeds.add(modes["F"])
                burn.burnt.append((x, y, *new, modes["S"]))
            else:
                burn.dark.append((x, y, *new))
                burn.starts.append(len(burn.burnt))
            x, y = new
    return burn


def swept(
    segments: Points, kerf_mm: tuple[float, float], box: tuple[float, float, float, float]
) -> NDArray[np.bool_]:
    """Pixels of 2 micrometres whose centre the beam's ellipse covers anywhere on the segments; row 0 is the lowest."""
    left, bottom, right, top = box
    x = np.arange(left + PIXEL_MM / 2, right, PIXEL_MM)
    y = np.arange(bottom + PIXEL_MM / 2, top, PIXEL_MM)
    half_x, half_y = kerf_mm[0] / 2, kerf_mm[1] / 2
    covered = np.zeros((len(y), len(x)), dtype=bool)
    for x0, y0, x1, y1 in np.unique(segments, axis=0):
        rows = (y > min(y0, y1) - half_y - PIXEL_MM) & (y < max(y0, y1) + half_y + PIXEL_MM)
        columns = (x > min(x0, x1) - half_x - PIXEL_MM) & (x < max(x0, x1) + half_x + PIXEL_MM)
        if not rows.any() or not columns.any():
            continue
        u = ((x[columns] - x0) / half_x)[None, :]
        v = ((y[rows] - y0) / half_y)[:, None]
        du, dv = (x1 - x0) / half_x, (y1 - y0) / half_y
        long = du * du + dv * dv
        t = np.clip((u * du + v * dv) / long, 0, 1) if long else 0.0
        covered[np.ix_(rows, columns)] |= (u - t * du) ** 2 + (v - t * dv) ** 2 <= 1
    return covered


def filled(covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The whole area that the burnt rim encloses, with the part that falls out."""
    from scipy.ndimage import binary_fill_holes

    return np.asarray(binary_fill_holes(covered))


def groups_of(burn: Burn) -> list[Points]:
    """Burnt segments between two dark moves."""
    bounds = [*burn.starts, len(burn.burnt)]
    parts = [burn.segments[start:end] for start, end in pairwise(bounds)]
    return [part for part in parts if len(part)]


def coupon_photo(coupon: Coupon, kerf_mm: dict[str, tuple[float, float]], **conditions: Any) -> NDArray[Any]:
    """A picture of a coupon cut with known kerfs (patch name -> x, y); conditions of ``CouponView``."""
    return photograph_coupon(coupon, kerf_mm, CouponView(**conditions))
