"""The grid's job: a pass for each field, whose windows are repeated, for the labels and for the fiducials."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from cmpdesign.products.laser.coupon.design import Coupon, Patch, coupon_to_json
from cmpdesign.products.laser.coupon.job import fiducial_strokes, label_pass, make_pass, placed_drawing
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.grid.design import (
    FIELD_MM,
    LABEL_MM,
    MARGIN_MM,
    design_grid,
    field_of,
    unit_of_passes,
)
from cmpdesign.products.laser.paths.labels import arrow_paths, label_paths
from cmpdesign.products.laser.paths.strokes import Strokes, loop_strokes
from cmpdesign.products.laser.setup import LaserSetup


def grid_job(setup: LaserSetup) -> tuple[LaserDrawing, str]:
    """The grid's drawing, and the text of ``grid.json``."""
    grid, unit = design_grid(setup), unit_of_passes(setup)
    fields = [list(windows) for _, windows in groupby(grid.patches, key=field_of)]
    passes = [
        make_pass(
            f"field-{field_of(windows[0])}",
            _window_strokes(windows, unit),
            windows[0].power_percent,
            windows[0].speed_mm_s,
            unit,
        )
        for windows in fields
    ]
    cut = (setup.cut_power_percent, setup.cut_speed_mm_s, setup.cut_repeats)
    labels = [
        label_paths(
            field_of(windows[0]), windows[0].openings[0].x_mm - 1.0, _label_y_mm(windows[0]), LABEL_MM
        )
        for windows in fields
    ]
    labels.append(arrow_paths(grid.fiducials_mm[3][0] / 2, _top_mm(grid), 4.0))
    everything = [
        label_pass(setup, np.concatenate(labels)),
        *passes,
        make_pass("fiducials", fiducial_strokes(grid), *cut),
    ]
    return placed_drawing(f"grid for {setup.material.name}", grid, setup, everything), coupon_to_json(grid)


def _label_y_mm(patch: Patch) -> float:
    opening = patch.openings[0]
    return opening.y_mm + opening.height_mm / 2 + 1.0


def _top_mm(grid: Coupon) -> float:
    """Foot of the arrow, above the fields."""
    rows = len({patch.speed_mm_s for patch in grid.patches})
    return MARGIN_MM + rows * FIELD_MM[1]


def _window_strokes(windows: list[Patch], unit: int) -> Strokes:
    """The windows' outlines; each is repeated as often as its passes exceed those of the unit."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    rows, owner = [], []
    for number, patch in enumerate(windows):
        opening = patch.openings[0]
        size = (opening.width_mm, opening.height_mm)
        path = (opening.x_mm, opening.y_mm) + corners * size
        rows += [path] * (patch.passes // unit)
        owner += [number] * (patch.passes // unit)
    return loop_strokes(np.array(rows), np.array(owner))
