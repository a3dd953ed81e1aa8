"""Depth of a press after each step of the calibration of a sensor, by Monte Carlo over calipers and data sheets.

A sensor: one camera that sees the pad's back in two mirrors, 15 to 20 degrees to either side, 25 or 55 mm away, through
2 to 3 mm of acrylic or glass and 2 to 5 mm of silicone. Markers are projected through window and gel, with noise of
0.006 px per axis, which is what the reader states in good light. What the user states differs from the truth by random
errors of the stated deviations. A press of 0.5 mm is then read; the error is that of its mean depth, over the press.
z is the RMS of errors over the deviations that ``reconstruct`` states, of noise and systematic ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scenes import standard_layout
from cmpdesign.calibration.rig.calibration import calibrate_rig_markers
from cmpdesign.files.layout_json import layout_to_json
from extractor import Markers, Reconstructor, Reference, Rig, Status, View, parse_layout
from extractor.space.medium import Medium

Array = NDArray[np.float64]

PRESS_MM, NOISE_PX, PITCH_PX_MM = 0.5, 0.006, 0.55
DISTORTION = (-0.08, 0.03, 0.0005, -0.0008, 0.0)
COARSE = {"gel_mm": 0.5, "gel_index": 0.02, "window_mm": 0.2}  # by eye, and from a book
FINE = {"gel_mm": 0.1, "gel_index": 0.005, "window_mm": 0.05}  # calipers and the data sheet
LOOSE_PX, CALIBRATED_PX = 18.0, 0.05  # deviation of the focal length: of a data sheet, of calibrate camera
# What is known -> deviations of the medium, of the focal length, steps of a plate and their deviation in mm.
ROWS = {
    "data sheets only": (COARSE, LOOSE_PX, (), 0.0),
    "+ calibrate camera": (COARSE, CALIBRATED_PX, (), 0.0),
    "+ calipers and the gel's data sheet": (FINE, CALIBRATED_PX, (), 0.0),
    "+ two steps of a plate, 2 um": (FINE, CALIBRATED_PX, (0.3, 1.3), 0.002),
    "+ two steps of a plate, 0.5 um": (FINE, CALIBRATED_PX, (0.3, 1.3), 0.0005),
}
DISTANCES_MM = (25.0, 55.0)


def true_views(distance_mm: float, rng: np.random.Generator) -> tuple[View, ...]:
    """Two views of one camera in mirrors, through window and gel."""
    medium = Medium(
        float(rng.uniform(2, 5)),
        float(rng.normal(1.41, 0.005)),
        float(rng.uniform(2, 3)),
        float(rng.choice((1.49, 1.52))),
    )
    focal_px = 900.0
    views = []
    for number, side in enumerate((-1.0, 1.0)):
        angle = side * np.radians(rng.uniform(15, 20))
        position = distance_mm * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        forward = -position / distance_mm
        right = np.cross([0.0, 1.0, 0.0], forward)
        rotation = np.diag([-1.0, 1, 1]) @ np.array([right / np.linalg.norm(right), [0.0, 1, 0], forward])
        views.append(
            View("left" if side < 0 else "right", (focal_px, focal_px), (640.0, 360.0), DISTORTION,
                 (640 * number, 0, 640, 720), None, rotation, -rotation @ position, medium=medium)
        )  # fmt: skip
    return tuple(views)


def markers_of(layout: Reference, view: View, xyz_mm: Array, rng: np.random.Generator) -> Markers:
    """What the reader would find."""
    count, virtual = len(xyz_mm), (len(layout.edges), layout.virtual_per_edge)
    return Markers(
        xy_px=view.project(xyz_mm) + rng.normal(0, NOISE_PX, (count, 2)),
        cov_px2=np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1)),
        status=np.full(count, Status.MEASURED, np.uint8),
        virtual_xy_px=np.full((*virtual, 2), np.nan),
        virtual_cov_px2=np.full((*virtual, 2, 2), np.nan),
        virtual_status=np.zeros(virtual, np.uint8),
        mirrored=bool(np.linalg.det(view.R_camera_from_layout) * view.position_mm[2] < 0),
        reason=None,
        timings_ms=MappingProxyType({}),
    )


def depth_errors(distance_mm: float, rng: np.random.Generator) -> Iterator[tuple[str, float, float]]:
    """Of every row the relative error of the depth, and its stated deviation."""
    views = true_views(distance_mm, rng)
    design = standard_layout("honeycomb", 6)
    scale = PITCH_PX_MM * distance_mm / (900.0 / 40) / design.parameters["pitch_mm"]
    layout = parse_layout(layout_to_json(design))
    layout = replace(layout, xy_mm=layout.xy_mm * scale)
    flat_mm = np.column_stack([layout.xy_mm, np.zeros(len(layout.xy_mm))])
    half_mm = float(np.abs(layout.xy_mm).max())
    dent = np.exp(-((layout.xy_mm / (0.4 * half_mm)) ** 2).sum(axis=1))
    press_mm = flat_mm - PRESS_MM * np.outer(dent, [0.0, 0, 1])
    rest, pressed = ([markers_of(layout, view, at, rng) for view in views] for at in (flat_mm, press_mm))
    unit = rng.normal(size=13)
    for known, (medium_sigma, focal_px, ways_mm, step_mm) in ROWS.items():
        cov = np.diag(np.square([focal_px, focal_px, focal_px, focal_px, *[1e-4] * 5]))
        cov[0, 1] = cov[1, 0] = focal_px**2 * 0.9999
        lens = (
            np.array([*views[0].focal_px, *views[0].centre_px, *DISTORTION])
            + np.linalg.cholesky(cov) @ unit[:9]
        )
        medium = views[0].medium
        assert medium is not None
        stated = replace(
            medium,
            **{
                name: getattr(medium, name) + s * u
                for (name, s), u in zip(medium_sigma.items(), unit[9:], strict=False)
            },
        )
        rig = Rig(
            tuple(
                View(view.name, (lens[0], lens[1]), (lens[2], lens[3]), tuple(lens[4:]), view.area_px, view.mirrored,
                     medium=stated)
                for view in views
            ),
            medium_sigma,
        )  # fmt: skip
        steps = {}
        offset_mm = rng.normal(0, 0.05)
        for way_mm in ways_mm:
            plate = flat_mm * 1.01
            plate[:, 2] = offset_mm - way_mm - rng.normal(0, step_mm)
            steps[way_mm] = [markers_of(layout, view, plate, rng) for view in views]
        found = calibrate_rig_markers(
            layout, rig, [rest], steps, camera_cov=cov, step_sigma_mm=max(step_mm, 1e-4)
        )
        shape = Reconstructor(layout, found.rig, rest).reconstruct(pressed)
        deep = dent > 0.5
        error = (shape.displacement_mm[:, 2] + PRESS_MM * dent)[deep].mean() / (PRESS_MM * dent[deep].mean())
        systematic = shape.displacement_systematic_mm[deep, 2].mean() / (PRESS_MM * dent[deep].mean())
        noise_mm2 = shape.displacement_cov_mm2[deep, 2, 2].mean() / deep.sum()
        stated_share = np.hypot(systematic, np.sqrt(noise_mm2) / (PRESS_MM * dent[deep].mean()))
        yield known, float(error), float(stated_share)


def measure(sensors: int = 60, seed: int = 0) -> Shown:
    """One row for every state of knowledge at every distance.

    Args:
        sensors: random sensors for each distance.
    """
    rows = []
    for distance_mm in DISTANCES_MM:
        pooled: dict[str, list[tuple[float, float]]] = {known: [] for known in ROWS}
        for number in range(sensors):
            rng = np.random.default_rng([seed, int(distance_mm), number])
            for known, error, stated in depth_errors(distance_mm, rng):
                pooled[known].append((error, stated))
        for known, pairs in pooled.items():
            error, stated = np.array(pairs).T
            rms, below = rms_of(error), np.quantile(np.abs(error), 0.95)
            shares = 100 * rms, 100 * below, 100 * rms_of(stated)
            rows.append((known, distance_mm, *shares, 1e3 * rms * PRESS_MM, rms_of(error / stated)))
    columns = {"known": TEXT, "from mm": ".0f", "RMS %": ".2f", "95 % below": ".2f", "stated %": ".2f"}
    yield Table(f"depth, {sensors} sensors for each distance", columns | {"RMS um": ".1f", "z": ".2f"}, rows)


main = Experiment("rig", measure)
main.run_as(__name__)
