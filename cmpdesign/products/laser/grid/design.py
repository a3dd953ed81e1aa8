"""The grid's windows: power in columns, speed in rows, and four numbers of passes in each field.

o                        o    o: fiducials, as on the coupon; the fifth shows the orientation
  A1        B1        C1
  [][][][]  [][][][]  [][][][]    []: windows of 2.2 x 4 mm, burnt 1, 2, 3, 4 times a unit, from the left
  A2        B2        C2
  [][][][]  [][][][]  [][][][]    columns: power rises to the right; rows: speed rises downwards
o o                      o

A window that is cut through falls out, and the ground shows in its place. The grid is a ``Coupon`` of one opening a
patch, so that the file, the picture and the map are those of the coupon.
"""

from __future__ import annotations

from dataclasses import replace

from cmpdesign.products.laser.coupon.design import (
    FIDUCIAL_MM,
    KEY_MM,
    Coupon,
    Opening,
    Patch,
    design_coupon,
)
from cmpdesign.products.laser.setup import LaserSetup

# Powers and speeds of the fields, relative to the settings that cut; no power above 100 %.
POWER_SHARES, SPEED_FACTORS = (0.6, 1.0, 1.4), (0.5, 1.0, 2.0)
# Windows of a field; the unit of passes is half of those of the settings that cut, at least one.
COUNTS = (1, 2, 3, 4)
# Longer than wide, so that no window is taken for a round fiducial.
WINDOW_MM = (2.2, 4.0)
APART_MM, LABEL_MM = 1.5, 2.0
FIELD_MM = (len(COUNTS) * (WINDOW_MM[0] + APART_MM) + 2.0, WINDOW_MM[1] + LABEL_MM + 3.0)
MARGIN_MM = 6.0


def unit_of_passes(setup: LaserSetup) -> int:
    """Passes of the first window of each field."""
    return max(setup.cut_repeats // 2, 1)


def design_grid(setup: LaserSetup) -> Coupon:
    """The grid of a machine and material, around the settings that cut; field B2 has the power and speed of these."""
    top_power = min(POWER_SHARES[-1] * setup.cut_power_percent, 100.0)
    powers = [round(top_power * share / POWER_SHARES[-1], 3) for share in POWER_SHARES]
    top_speed = min(SPEED_FACTORS[-1] * setup.cut_speed_mm_s, setup.machine.speed_max_mm_s.value)
    speeds = [round(top_speed * factor / SPEED_FACTORS[-1], 4) for factor in SPEED_FACTORS]
    patches = []
    for row, speed in enumerate(speeds):
        for column, power in enumerate(powers):
            x = MARGIN_MM + column * FIELD_MM[0] + WINDOW_MM[0] / 2
            y = MARGIN_MM + (len(speeds) - 1 - row) * FIELD_MM[1] + WINDOW_MM[1] / 2
            for place, count in enumerate(COUNTS):
                window = Opening(x + place * (WINDOW_MM[0] + APART_MM), y, *WINDOW_MM)
                name = f"{'ABC'[column]}{row + 1}-{count}"
                patches.append(Patch(name, power, speed, count * unit_of_passes(setup), (window,)))
    width = len(powers) * FIELD_MM[0] + 2 * MARGIN_MM - 2.0
    height = len(speeds) * FIELD_MM[1] + 2 * MARGIN_MM
    corners = ((0.0, 0.0), (width, 0.0), (0.0, height), (width, height), (KEY_MM, 0.0))
    return replace(
        design_coupon(setup),
        fiducial_diameter_mm=FIDUCIAL_MM,
        fiducials_mm=corners,
        patches=tuple(patches),
        kind="grid",
    )


def field_of(patch: Patch) -> str:
    """The name of a window's field, as on its label."""
    return patch.name.partition("-")[0]
