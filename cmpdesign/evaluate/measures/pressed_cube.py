"""A cube pressed and sheared at ten positions, for the edge fitting error and the response (Fig. 11)."""

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
# Ten positions 4 mm apart in x or y at which the whole face lies on the pattern.
CUBE_POSITIONS_MM = (
    (-6.0, 0.0), (-2.0, 0.0), (2.0, 0.0), (6.0, 0.0),
    (-2.0, 4.0), (2.0, 4.0), (6.0, 4.0),
    (-6.0, -4.0), (-2.0, -4.0), (2.0, -4.0),
)  # fmt: skip
REACH_MM = 5.0  # largest distance of further, random positions from the pattern's middle, in x and y
COMPARED_METHODS = ("square", "multicolor")


def cube_position_mm(index: int, seed: int) -> tuple[float, float]:
    """The centre of the cube: one of the ten positions, then random positions."""
    if index < len(CUBE_POSITIONS_MM):
        return CUBE_POSITIONS_MM[index]
    x, y = trial_rng(seed, "cube", index).uniform(-REACH_MM, REACH_MM, 2)
    return float(x), float(y)


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The measures of each pattern for the cube at one position."""
    from cmpdesign.evaluate.simulated.conditions import mean_conditions

    text, mode = values["sensor"], values["mode"]
    centre_mm = cube_position_mm(values["index"], values["seed"])
    surface = place_surface(text, CUBE_LOADS[mode], centre_mm)
    result: dict[str, Any] = {"centre_mm": list(centre_mm)}
    for method in COMPARED_METHODS:
        instrument = instrument_for_method(text, method, values["preset"])
        seed = int(trial_rng(values["seed"], f"cube-{mode}", values["index"]).integers(2**31))
        picture = instrument.picture(mean_conditions(instrument.sensor.table.conditions), seed, surface)
        shape = instrument.reconstructor.reconstruct(instrument.read(picture.image))
        read = _measure_edge_points(shape.xyz_mm, shape.displacement_mm, mode)
        virtual = _measure_edge_points(
            np.concatenate([shape.xyz_mm, shape.virtual_xyz_mm.reshape(-1, 3)]),
            np.concatenate([shape.displacement_mm, shape.virtual_displacement_mm.reshape(-1, 3)]),
            mode,
        )
        result[method] = {
            "read": read,
            "with_virtual": virtual,
            "perfect": _measure_truth(instrument, surface, mode),
        }
    return result


def _measure_truth(instrument: Instrument, surface: Any, mode: str) -> dict[str, Any]:
    """The same measures of the markers' true positions: the result of a reading without error."""
    present = instrument.layout.present
    xyz, displacement_mm = (
        surface(instrument.layout.marker_xy_mm),
        surface.displacement_mm(instrument.layout.marker_xy_mm),
    )
    return _measure_edge_points(xyz[present], displacement_mm[present], mode)


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
