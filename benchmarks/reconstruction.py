"""The whole chain in space: two views are rendered, each is extracted, and the surface is triangulated.

    python -m benchmarks.reconstruction [--quick] [--json FILE]

The layout is the tac3d template (331 markers of pitch 1.5 mm, 4650 virtual ones) on an elastomer of 6 mm, seen from the
back by two views that share one image, as behind mirrors. Poses come from a separate rest frame; intrinsics are
known. Errors are RMS per axis against the scene's truth, over all markers and frames. They are compared with two
deviations, both with true poses: the one that the extractor's covariances imply for this geometry ("stated"), and the
Cramer-Rao bound of each view, gridline by gridline ("image"). "err/cov" is the error in units of the covariance that
is reported for each marker. One core.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Optics, Pinhole, Plain, Scene, Sensor, cramer_rao, render
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Reconstructor, Rig, View, ViewExtractor, parse_layout, triangulate

Array = NDArray[np.float64]
Surface = Callable[[Array], Array]

FRAMES, QUICK_FRAMES = 8, 2
DISTORTION = (-0.08, 0.03, 0.0005, -0.0008, 0.0)


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


@dataclass(frozen=True)
class ReconstructionResult:
    """The result for one sensor and state. Triples are x, y, z."""

    sensor: str
    state: str
    frames: int
    reported_share: float
    error_um: tuple[float, ...]
    stated_um: tuple[float, ...]
    image_um: tuple[float, ...]
    ratio_stated: float
    ratio_image: float
    normalised: float
    displacement_um: tuple[float, ...]
    virtual_um: tuple[float, ...]
    normal_deg: float
    extract_ms: float
    reconstruct_ms: float


def make_cameras(size: tuple[int, int], angle_deg: float, distance_mm: float) -> tuple[Pinhole, ...]:
    """Cameras of the left and the right half of the image, behind the pattern."""
    width, height = size[0] // 2, size[1]
    return tuple(
        Pinhole.looking(
            size,
            distance_mm=distance_mm,
            field_of_view_deg=44.0,
            tilt_deg=angle_deg,
            azimuth_deg=azimuth,
            roll_deg=roll,
            back=True,
            distortion=DISTORTION,
            area_px=(k * width, 0, width, height),
            name=name,
        )
        for k, (name, azimuth, roll) in enumerate((("left", 180.0, 1.5), ("right", 0.0, -1.0)))
    )


def make_rig(views: tuple[Pinhole, ...]) -> Rig:
    """A rig with intrinsics and without poses."""
    return Rig(tuple(View(v.name, v.focal_px, v.centre_px, v.distortion, v.area_px) for v in views))


def make_scene(layout: Layout, camera: tuple[Pinhole, ...], surface: Surface | None, seed: int) -> Scene:
    return Scene(
        layout=layout,
        camera=camera,
        surface=surface,
        background=Plain(BLACK_RGB),
        optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
        inks=INKS,
        seed=seed,
    )


def implied_deviation_um(
    placed: list[View], xyz: Array, cov_px2: Array, shown: NDArray[np.bool_]
) -> tuple[float, ...]:
    """RMS deviation per axis that pixel covariances imply with exact poses of the views."""
    pixels = np.stack([view.project(xyz) for view in placed])
    cov = triangulate(placed, pixels, cov_px2).cov_mm2[shown][:, [0, 1, 2], [0, 1, 2]]
    return tuple(float(v) for v in 1e3 * np.sqrt(np.nanmean(cov, axis=0)))


def measure_sensor(name: str, frames: int) -> list[ReconstructionResult]:
    """The results of all states of one sensor."""
    size, angle_deg, distance_mm = SENSORS[name]
    layout = build_layout(load_design("tac3d"))
    reference = parse_layout(layout_to_json(layout))
    views = make_cameras(size, angle_deg, distance_mm)
    extractor = ViewExtractor(reference, make_rig(views))
    reconstructor = Reconstructor(
        reference,
        extractor.rig,
        extractor.extract(render(make_scene(layout, views, None, 1000), size=size).image),
    )
    placed = [
        View(
            v.name,
            v.focal_px,
            v.centre_px,
            v.distortion,
            v.area_px,
            None,
            v.R_camera_from_layout,
            v.t_camera_from_layout_mm,
        )
        for v in views
    ]
    results = []
    for state, contact in STATES.items():
        surface = None if contact is None else solve(ELASTOMER, *contact).surface()
        results.append(
            _measure_state(
                name,
                state,
                make_scene(layout, views, surface, 0),
                size,
                frames,
                extractor,
                reconstructor,
                placed,
            )
        )
    return results


def _measure_state(
    name: str,
    state: str,
    shown: Scene,
    size: tuple[int, int],
    frames: int,
    extractor: ViewExtractor,
    reconstructor: Reconstructor,
    placed: list[View],
) -> ReconstructionResult:
    errors, cov, stated, moved, virtual, tilts, times = [], [], [], [], [], [], []
    flat = np.column_stack([reconstructor.layout.xy_mm, np.zeros(len(reconstructor.layout.xy_mm))])
    for seed in range(frames):
        shot = render(replace(shown, seed=seed), size=size)
        begin = time.perf_counter()
        markers = extractor.extract(shot.image)
        middle = time.perf_counter()
        shape = reconstructor.reconstruct(markers)
        times.append((middle - begin, time.perf_counter() - middle))
        true = shot.truth.marker_xyz_mm
        errors.append(shape.xyz_mm - true)
        cov.append(shape.cov_mm2)
        known = np.isfinite(shape.xyz_mm[:, 0])
        stated.append(implied_deviation_um(placed, true, np.stack([m.cov_px2 for m in markers]), known))
        moved.append(shape.displacement_mm - (true - flat))
        virtual.append((shape.virtual_xyz_mm - shot.truth.virtual_xyz_mm).reshape(-1, 3))
        tilts.append(_angles_deg(shape.normals, reconstructor, shown))
    error, covs = np.concatenate(errors), np.concatenate(cov)
    known = np.isfinite(error[:, 0])
    image = implied_deviation_um(
        placed, true, np.stack([_image_bound(shown, v, size) for v in shown.camera]), known[: len(true)]
    )  # type: ignore[union-attr]
    found = rms_um(error)
    stated_um = tuple(float(v) for v in np.sqrt(np.mean(np.square(stated), axis=0)))
    squares = np.einsum("ni,nij,nj->n", error[known], np.linalg.inv(covs[known]), error[known]) / 3
    extract_ms, reconstruct_ms = 1e3 * np.median(times, axis=0)
    return ReconstructionResult(
        sensor=name,
        state=state,
        frames=frames,
        reported_share=float(known.mean()),
        error_um=found,
        stated_um=stated_um,
        image_um=image,
        ratio_stated=bound_ratio(found, stated_um),
        ratio_image=bound_ratio(found, image),
        normalised=float(np.sqrt(squares.mean())),
        displacement_um=rms_um(np.concatenate(moved)),
        virtual_um=rms_um(np.concatenate(virtual)),
        normal_deg=float(np.sqrt(np.nanmean(np.square(tilts)))),
        extract_ms=float(extract_ms),
        reconstruct_ms=float(reconstruct_ms),
    )


def _image_bound(shown: Scene, camera: Pinhole, size: tuple[int, int]) -> Array:
    return cramer_rao(replace(shown, camera=camera), size=size)


def _angles_deg(normals: Array, reconstructor: Reconstructor, shown: Scene) -> Array:
    """(M,) angles between the normals found and those of the true surface, by central differences."""
    xy, step = reconstructor.layout.xy_mm, 1e-4
    if shown.surface is None:
        true = np.tile([0.0, 0.0, 1.0], (len(xy), 1))
    else:
        by_x, by_y = (shown.surface(xy + s) - shown.surface(xy - s) for s in step * np.eye(2))
        true = np.cross(by_x, by_y)
        true /= np.linalg.norm(true, axis=1, keepdims=True)
    return np.degrees(np.arcsin(np.clip(np.linalg.norm(np.cross(normals, true), axis=1), 0, 1)))


def rms_um(error_mm: Array) -> tuple[float, ...]:
    """RMS per axis of (N, 3) mm, in micrometres; NaN is ignored."""
    return tuple(float(v) for v in 1e3 * np.sqrt(np.nanmean(error_mm**2, axis=0)))


def bound_ratio(error_um: tuple[float, ...], bound_um: tuple[float, ...]) -> float:
    """RMS over the three axes of error over bound."""
    return float(np.sqrt(np.mean(np.square(error_um) / np.square(bound_um))))


def results_table(results: list[ReconstructionResult]) -> Table:
    shown = Table(box=SIMPLE_HEAD, title=results[0].sensor)
    for heading in (
        "state", "reported", "error um", "stated um", "image um", "err/stated", "err/image", "err/cov",
        "moved um", "virtual um", "normal deg", "ms",
    ):  # fmt: skip
        shown.add_column(
            heading, justify="left" if heading == "state" else "right", no_wrap=heading != "state"
        )
    for r in results:
        shown.add_row(
            r.state,
            f"{r.reported_share:.2%}",
            *(" ".join(f"{v:.2f}" for v in triple) for triple in (r.error_um, r.stated_um, r.image_um)),
            *(f"{v:.2f}" for v in (r.ratio_stated, r.ratio_image, r.normalised)),
            *(" ".join(f"{v:.2f}" for v in triple) for triple in (r.displacement_um, r.virtual_um)),
            f"{r.normal_deg:.2f}",
            f"{r.extract_ms:.0f}+{r.reconstruct_ms:.0f}",
        )
    return shown


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_FRAMES} frames of each state")
    parser.add_argument("--json", type=Path, help="also write the results here")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    frames = QUICK_FRAMES if options.quick else FRAMES
    console, results = Console(width=190), []
    for name in SENSORS:
        found = measure_sensor(name, frames)
        console.print(results_table(found))
        results += found
    console.print(conditions_text())
    if options.json:
        write_json(options.json, {"results": [asdict(result) for result in results]})


if __name__ == "__main__":
    main()
