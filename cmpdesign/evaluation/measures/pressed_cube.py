"""A cube pressed and sheared at ten positions, for the edge fitting error and the response (Fig. 11)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation.measures.edge_points import (
    circumscribed_square_mm,
    edge_points,
    mean_extent_mm,
    shear_response,
)
from cmpdesign.evaluation.runner import trial_rng
from cmpdesign.evaluation.simulated.contacts import ContactLoad, PlacedSurface, place_surface
from cmpdesign.evaluation.simulated.instrument import Instrument, instrument_for_method

Points = NDArray[np.float64]
CUBE_SIDE_MM, SHEAR_MM = 15.0, 1.0
CUBE_LOADS = {
    "press": ContactLoad("cube", 1.0),
    "press_diagonal": ContactLoad("cube", 1.0),
    "press_turned": ContactLoad("cube", 1.0),
    "press_shear": ContactLoad("cube", 1.0, shear_mm=(0.0, SHEAR_MM)),
    "press_shear_x": ContactLoad("cube", 1.0, shear_mm=(SHEAR_MM, 0.0)),
}
LOAD_DIRECTIONS = {
    "press": (0.0, 0.0, -1.0),
    "press_diagonal": (0.0, 0.0, -1.0),
    "press_turned": (0.0, 0.0, -1.0),
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


def cube_turn_deg(mode: str, index: int, seed: int) -> float:
    """The cube's turn: along the square pattern's rows, diagonal to them, or random in a quarter turn."""
    if mode == "press_turned":
        return float(trial_rng(seed, "cube-turn", index).uniform(0.0, 90.0))
    return 45.0 if mode == "press_diagonal" else 0.0


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The measures of each pattern for the cube at one position."""
    from cmpdesign.evaluation.simulated.conditions import mean_conditions

    text, mode = values["sensor"], values["mode"]
    centre_mm = cube_position_mm(values["index"], values["seed"])
    turn_deg = cube_turn_deg(mode, values["index"], values["seed"])
    surface = place_surface(text, CUBE_LOADS[mode], centre_mm, turn_deg)
    result: dict[str, Any] = {"centre_mm": list(centre_mm), "turn_deg": turn_deg}
    for method in COMPARED_METHODS:
        instrument = instrument_for_method(text, method, values["preset"])
        seed = int(trial_rng(values["seed"], f"cube-{mode}", values["index"]).integers(2**31))
        picture = instrument.picture(mean_conditions(instrument.sensor.table.conditions), seed, surface)
        shape = instrument.reconstructor.reconstruct(instrument.read(picture.image))
        read = _measure_edge_points(shape.xyz_mm, shape.displacement_mm, mode, turn_deg)
        virtual = _measure_edge_points(
            np.concatenate([shape.xyz_mm, shape.virtual_xyz_mm.reshape(-1, 3)]),
            np.concatenate([shape.displacement_mm, shape.virtual_displacement_mm.reshape(-1, 3)]),
            mode,
            turn_deg,
        )
        result[method] = {
            "read": read,
            "with_virtual": virtual,
            "perfect": _measure_truth(instrument, surface, mode),
            "perfect_with_virtual": _measure_truth(instrument, surface, mode, with_virtual=True),
        }
    return result


def _measure_truth(
    instrument: Instrument, surface: PlacedSurface, mode: str, *, with_virtual: bool = False
) -> dict[str, Any]:
    """The same measures of the markers' true positions: the result of a reading without error."""
    layout = instrument.layout
    rest = layout.marker_xy_mm[layout.present]
    if with_virtual:
        rest = np.concatenate([rest, layout.virtual_xy_mm.reshape(-1, 2)])
    return _measure_edge_points(surface(rest), surface.displacement_mm(rest), mode, surface.turn_deg)


def _measure_edge_points(
    xyz_mm: Points, displacement_mm: Points, mode: str, turn_deg: float
) -> dict[str, Any]:
    points = edge_points(xyz_mm, displacement_mm, LOAD_DIRECTIONS[mode])
    by_depth = edge_points(xyz_mm, displacement_mm, LOAD_DIRECTIONS["press"])
    return {
        "points": len(points.xy_mm),
        "side_mm": circumscribed_square_mm(points.xy_mm, turn_deg),
        "side_by_depth_mm": circumscribed_square_mm(by_depth.xy_mm, turn_deg),
        "mean_extent_mm": mean_extent_mm(points.xy_mm, turn_deg),
        "response": shear_response(points, SHEAR_MM) if any(CUBE_LOADS[mode].shear_mm) else None,
    }
