"""A sensor's housing around a pad: a seat, a chamber for the camera's view, a flange with screw holes.

    python examples/sensor_housing.py housing.step

writes the housing with the pad. The example needs build123d: pip install '.[cad]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

from build123d import (
    Axis,
    Box,
    Color,
    Compound,
    Cylinder,
    Kind,
    Location,
    Locations,
    Pos,
    export_step,
    extrude,
    offset,
)

from cmpdesign import load
from cmpdesign.products.mold.cad import pad_parts

CLEARANCE_MM, WALL_MM, LEDGE_MM, FLANGE_MM, CHAMBER_MM, SCREW_MM = 0.2, 3.0, 1.5, 3.0, 20.0, 3.2


def sensor(template: str) -> Compound:
    """The housing and the pad of a design; z = 0 is the pad's back, the camera is below the pad."""
    pad = pad_parts(load(template))
    size, top = pad.bounding_box().size, pad.children[-1].faces().sort_by(Axis.Z)[-1]
    wide, deep, edge = size.X + 2 * WALL_MM, size.Y + 2 * WALL_MM, size.X / 2 + WALL_MM + SCREW_MM

    body = Pos(0, 0, (size.Z - CHAMBER_MM) / 2) * Box(wide, deep, CHAMBER_MM + size.Z)
    flange = Pos(0, 0, FLANGE_MM / 2 - CHAMBER_MM) * Box(2 * edge + 2 * SCREW_MM, deep, FLANGE_MM)
    outline = Pos(0, 0, -top.center().Z) * top
    seat = extrude(offset(outline, CLEARANCE_MM, kind=Kind.INTERSECTION), size.Z, dir=(0, 0, 1))
    view = extrude(offset(outline, -LEDGE_MM, kind=Kind.INTERSECTION), CHAMBER_MM, dir=(0, 0, -1))
    screws = [Location((x, y, 0)) for x in (-edge, edge) for y in (-deep / 4, deep / 4)]
    housing = body + flange - seat - view - Locations(screws) * Cylinder(SCREW_MM / 2, 3 * CHAMBER_MM)

    housing.label, housing.color = "housing", Color(0.2, 0.2, 0.22)
    return Compound(label="sensor", children=[housing, pad])


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "housing.step")
    if target.exists():
        sys.exit(f"{target} exists: name another file, so that no file is overwritten")
    export_step(sensor("gelsight-mini"), target)
    print(f"wrote {target}")
