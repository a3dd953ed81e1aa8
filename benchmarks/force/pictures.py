"""``python -m benchmarks.force.pictures``: the whole chain, from pictures of two views to forces.

The finite-element frames move the pattern; two cameras see it through window and gel; the pictures are read and the
surface is reconstructed as a user does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from benchmarks.force.__main__ import COLUMNS, MIN_N, Errors, errors_of, reader_of, row_of, summary
from benchmarks.force.truth import DEPTHS_MM, TRUTH, Case, cases
from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import Table
from benchmarks.frame.timing import timed
from benchmarks.suites.halves import two_cameras
from benchmarks.suites.medium.rigs import RandomRig
from cmpdesign import build_layout
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Medium, Scene, render, standard_scene
from extractor import Markers, Reconstructor, ViewExtractor, parse_layout

Array = NDArray[np.float64]
SIZE = (1640, 720)
DISTANCE_MM, TILT_DEG, FIELD_DEG = 60.0, 18.0, 40.0
DEPTH_MM, WINDOW_MM = 0.5, 3.0


class Seeing(NamedTuple):
    """A sensor: its cameras and medium, the scene at rest, the reader of views, and the rest frame."""

    rig: RandomRig
    scene: Scene
    views: ViewExtractor
    rest: tuple[Markers, ...]


def sensor_of(thickness_mm: float) -> Seeing:
    """Two cameras below the pad of the truth; noise 2 of 255, blur 1 px."""
    layout = build_layout(load_design("honeycomb", {"mirrored": "true"}))
    medium = Medium(thickness_mm - DEPTH_MM, 1.41, WINDOW_MM, 1.49)
    cameras = two_cameras(SIZE, distance_mm=DISTANCE_MM, field_of_view_deg=FIELD_DEG, tilt_deg=TILT_DEG)
    rig = RandomRig(medium, layout, cameras)
    views = ViewExtractor(parse_layout(layout_to_json(layout)), rig.rig(medium))
    scene = replace(standard_scene(layout), camera=cameras, medium=medium)
    return Seeing(rig, scene, views, views.extract(render(scene, size=SIZE).image))


def moved_surface(xy_mm: Array, displacement_mm: Array) -> Callable[[Array], Array]:
    """(N, 2) -> (N, 3) mm: the markers (M, 2) move by the displacement (M, 3), smooth between them, still far away."""
    reach = 3 * np.abs(xy_mm).max()
    far = reach * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 1], [0, -1], [1, 0], [-1, 0]])
    moved = np.concatenate([displacement_mm, np.zeros((len(far), 3))])
    field = CloughTocher2DInterpolator(np.concatenate([xy_mm, far]), moved)

    def surface(points: Array) -> Array:
        return np.asarray(np.pad(points, [(0, 0), (0, 1)]) + field(points))

    return surface


def read_frames(case: Case, frames: list[dict[str, Array]], seed: int) -> Iterator[Errors]:
    """The frames of a contact, from pictures."""
    seeing = sensor_of(case.thickness_mm)
    reader = reader_of(case.thickness_mm, case.poisson, DEPTH_MM, mirrored=True)
    reader.reset()
    reconstructor = Reconstructor(reader.layout, seeing.rig.rig(seeing.rig.medium), seeing.rest)
    for k, frame in enumerate(frames):
        displacement = frame["displacement_mm"][DEPTHS_MM.index(DEPTH_MM)].astype(np.float64)
        surface = moved_surface(reader.layout.xy_mm, displacement)
        image = render(replace(seeing.scene, surface=surface, seed=seed + k), size=SIZE).image
        shape = reconstructor.reconstruct(seeing.views.extract(image))
        cold, warm = (timed(partial(reader.read_shape, shape)) for _ in range(2))
        yield errors_of(warm.result, frame, case.name, (cold.cpu_ms, warm.cpu_ms))


def measure(only: tuple[str, ...] = (), seed: int = 1) -> Shown:
    """One row for every frame, and the summary of the frames above 0.3 N.

    Args:
        only: names of contacts; all by default.
    """
    with np.load(TRUTH) as file:
        truth = dict(file)
    found: list[Errors] = []
    for case in cases():
        mine = np.flatnonzero(truth["case"] == case.name)
        if len(mine) and (not only or case.name in only):
            frames = [{key: values[k] for key, values in truth.items()} for k in mine]
            found += read_frames(case, frames, 1000 * seed + len(found))
    yield Table("frames", COLUMNS, [row_of(one) for one in found])
    yield summary([one for one in found if one.press_n > MIN_N])


main = Experiment("force.pictures", measure)
main.run_as(__name__)
