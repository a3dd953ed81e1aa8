"""Linear contacts compared with the neo-Hookean layer, press by press.

A ball of 10 mm without friction on 4 mm; largest errors in um of points within 12 mm of the axis; the pattern lies 1 mm
below. "z at rest" reads the height where a point was at rest; "volume" is lost, over the dent's volume.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import Table
from benchmarks.large_strain.neo_hookean import LAYER, RADIUS_MM, Moved, NeoHookeanLayer, places_mm
from cmpdesign.contact import Ball, Contact, Motion, Relief, solve

Array = NDArray[np.float64]
PRESSES_MM = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
SOLVED_MM = 64.0  # side of the area that the linear contact covers


class Comparison(NamedTuple):
    """One press: the largest distance of linear points from those of finite elements, mm.

    Attributes:
        press_mm: the press.
        strain: ``Contact.largest_strain``.
        first_order_mm: of the surface, whose z is read where points were at rest.
        surface_mm: of the surface by ``Contact.surface``.
        markers_mm: of the pattern by ``Contact.marker_layer``.
        height_mm: of the surface in z alone, at the same place in space.
        volume_lost: volume that the first-order surface loses, over the dent's volume.
        volume_lost_now: the same of ``Contact.surface``.
    """

    press_mm: float
    strain: float
    first_order_mm: float
    surface_mm: float
    markers_mm: float
    height_mm: float
    volume_lost: float
    volume_lost_now: float


def compare(press_mm: float, moved: Moved) -> Comparison:
    """The linear contact compared with the neo-Hookean layer."""
    contact = solve(
        LAYER, Ball(RADIUS_MM), Motion(press_mm), friction=0.0, size_mm=(SOLVED_MM, SOLVED_MM), grid=256
    )
    at, rest = places_mm(), np.stack([places_mm(), 0 * places_mm()], axis=1)
    surface, markers = (relief(rest)[:, [0, 2]].T for relief in (contact.surface(), contact.marker_layer()))
    wanted, wanted_markers = (np.stack([at + found[0], found[1]]) for found in moved)
    first = np.stack([surface[0], _spline_at_rest(contact, rest)])
    beside = np.interp(wanted[0], surface[0], surface[1])
    return Comparison(
        press_mm,
        contact.largest_strain,
        *(float(np.linalg.norm(a - b, axis=0).max()) for a, b in ((first, wanted), (surface, wanted))),
        float(np.linalg.norm(markers - wanted_markers, axis=0).max()),
        float(np.abs(beside - wanted[1]).max()),
        volume_lost(contact, first_order=True),
        volume_lost(contact, first_order=False),
    )


def _spline_at_rest(contact: Contact, xy_mm: Array) -> Array:
    """z (N,) mm read at the points' places at rest."""
    relief = contact.surface()
    without_press = relief.coefficients.copy()
    without_press[3:] = 0.0
    return Relief(relief.grid, without_press)(xy_mm)[:, 2]


def volume_lost(contact: Contact, *, first_order: bool) -> float:
    """The volume between the deformed and the flat surface, over that below the flat one; 0 if it is incompressible."""
    step = float(contact.x_mm[1] - contact.x_mm[0]) / 2
    relief = contact.surface()
    x, y = (np.arange(values[0] - 6.0, values[-1] + 6.0, step) for values in (contact.x_mm, contact.y_mm))
    xy = np.stack(np.meshgrid(x, y), axis=-1)
    moved = relief(xy.reshape(-1, 2)).reshape(*xy.shape[:2], 3)
    z = _spline_at_rest(contact, xy.reshape(-1, 2)).reshape(xy.shape[:2]) if first_order else moved[..., 2]
    x_y, x_x = np.gradient(moved[..., 0], step)
    y_y, y_x = np.gradient(moved[..., 1], step)
    volume = z * (x_x * y_y - x_y * y_x)
    return float(volume.sum() / -volume[z < 0].sum())


def measure() -> Shown:
    """One row for every press."""
    rows = []
    for press, moved in zip(PRESSES_MM, NeoHookeanLayer().pressed(PRESSES_MM), strict=True):
        one = compare(press, moved)
        errors_mm = (one.first_order_mm, one.surface_mm, one.height_mm, one.markers_mm)
        lost = one.volume_lost, one.volume_lost_now
        rows.append(
            (press, one.strain, *(1e3 * error for error in errors_mm), *(100 * share for share in lost))
        )
    columns = {
        "press": "g",
        "strain": ".2f",
        "surface, z at rest": ".0f",
        "surface": ".0f",
        "its height": ".0f",
    }
    columns |= {"pattern": ".0f", "volume %, z at rest": "+.1f", "volume %": "+.1f"}
    yield Table("largest errors, um", columns, rows)


main = Experiment("large_strain", measure)
main.run_as(__name__)
