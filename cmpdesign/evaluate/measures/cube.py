"""A cube pressed and sheared at ten places: what the edge fitting error and the response are measured on (Fig. 11)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.measures.edges import circumscribed_square_mm, edge_points, mean_extent_mm, response
from cmpdesign.evaluate.runner import rng
from cmpdesign.evaluate.simulated.contacts import Load, surface
from cmpdesign.evaluate.simulated.instrument import Instrument, instrument

Points = NDArray[np.float64]
SIDE_MM, SHEAR_MM = 15.0, 1.0
MODES = {
    "press": Load("cube", 1.0),
    "press_shear": Load("cube", 1.0, shear_mm=(0.0, SHEAR_MM)),
    "press_shear_x": Load("cube", 1.0, shear_mm=(SHEAR_MM, 0.0)),
}
DIRECTIONS = {"press": (0.0, 0.0, -1.0), "press_shear": (0.0, 1.0, 0.0), "press_shear_x": (1.0, 0.0, 0.0)}
# Ten places 4 mm apart in x or y at which the whole face lies on the pattern.
POSITIONS_MM = (
    (-6.0, 0.0), (-2.0, 0.0), (2.0, 0.0), (6.0, 0.0),
    (-2.0, 4.0), (2.0, 4.0), (6.0, 4.0),
    (-6.0, -4.0), (-2.0, -4.0), (2.0, -4.0),
)  # fmt: skip
REACH_MM = 5.0  # more places than these ten are drawn from within this, in x and y
SHOWN = ("square", "multicolor")


def position_mm(index: int, seed: int) -> tuple[float, float]:
    """The ten places, then random ones."""
    if index < len(POSITIONS_MM):
        return POSITIONS_MM[index]
    x, y = rng(seed, "cube", index).uniform(-REACH_MM, REACH_MM, 2)
    return float(x), float(y)


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """What each pattern shows of the cube at one place."""
    from cmpdesign.evaluate.simulated.conditions import middle

    text, mode = values["sensor"], values["mode"]
    centre_mm = position_mm(values["index"], values["seed"])
    pressed = surface(text, MODES[mode], centre_mm)
    found: dict[str, Any] = {"centre_mm": list(centre_mm)}
    for method in SHOWN:
        one = instrument(text, method, values["preset"])
        seed = int(rng(values["seed"], f"cube-{mode}", values["index"]).integers(2**31))
        picture = one.picture(middle(one.sensor.table.conditions), seed, pressed)
        shape = one.reconstructor.reconstruct(one.read(picture.image))
        read = _measures(shape.xyz_mm, shape.displacement_mm, mode)
        virtual = _measures(
            np.concatenate([shape.xyz_mm, shape.virtual_xyz_mm.reshape(-1, 3)]),
            np.concatenate([shape.displacement_mm, shape.virtual_displacement_mm.reshape(-1, 3)]),
            mode,
        )
        found[method] = {"read": read, "with_virtual": virtual, "perfect": _perfect(one, pressed, mode)}
    return found


def _perfect(one: Instrument, pressed: Any, mode: str) -> dict[str, Any]:
    """The same measures of the markers' true places: what the pattern alone, read without error, can show."""
    present = one.layout.present
    xyz, moved = pressed(one.layout.marker_xy_mm), pressed.displacement_mm(one.layout.marker_xy_mm)
    return _measures(xyz[present], moved[present], mode)


def _measures(xyz_mm: Points, displacement_mm: Points, mode: str) -> dict[str, Any]:
    points = edge_points(xyz_mm, displacement_mm, DIRECTIONS[mode])
    by_depth = edge_points(xyz_mm, displacement_mm, DIRECTIONS["press"])
    return {
        "points": len(points.xy_mm),
        "side_mm": circumscribed_square_mm(points.xy_mm),
        "side_by_depth_mm": circumscribed_square_mm(by_depth.xy_mm),
        "mean_extent_mm": mean_extent_mm(points.xy_mm),
        "response": response(points, SHEAR_MM) if mode != "press" else None,
    }
