"""The coupon's job: a pass for each patch, for labels, fiducials and the row of triangles, on the machine's bed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmpdesign.products.laser.coupon.design import (
    KERFS_MM,
    LABEL_MM,
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
from cmpdesign.products.laser.library import settings_on
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import make_cavities
from cmpdesign.products.laser.paths.labels import arrow_paths, label_paths
from cmpdesign.products.laser.paths.strokes import Strokes, loop_strokes
from cmpdesign.products.laser.setup import LaserSetup


def coupon_job(setup: LaserSetup) -> tuple[LaserDrawing, str]:
    """The coupon's drawing, and the text of ``coupon.json``."""
    coupon = design_coupon(setup)
    cut = (setup.cut_power_percent, setup.cut_speed_mm_s, setup.cut_repeats)
    passes = [
        label_pass(setup, _label_segments(coupon)),
        make_pass("fiducials", fiducial_strokes(coupon), *cut),
        *(
            make_pass(
                f"patch-{patch.name}",
                _opening_strokes(patch),
                patch.power_percent,
                patch.speed_mm_s,
                patch.passes,
            )
            for patch in coupon.patches
        ),
        make_pass("kerf-row", _triangle_strokes(coupon), *cut),
    ]
    return placed_drawing(f"coupon for {setup.material.name}", coupon, setup, passes), coupon_to_json(coupon)


def placed_drawing(name: str, coupon: Coupon, setup: LaserSetup, passes: Sequence[LaserPass]) -> LaserDrawing:
    """Passes in the frame of a test piece, centred on the bed."""
    origin = _coupon_origin_mm(coupon, setup)
    moved = tuple(replace(laser_pass, walls=laser_pass.walls.moved(origin)) for laser_pass in passes)
    return LaserDrawing(
        name=name,
        setup=setup,
        passes=moved,
        laser_layers={laser_pass.name: layer for laser_pass, layer in zip(moved, LASER_LAYERS, strict=False)},
        fiducials_mm=np.array(coupon.fiducials_mm) + origin,
        fiducial_diameter_mm=coupon.fiducial_diameter_mm,
    )


def label_pass(setup: LaserSetup, segments: Points) -> LaserPass:
    """(N, 2, 2) segments as a pass that marks every sheet: burnt as the material's pockets are, else as its cuts."""
    settings = settings_on(setup.material, setup.options.machine)
    pocket = (settings.pocket_power_percent, settings.pocket_speed_mm_s)
    if pocket[0] is None or pocket[1] is None:
        pocket = (settings.cut_power_percent, settings.cut_speed_mm_s)
    strokes = loop_strokes(segments, np.arange(len(segments)))
    return make_pass("labels", strokes, pocket[0].value, pocket[1].value, 1)  # type: ignore[union-attr]


def _coupon_origin_mm(coupon: Coupon, setup: LaserSetup) -> Points:
    """(2,) the coupon's origin for which the coupon is centred on the bed."""
    marks = np.array(coupon.fiducials_mm)
    bed = np.array([setup.machine.bed_width_mm.value, setup.machine.bed_height_mm.value])
    return np.asarray(np.round((bed - marks.max(axis=0)) / 2, 3))


def make_pass(name: str, walls: Strokes, power_percent: float, speed_mm_s: float, repeats: int) -> LaserPass:
    """A pass of a test piece."""
    return LaserPass(
        name=name,
        kind="coupon",
        color=None,
        cavities=None,
        walls=walls,
        fills=(),
        power_percent=power_percent,
        speed_mm_s=speed_mm_s,
        repeats=repeats,
    )


def _label_segments(coupon: Coupon) -> Points:
    """The patches' names, and an arrow to the top of the picture."""
    names = [
        label_paths(patch.name, patch.openings[1].x_mm - 1.2, patch.openings[2].y_mm - 1.6, LABEL_MM)
        for patch in coupon.patches
    ]
    right, top = coupon.fiducials_mm[3]
    return np.concatenate([*names, arrow_paths(right / 2, top - 2.0, 4.0)])


def _opening_strokes(patch: Patch) -> Strokes:
    """The nominal rectangles, without kerf compensation."""
    unit = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    rows = [
        (opening.x_mm, opening.y_mm) + unit * (opening.width_mm, opening.height_mm)
        for opening in patch.openings
    ]
    return loop_strokes(np.array(rows), np.arange(len(rows)))


def fiducial_strokes(coupon: Coupon) -> Strokes:
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
