"""Random sensors with window and gel, and the readings of their pictures under random presses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.halves import rig_of, two_cameras
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Medium, Pinhole, Truth, WindowPlane, render, standard_scene
from extractor import Markers, Rig, ViewExtractor, parse_layout
from extractor import Medium as ReadMedium

Array = NDArray[np.float64]

SIZE = (1280, 480)
LAYERS_PER_MM = 10 / 56  # the pattern fills the same share of the image at every distance
PRESSES_MM = ((0.3, 0.5), (0.5, 0.8), (0.8, 1.0))
WINDOW_INDICES = (1.49, 1.52)  # acrylic, glass


@dataclass(frozen=True)
class RandomRig:
    """A sensor, drawn at random."""

    medium: Medium
    layout: Layout
    cameras: tuple[Pinhole, ...]

    def rig(self, medium: Medium | None) -> Rig:
        """The rig without poses, with this medium."""
        read = None
        if medium is not None:
            read = ReadMedium(medium.gel_mm, medium.gel_index, medium.window_mm, medium.window_index)
        return rig_of(self.cameras, read)

    def tilted(self, azimuth_rad: float, tilt_rad: float) -> tuple[Pinhole, ...]:
        """The cameras with a window that is tilted against the pattern; the gel's thickness in the middle does not
        change.
        """
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
class PressedFrame:
    """The read and the true markers of one pressed frame."""

    press_mm: float
    rest: tuple[Markers, ...]
    markers: tuple[Markers, ...]
    truth: Truth


def random_rig(rng: np.random.Generator) -> RandomRig:
    distance_mm, angle_deg = float(rng.uniform(25, 60)), float(rng.uniform(15, 22))
    medium = Medium(
        float(rng.uniform(2, 5)), 1.41, float(rng.uniform(2, 3)), float(rng.choice(WINDOW_INDICES))
    )
    layers = str(max(3, round(LAYERS_PER_MM * distance_mm)))
    rolls_deg = [float(rng.uniform(-2, 2)) for _ in range(2)]
    cameras = two_cameras(
        SIZE, rolls_deg, distance_mm=distance_mm, field_of_view_deg=44.0, tilt_deg=angle_deg
    )
    return RandomRig(medium, build_layout(load_design("tac3d", {"layers": layers})), cameras)


def read_rig(found: RandomRig, rng: np.random.Generator) -> Iterator[tuple[PressedFrame, PressedFrame]]:
    """For every press the reading through the parallel window, and through a window that is tilted by 1 degree."""
    views = ViewExtractor(parse_layout(layout_to_json(found.layout)), found.rig(found.medium))
    windows = (found.cameras, found.tilted(float(rng.uniform(0, 2 * np.pi)), np.radians(1.0)))
    half_mm = float(np.abs(found.layout.marker_xy_mm).max())
    scene = replace(standard_scene(found.layout), medium=found.medium)
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
            readings.append(PressedFrame(press_mm, rest, views.extract(drawn.image), drawn.truth))
        yield readings[0], readings[1]


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(1 << 31))
