"""The coupon's job: one pass for each patch, for the fiducials and for the row of triangles, on the machine's bed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmpdesign.products.laser.coupon.design import (
    KERFS_MM,
    MARGIN_MM,
    PATCH_MM,
    TRIANGLE_MM,
    Coupon,
    Patch,
    coupon_to_json,
    design_coupon,
)
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import LASER_LAYERS
from cmpdesign.products.laser.job import CIRCLE_POINTS, LaserPass
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import make_cavities
from cmpdesign.products.laser.paths.strokes import Strokes, loop_strokes
from cmpdesign.products.laser.setup import LaserSetup


def coupon_job(setup: LaserSetup) -> tuple[LaserDrawing, str]:
    """The coupon's drawing, and the text of ``coupon.json``."""
    coupon = design_coupon(setup)
    passes = [
        _make_pass(f"patch-{patch.name}", _opening_strokes(patch), setup, patch.power_percent, patch.passes)
        for patch in coupon.patches
    ]
    passes.insert(
        0,
        _make_pass("fiducials", _fiducial_strokes(coupon), setup, setup.cut_power_percent, setup.cut_repeats),
    )
    passes.append(
        _make_pass("kerf-row", _triangle_strokes(coupon), setup, setup.cut_power_percent, setup.cut_repeats)
    )
    origin = _coupon_origin_mm(coupon, setup)
    moved = tuple(replace(laser_pass, walls=laser_pass.walls.moved(origin)) for laser_pass in passes)
    drawing = LaserDrawing(
        name=f"coupon for {setup.material.name}",
        setup=setup,
        passes=moved,
        laser_layers={laser_pass.name: layer for laser_pass, layer in zip(moved, LASER_LAYERS, strict=True)},
        fiducials_mm=np.array(coupon.fiducials_mm) + origin,
        fiducial_diameter_mm=coupon.fiducial_diameter_mm,
    )
    return drawing, coupon_to_json(coupon)


def _coupon_origin_mm(coupon: Coupon, setup: LaserSetup) -> Points:
    """(2,) the coupon's origin for which the coupon is centred on the bed."""
    marks = np.array(coupon.fiducials_mm)
    bed = np.array([setup.machine.bed_width_mm.value, setup.machine.bed_height_mm.value])
    return np.asarray(np.round((bed - marks.max(axis=0)) / 2, 3))


def _make_pass(name: str, walls: Strokes, setup: LaserSetup, power_percent: float, repeats: int) -> LaserPass:
    return LaserPass(
        name=name,
        kind="coupon",
        color=None,
        cavities=None,
        walls=walls,
        fills=(),
        power_percent=power_percent,
        speed_mm_s=setup.cut_speed_mm_s,
        repeats=repeats,
    )


def _opening_strokes(patch: Patch) -> Strokes:
    """The nominal rectangles, without kerf compensation."""
    unit = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    rows = [
        (opening.x_mm, opening.y_mm) + unit * (opening.width_mm, opening.height_mm)
        for opening in patch.openings
    ]
    return loop_strokes(np.array(rows), np.arange(len(rows)))


def _fiducial_strokes(coupon: Coupon) -> Strokes:
    """Circles without kerf compensation."""
    angle = np.linspace(0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    circle = coupon.fiducial_diameter_mm / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    centres = np.array(coupon.fiducials_mm)
    return loop_strokes(centres[:, None] + circle, np.arange(len(centres)))


def _triangle_strokes(coupon: Coupon) -> Strokes:
    """The row of triangles, compensated for ``KERFS_MM`` from left to right."""
    triangle = TRIANGLE_MM * np.array([(-0.5, 0), (0.5, 0), (0, np.sqrt(0.75))])
    columns = {opening.x_mm for patch in coupon.patches for opening in patch.openings}
    spacing = (max(columns) - min(columns) + PATCH_MM[0] / 2) / len(KERFS_MM)
    paths = [
        make_cavities(
            np.arange(1),
            (triangle + (MARGIN_MM + (number + 0.5) * spacing, MARGIN_MM))[None],
            BeamFootprint.of_kerf(kerf_mm, kerf_mm),
            "overcut",
        ).loops_mm
        for number, kerf_mm in enumerate(KERFS_MM)
    ]
    return loop_strokes(np.concatenate(paths), np.arange(len(paths)))
