"""Depth through a window and a gel: with true constants, with wrong ones, and as if there were air.

    python -m benchmarks.medium [--quick] [--seed N] [--json FILE]

Every rig is drawn at random: two views behind the pattern, 25 to 60 mm away and 15 to 22 degrees to either side, 2 to 5
mm of gel, a window of 2 to 3 mm of acrylic or glass. The pattern fills the same share of the image in all of them. A
ball is pressed in by 0.3 to 1 mm and sheared by up to 0.2 mm. Images are rendered through the medium and read; poses
come from a rest frame of its own, so that a wrong constant acts on both. Depth errors are those of the displacement
along z, over the markers that move by more than half of the press. "mean error" is the mean of their absolute values;
"short" is by how much smaller the displacement reads, by least squares; z is the RMS of the errors of positions and of
displacements over their covariances. A wrong constant is taken with both signs. The window that is tilted by 1 degree
is tilted in the images, and parallel to the pattern for the reader.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"  # before numpy and numba
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
from cmpdesign.scene import Medium, Optics, Pinhole, Plain, Scene, Sensor, Truth, WindowPlane, render
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Markers, Reconstructor, Rig, View, ViewExtractor, parse_layout
from extractor import Medium as ReadMedium

Array = NDArray[np.float64]

RIGS, QUICK_RIGS = 24, 2
SIZE = (1280, 480)
DISTORTION = (-0.08, 0.03, 0.0005, -0.0008, 0.0)
LAYERS_PER_MM = 10 / 56  # the pattern fills the same share of the image at every distance
PRESSES_MM = ((0.3, 0.5), (0.5, 0.8), (0.8, 1.0))
LIMIT_UM, LIMIT_SHARE = 2.0, 0.003
WINDOW_INDICES = (1.49, 1.52)  # acrylic, glass
TRUE, TILT, AIR = "true constants", "window tilted by 1 degree", "no medium"
CHANGES: dict[str, dict[str, float]] = {
    "gel's index off by 0.01": {"gel_index": 0.01},
    "window's index off by 0.01": {"window_index": 0.01},
    "gel's thickness off by 0.5 mm": {"gel_mm": 0.5},
    "window's thickness off by 0.5 mm": {"window_mm": 0.5},
}
ROWS = (TRUE, *CHANGES, TILT, AIR)


@dataclass(frozen=True)
class RandomRig:
    """A sensor, drawn at random."""

    distance_mm: float
    angle_deg: float
    medium: Medium
    layout: Layout
    cameras: tuple[Pinhole, ...]

    def rig(self, medium: Medium | None) -> Rig:
        """What a rig file would say, without poses, with this medium."""
        read = None
        if medium is not None:
            read = ReadMedium(medium.gel_mm, medium.gel_index, medium.window_mm, medium.window_index)
        return Rig(
            tuple(
                View(c.name, c.focal_px, c.centre_px, c.distortion, c.area_px, medium=read)
                for c in self.cameras
            )
        )

    def tilted(self, azimuth_rad: float, tilt_rad: float) -> tuple[Pinhole, ...]:
        """The cameras with a window that is tilted against the pattern; the gel is as thick in the middle."""
        normal = np.array(
            [np.sin(tilt_rad) * np.cos(azimuth_rad), np.sin(tilt_rad) * np.sin(azimuth_rad), np.cos(tilt_rad)]
        )
        cameras = []
        for camera in self.cameras:
            x, y, z = camera.R_camera_from_layout @ normal
            middle = float(np.array([x, y, z]) @ camera.t_camera_from_layout_mm)
            plane = WindowPlane((x, y, z), middle - self.medium.gel_mm - self.medium.window_mm)
            cameras.append(replace(camera, window=plane))
        return tuple(cameras)


@dataclass(frozen=True)
class Reading:
    """The markers of one pressed frame as they are read, and as they are."""

    press_mm: float
    rest: tuple[Markers, ...]
    markers: tuple[Markers, ...]
    truth: Truth


@dataclass(frozen=True)
class DepthErrors:
    """The errors of one frame under one assumption.

    Attributes:
        row: the assumption.
        press_mm: the press.
        depth_um: (N,) errors of the displacement along z of pressed markers.
        short: share by which their displacement reads short.
        position: (M,) squared errors of positions over their covariances, per axis.
        displacement: (M,) the same of displacements.
        misfit: of the rest frame.
        warned: the rest frame is warned about.
    """

    row: str
    press_mm: float
    depth_um: Array
    short: float
    position: Array
    displacement: Array
    misfit: float
    warned: bool


def random_rig(rng: np.random.Generator) -> RandomRig:
    distance_mm, angle_deg = float(rng.uniform(25, 60)), float(rng.uniform(15, 22))
    medium = Medium(
        float(rng.uniform(2, 5)), 1.41, float(rng.uniform(2, 3)), float(rng.choice(WINDOW_INDICES))
    )
    layers = str(max(3, round(LAYERS_PER_MM * distance_mm)))
    width, height = SIZE[0] // 2, SIZE[1]
    cameras = tuple(
        Pinhole.looking(
            SIZE,
            distance_mm=distance_mm,
            field_of_view_deg=44.0,
            tilt_deg=angle_deg,
            azimuth_deg=azimuth,
            roll_deg=float(rng.uniform(-2, 2)),
            back=True,
            distortion=DISTORTION,
            area_px=(k * width, 0, width, height),
            name=name,
        )
        for k, (name, azimuth) in enumerate((("left", 180.0), ("right", 0.0)))
    )
    return RandomRig(
        distance_mm, angle_deg, medium, build_layout(load_design("tac3d", {"layers": layers})), cameras
    )


def read_rig(found: RandomRig, rng: np.random.Generator) -> Iterator[tuple[Reading, Reading]]:
    """For every press the reading through the parallel window, and through one that is tilted by 1 degree."""
    views = ViewExtractor(parse_layout(layout_to_json(found.layout)), found.rig(found.medium))
    windows = (found.cameras, found.tilted(float(rng.uniform(0, 2 * np.pi)), np.radians(1.0)))
    half_mm = float(np.abs(found.layout.marker_xy_mm).max())
    scene = Scene(
        found.layout,
        background=Plain(BLACK_RGB),
        optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
        inks=INKS,
        medium=found.medium,
    )
    rests = [
        views.extract(render(replace(scene, camera=cameras, seed=_seed(rng)), size=SIZE).image)
        for cameras in windows
    ]
    for low, high in PRESSES_MM:
        press_mm, angle = float(rng.uniform(low, high)), float(rng.uniform(0, 2 * np.pi))
        x, y = (float(v) for v in rng.uniform(-0.2, 0.2, 2) * half_mm)
        shear_mm = float(rng.uniform(0, 0.2))
        contact = solve(
            Elastomer(found.medium.gel_mm + 1.0, 0.2),
            Ball(radius_mm=float(rng.uniform(0.5, 1.0)) * half_mm, centre_mm=(x, y)),
            Motion(press_mm, (shear_mm * np.cos(angle), shear_mm * np.sin(angle))),
        )
        readings = []
        for cameras, rest in zip(windows, rests, strict=True):
            drawn = render(
                replace(scene, camera=cameras, surface=contact.surface(), seed=_seed(rng)), size=SIZE
            )
            readings.append(Reading(press_mm, rest, views.extract(drawn.image), drawn.truth))
        yield readings[0], readings[1]


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(1 << 31))


def measure_rig(found: RandomRig, rng: np.random.Generator) -> Iterator[DepthErrors]:
    """The errors of every press under every assumption."""
    for straight, tilted in read_rig(found, rng):
        yield depth_errors(TRUE, found, straight, found.medium)
        for row, steps in CHANGES.items():
            for sign in (1, -1):
                changed = {field: getattr(found.medium, field) + sign * step for field, step in steps.items()}
                yield depth_errors(row, found, straight, replace(found.medium, **changed))  # type: ignore[arg-type]
        yield depth_errors(TILT, found, tilted, found.medium)
        yield depth_errors(AIR, found, straight, None)


def depth_errors(row: str, found: RandomRig, reading: Reading, medium: Medium | None) -> DepthErrors:
    """The errors of a reading if this were the medium."""
    layout = parse_layout(layout_to_json(found.layout))
    reconstructor = Reconstructor(layout, found.rig(medium), reading.rest)
    shape = reconstructor.reconstruct(reading.markers)
    true = reading.truth.marker_xyz_mm
    moved = true - np.column_stack([layout.xy_mm, np.zeros(len(true))])
    known = np.isfinite(shape.displacement_mm[:, 2])
    pressed = known & (-moved[:, 2] > 0.5 * reading.press_mm)
    read_mm, true_mm = shape.displacement_mm[pressed, 2], moved[pressed, 2]
    return DepthErrors(
        row,
        reading.press_mm,
        1e3 * (read_mm - true_mm),
        1 - float(read_mm @ true_mm / (true_mm @ true_mm)),
        squares((shape.xyz_mm - true)[known], shape.cov_mm2[known]),
        squares((shape.displacement_mm - moved)[known], shape.displacement_cov_mm2[known]),
        reconstructor.poses.misfit,
        bool(reconstructor.warnings),
    )


def squares(error: Array, cov: Array) -> Array:
    """(N,) squared errors over their covariances, per axis."""
    return np.asarray(np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error) / error.shape[1])


@dataclass(frozen=True)
class PooledErrors:
    """The errors of many frames under one assumption, see the module.

    Attributes:
        mean_um: the mean of the absolute depth errors.
        bias_um: the mean over frames of the absolute mean depth error.
        short_percent: the mean; ``short_range_percent``: least and most.
        z_position, z_displacement: see the module.
        misfit: of the rest frames, median.
        warned_percent: of the frames.
    """

    label: str
    frames: int
    press_mm: float
    mean_um: float
    bias_um: float
    short_percent: float
    short_range_percent: tuple[float, float]
    z_position: float
    z_displacement: float
    misfit: float
    warned_percent: float

    @property
    def limit_um(self) -> float:
        """What the mean depth error may be with true constants."""
        return LIMIT_UM + 1e3 * LIMIT_SHARE * self.press_mm


def pool(label: str, errors: list[DepthErrors]) -> PooledErrors:
    short = [100 * each.short for each in errors]
    z = [
        float(np.sqrt(np.concatenate([getattr(each, name) for each in errors]).mean()))
        for name in ("position", "displacement")
    ]
    return PooledErrors(
        label,
        len(errors),
        float(np.mean([each.press_mm for each in errors])),
        float(np.abs(np.concatenate([each.depth_um for each in errors])).mean()),
        float(np.mean([abs(each.depth_um.mean()) for each in errors])),
        float(np.mean(short)),
        (min(short), max(short)),
        *z,
        float(np.median([each.misfit for each in errors])),
        100 * float(np.mean([each.warned for each in errors])),
    )


def true_table(pools: list[PooledErrors]) -> Table:
    table = Table(box=SIMPLE_HEAD, title="with the true constants")
    for heading in (
        "press",
        "frames",
        "mean error um",
        "limit um",
        "bias um",
        "z position",
        "z displacement",
    ):
        table.add_column(heading, justify="right")
    for each in pools:
        table.add_row(
            each.label, str(each.frames), f"{each.mean_um:.2f}", f"{each.limit_um:.2f}", f"{each.bias_um:.2f}",
            f"{each.z_position:.2f}", f"{each.z_displacement:.2f}",
        )  # fmt: skip
    return table


def wrong_table(pools: list[PooledErrors]) -> Table:
    table = Table(box=SIMPLE_HEAD, title="what the reader assumes")
    for heading in (
        "assumption", "mean error um", "bias um", "short %", "least", "most", "z position", "z displacement",
        "misfit at rest", "warned %",
    ):  # fmt: skip
        table.add_column(heading, justify="left" if heading == "assumption" else "right")
    for each in pools:
        table.add_row(
            each.label, f"{each.mean_um:.2f}", f"{each.bias_um:.2f}", f"{each.short_percent:.2f}",
            *(f"{v:.2f}" for v in each.short_range_percent), f"{each.z_position:.2f}", f"{each.z_displacement:.2f}",
            f"{each.misfit:.2f}", f"{each.warned_percent:.0f}",
        )  # fmt: skip
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_RIGS} rigs instead of {RIGS}")
    parser.add_argument("--seed", type=int, default=0, help="of the first rig [default: 0]")
    parser.add_argument("--json", type=Path, help="also write the results here")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    errors: list[DepthErrors] = []
    for number in range(QUICK_RIGS if options.quick else RIGS):
        rng = np.random.default_rng([options.seed, number])
        errors += measure_rig(random_rig(rng), rng)
    true = [each for each in errors if each.row == TRUE]
    by_press = [
        pool(f"{low:g} to {high:g} mm", [each for each in true if low <= each.press_mm <= high])
        for low, high in PRESSES_MM
    ]
    by_press.append(pool("all", true))
    by_row = [pool(row, [each for each in errors if each.row == row]) for row in ROWS]
    console = Console(width=150)
    console.print(true_table(by_press))
    console.print(wrong_table(by_row))
    console.print(conditions_text())
    if options.json:
        keys = PooledErrors.__dataclass_fields__
        rows = [{key: getattr(each, key) for key in keys} for each in (*by_press, *by_row)]
        write_json(options.json, {"results": rows})


if __name__ == "__main__":
    main()
