"""The whole chain in space: two views are rendered, each is extracted, and the surface is triangulated.

The layout is the tac3d template (331 markers of pitch 1.5 mm, 4650 virtual ones) on an elastomer of 6 mm, seen from the
back by two views that share one image, as behind mirrors. Poses come from a separate rest frame; intrinsics are
known. Errors are RMS per axis against the scene's truth, over all markers and frames. They are compared with two
deviations, both with true poses: the one that the extractor's covariances imply for this geometry ("stated"), and the
Cramer-Rao bound of each view, gridline by gridline ("image"). "err/cov" is the error in units of the covariance that
is reported for each marker. One core.

The last table has the times of the first sensor for a press that grows and falls by 0.04 mm a frame, the least of all
frames in turns: "cpu ms" of the processor, in all threads, and "clock ms". A pair is tracked with the preset
"balanced" from image to surface. On a machine that does other work, only "cpu ms" is a measure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import least_in_turns, timed
from benchmarks.suites.halves import placed_views, rig_of, two_cameras
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.scene import Scene, cramer_rao, render, standard_scene
from extractor import (
    Field,
    Reconstructor,
    Shape,
    ShapeTracker,
    ViewExtractor,
    parse_layout,
    triangulate,
)

Array = NDArray[np.float64]
Surface = Callable[[Array], Array]

FRAMES, QUICK_FRAMES = 8, 2
ROUNDS, QUICK_ROUNDS = 12, 2  # of the frames of a press, for times


class SensorSetup(NamedTuple):
    """Size of the whole image, angle of each view to the pattern's normal, distance of each view."""

    size: tuple[int, int]
    angle_deg: float
    distance_mm: float


SENSORS = {
    "1280 x 480, two halves of 640 x 480": SensorSetup((1280, 480), 20.0, 56.0),
    "640 x 480, two halves of 320 x 480": SensorSetup((640, 480), 15.0, 44.0),
}
ELASTOMER = Elastomer(thickness_mm=6.0, young_mpa=0.2, poisson=0.48)
WIDE, NARROW = Ball(radius_mm=20.0), Ball(radius_mm=8.0)
STATES: dict[str, tuple[Ball, Motion] | None] = {
    "at rest": None,
    "ball 20 mm: press 0.5 mm": (WIDE, Motion(0.5)),
    "press 1 mm": (WIDE, Motion(1.0)),
    "press 2 mm": (WIDE, Motion(2.0)),
    "press 1 mm, shear 0.5 mm": (WIDE, Motion(1.0, (0.5, 0.0))),
    "press 1 mm, twist 10 degrees": (WIDE, Motion(1.0, twist_deg=10.0)),
    "ball 8 mm: press 1 mm": (NARROW, Motion(1.0)),
    "press 1 mm, shear 1 mm": (NARROW, Motion(1.0, (1.0, 0.0))),
}


COLUMNS = {
    "state": TEXT, "reported": ".2%", "error um": ".2f", "stated um": ".2f", "image um": ".2f", "err/stated": ".2f",
    "err/image": ".2f", "err/cov": ".2f", "moved um": ".2f", "virtual um": ".2f", "normal deg": ".2f",
    "extract, reconstruct ms": ".0f",
}  # fmt: skip
TIMES = {"work": TEXT, "cpu ms": ".2f", "clock ms": ".2f"}
FIRST_MM, STEP_MM, STEPS = 0.1, 0.04, 10  # of the press whose times are measured
GRID = 64  # points of a field along each axis


@dataclass(frozen=True, eq=False)
class RestedSensor:
    """A sensor after its rest frame: the scene without surface, and what reads its images."""

    scene: Scene
    size: tuple[int, int]
    extractor: ViewExtractor
    reconstructor: Reconstructor

    @classmethod
    def of(cls, setup: SensorSetup) -> RestedSensor:
        layout = build_layout(load_design("tac3d"))
        views = two_cameras(
            setup.size,
            (1.5, -1.0),
            distance_mm=setup.distance_mm,
            field_of_view_deg=44.0,
            tilt_deg=setup.angle_deg,
        )
        scene = replace(standard_scene(layout, seed=1000), camera=views)
        reference = parse_layout(layout_to_json(layout))
        extractor = ViewExtractor(reference, rig_of(views))
        rest = extractor.extract(render(scene, size=setup.size).image)
        return cls(scene, setup.size, extractor, Reconstructor(reference, extractor.rig, rest))

    def implied_deviation_um(self, xyz: Array, cov_px2: Array, shown: NDArray[np.bool_]) -> tuple[float, ...]:
        """RMS deviation per axis that pixel covariances imply with exact poses of the views."""
        placed = placed_views(self.scene.camera)
        pixels = np.stack([view.project(xyz) for view in placed])
        cov = triangulate(placed, pixels, cov_px2).cov_mm2[shown][:, [0, 1, 2], [0, 1, 2]]
        return tuple(float(v) for v in 1e3 * np.sqrt(np.nanmean(cov, axis=0)))

    def state_row(self, state: str, surface: Surface | None, frames: int) -> tuple[object, ...]:
        """The row of ``COLUMNS``."""
        shown = replace(self.scene, surface=surface)
        errors, cov, stated, moved, virtual, tilts, times = [], [], [], [], [], [], []
        xy_mm = self.reconstructor.layout.xy_mm
        flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
        for seed in range(frames):
            shot = render(replace(shown, seed=seed), size=self.size)
            extracted = timed(partial(self.extractor.extract, shot.image))
            markers = extracted.result
            reconstructed = timed(partial(self.reconstructor.reconstruct, markers))
            shape = reconstructed.result
            times.append((extracted.clock_ms, reconstructed.clock_ms))
            true = shot.truth.marker_xyz_mm
            errors.append(shape.xyz_mm - true)
            cov.append(shape.cov_mm2)
            known = np.isfinite(shape.xyz_mm[:, 0])
            stated.append(self.implied_deviation_um(true, np.stack([m.cov_px2 for m in markers]), known))
            moved.append(shape.displacement_mm - (true - flat))
            virtual.append((shape.virtual_xyz_mm - shot.truth.virtual_xyz_mm).reshape(-1, 3))
            tilts.append(angles_deg(shape.normals, xy_mm, surface))
        error, covs = np.concatenate(errors), np.concatenate(cov)
        known = np.isfinite(error[:, 0])
        bounds = np.stack(
            [cramer_rao(replace(shown, camera=camera), size=self.size) for camera in shown.camera]
        )
        image_um = self.implied_deviation_um(true, bounds, known[: len(true)])
        found_um = rms_um(error)
        stated_um = tuple(float(v) for v in np.sqrt(np.mean(np.square(stated), axis=0)))
        squares = np.einsum("ni,nij,nj->n", error[known], np.linalg.inv(covs[known]), error[known]) / 3
        return (
            state, float(known.mean()), found_um, stated_um, image_um, bound_ratio(found_um, stated_um),
            bound_ratio(found_um, image_um), float(np.sqrt(squares.mean())), rms_um(np.concatenate(moved)),
            rms_um(np.concatenate(virtual)), rms_of(tilts),
            tuple(np.median(times, axis=0)),
        )  # fmt: skip


def all_of(shape: Shape) -> Shape:
    """The shape, with all that is computed when it is asked for."""
    _ = shape.virtual_xyz_mm, shape.displacement_cov_mm2, shape.displacement_systematic_mm
    return shape


def time_rows(sensor: RestedSensor, rounds: int) -> list[tuple[str, float, float]]:
    """The rows of ``TIMES``."""
    depths_mm = FIRST_MM + STEP_MM * np.arange(STEPS)
    shown = [
        render(replace(sensor.scene, seed=seed, surface=solve(ELASTOMER, WIDE, Motion(depth)).surface()),
               size=sensor.size).image
        for seed, depth in enumerate(depths_mm.tolist())
    ]  # fmt: skip
    images = (shown + shown[-2:0:-1]) * rounds
    reconstructor = sensor.reconstructor
    markers = [sensor.extractor.extract(image) for image in shown]
    shape, views = reconstructor.reconstruct(markers[0]), reconstructor.poses.views
    side = 0.9 * np.abs(reconstructor.layout.xy_mm).max() * np.linspace(-1.0, 1.0, GRID)
    grid_mm, field = np.stack(np.meshgrid(side, side), axis=2).reshape(-1, 2), Field(reconstructor.layout)

    def reconstruct(number: int) -> Shape:
        return reconstructor.reconstruct(markers[number % len(markers)])

    def triangulated(number: int) -> object:
        pair = markers[number % len(markers)]
        return triangulate(views, np.stack([m.xy_px for m in pair]), np.stack([m.cov_px2 for m in pair]))

    alone, both = (ShapeTracker(reconstructor, threads=threads) for threads in (1, 2))
    work: dict[str, Callable[[int], object]] = {
        "pair of views with 3-D, one thread": lambda k: all_of(alone.track(images[k]).shape),
        "pair of views with 3-D, two threads": lambda k: all_of(both.track(images[k]).shape),
        "triangulate": triangulated,
        "reconstruct": reconstruct,
        "reconstruct, with virtual markers and all covariances": lambda k: all_of(reconstruct(k)),
        f"field of {GRID} x {GRID} points": lambda k: field.at(shape.displacement_mm, grid_mm),
    }
    return [(name, *least) for name, least in least_in_turns(work, len(images)).items()]


def angles_deg(normals: Array, xy_mm: Array, surface: Surface | None) -> Array:
    """(M,) angles between the normals found and those of the true surface, by central differences."""
    if surface is None:
        true = np.tile([0.0, 0.0, 1.0], (len(xy_mm), 1))
    else:
        by_x, by_y = (surface(xy_mm + s) - surface(xy_mm - s) for s in 1e-4 * np.eye(2))
        true = np.cross(by_x, by_y)
        true /= np.linalg.norm(true, axis=1, keepdims=True)
    return np.degrees(np.arcsin(np.clip(np.linalg.norm(np.cross(normals, true), axis=1), 0, 1)))


def rms_um(error_mm: Array) -> tuple[float, ...]:
    """RMS per axis of (N, 3) mm, in micrometres; NaN is ignored."""
    return tuple(float(v) for v in 1e3 * np.sqrt(np.nanmean(error_mm**2, axis=0)))


def bound_ratio(error_um: tuple[float, ...], bound_um: tuple[float, ...]) -> float:
    """RMS over the three axes of error over bound."""
    return float(np.sqrt(np.mean(np.square(error_um) / np.square(bound_um))))


def measure(quick: bool = False) -> Shown:
    """One table for every sensor, one row for every state; then the times.

    Args:
        quick: two frames of each state.
    """
    frames = QUICK_FRAMES if quick else FRAMES
    sensors = {name: RestedSensor.of(setup) for name, setup in SENSORS.items()}
    for name, sensor in sensors.items():
        rows = []
        for state, contact in STATES.items():
            surface = None if contact is None else solve(ELASTOMER, *contact).surface()
            rows.append(sensor.state_row(state, surface, frames))
        yield Table(name, COLUMNS, rows)
    first = next(iter(sensors.values()))
    yield Table("least times", TIMES, time_rows(first, QUICK_ROUNDS if quick else ROUNDS))


main = Experiment("reconstruction", measure)
main.run_as(__name__)
