"""A cube pressed and sheared at ten places: what the edge fitting error and the response are measured on (Fig. 11)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.measures.edge_points import (
    circumscribed_square_mm,
    edge_points,
    mean_extent_mm,
    shear_response,
)
from cmpdesign.evaluate.runner import trial_rng
from cmpdesign.evaluate.simulated.contacts import ContactLoad, place_surface
from cmpdesign.evaluate.simulated.instrument import Instrument, instrument_for_method

Points = NDArray[np.float64]
CUBE_SIDE_MM, SHEAR_MM = 15.0, 1.0
CUBE_LOADS = {
    "press": ContactLoad("cube", 1.0),
    "press_shear": ContactLoad("cube", 1.0, shear_mm=(0.0, SHEAR_MM)),
    "press_shear_x": ContactLoad("cube", 1.0, shear_mm=(SHEAR_MM, 0.0)),
}
LOAD_DIRECTIONS = {
    "press": (0.0, 0.0, -1.0),
    "press_shear": (0.0, 1.0, 0.0),
    "press_shear_x": (1.0, 0.0, 0.0),
}
# Ten places 4 mm apart in x or y at which the whole face lies on the pattern.
CUBE_POSITIONS_MM = (
    (-6.0, 0.0), (-2.0, 0.0), (2.0, 0.0), (6.0, 0.0),
    (-2.0, 4.0), (2.0, 4.0), (6.0, 4.0),
    (-6.0, -4.0), (-2.0, -4.0), (2.0, -4.0),
)  # fmt: skip
REACH_MM = 5.0  # more places than these ten are drawn from within this, in x and y
COMPARED_METHODS = ("square", "multicolor")


def cube_position_mm(index: int, seed: int) -> tuple[float, float]:
    """The ten places, then random ones."""
    if index < len(CUBE_POSITIONS_MM):
        return CUBE_POSITIONS_MM[index]
    x, y = trial_rng(seed, "cube", index).uniform(-REACH_MM, REACH_MM, 2)
    return float(x), float(y)


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """What each pattern shows of the cube at one place."""
    from cmpdesign.evaluate.simulated.conditions import mean_conditions

    text, mode = values["sensor"], values["mode"]
    centre_mm = cube_position_mm(values["index"], values["seed"])
    pressed = place_surface(text, CUBE_LOADS[mode], centre_mm)
    found: dict[str, Any] = {"centre_mm": list(centre_mm)}
    for method in COMPARED_METHODS:
        one = instrument_for_method(text, method, values["preset"])
        seed = int(trial_rng(values["seed"], f"cube-{mode}", values["index"]).integers(2**31))
        picture = one.picture(mean_conditions(one.sensor.table.conditions), seed, pressed)
        shape = one.reconstructor.reconstruct(one.read(picture.image))
        read = _measure_edge_points(shape.xyz_mm, shape.displacement_mm, mode)
        virtual = _measure_edge_points(
            np.concatenate([shape.xyz_mm, shape.virtual_xyz_mm.reshape(-1, 3)]),
            np.concatenate([shape.displacement_mm, shape.virtual_displacement_mm.reshape(-1, 3)]),
            mode,
        )
        found[method] = {"read": read, "with_virtual": virtual, "perfect": _measure_truth(one, pressed, mode)}
    return found


def _measure_truth(one: Instrument, pressed: Any, mode: str) -> dict[str, Any]:
    """The same measures of the markers' true places: what the pattern alone, read without error, can show."""
    present = one.layout.present
    xyz, moved = pressed(one.layout.marker_xy_mm), pressed.displacement_mm(one.layout.marker_xy_mm)
    return _measure_edge_points(xyz[present], moved[present], mode)


def _measure_edge_points(xyz_mm: Points, displacement_mm: Points, mode: str) -> dict[str, Any]:
    points = edge_points(xyz_mm, displacement_mm, LOAD_DIRECTIONS[mode])
    by_depth = edge_points(xyz_mm, displacement_mm, LOAD_DIRECTIONS["press"])
    return {
        "points": len(points.xy_mm),
        "side_mm": circumscribed_square_mm(points.xy_mm),
        "side_by_depth_mm": circumscribed_square_mm(by_depth.xy_mm),
        "mean_extent_mm": mean_extent_mm(points.xy_mm),
        "response": shear_response(points, SHEAR_MM) if mode != "press" else None,
    }
