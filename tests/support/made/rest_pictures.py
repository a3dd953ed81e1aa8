"""A small pad whose markers are scattered, and its pictures at rest: made once for several test files."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cmpdesign.files.images import to_png
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    Camera,
    Rendered,
    Scene,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.parts.surface import Deformation
from extractor import LearntLayout, Reference, learn_layout, parse_layout

LAYERS, PITCH_PX, SIZE = 6, 17.0, (256, 240)
SCATTER_PX = 0.2
PICTURES = 10


@cache
def nominal_layout() -> Layout:
    return standard_layout("honeycomb", LAYERS)


@cache
def made_layout() -> Layout:
    """The layout with markers scattered by ``SCATTER_PX`` per axis."""
    nominal = nominal_layout()
    scatter_mm = SCATTER_PX / PITCH_PX  # the pitch is 1 mm
    moved = np.random.default_rng(20261).normal(0, scatter_mm, nominal.marker_xy_mm.shape)
    return replace(nominal, marker_xy_mm=nominal.marker_xy_mm + moved)


def reference(layout: Layout) -> Reference:
    return parse_layout(layout_to_json(layout))


def pad_scene(number: int, *surface: Deformation) -> Scene:
    """The made pad, in a different pose for every number."""
    rng = np.random.default_rng([20262, number])
    turn, tilt, axis = rng.uniform(0, 360), rng.uniform(0, 20), rng.uniform(0, 360)
    camera = Camera(PITCH_PX, float(turn), float(tilt), float(axis))
    scene = replace(standard_scene(made_layout(), seed=number), camera=camera)
    return replace(scene, surface=composed(*surface)) if surface else scene


def pad_picture(number: int, *surface: Deformation) -> Rendered:
    return render(pad_scene(number, *surface), size=SIZE)


@cache
def rest_images() -> tuple[NDArray[np.uint8], ...]:
    return tuple(pad_picture(number).image for number in range(PICTURES))


@cache
def learnt() -> LearntLayout:
    return learn_layout(reference(nominal_layout()), rest_images())


def write_rest_images(folder: Path) -> None:
    folder.mkdir()
    for number, image in enumerate(rest_images()):
        (folder / f"{number}.png").write_bytes(to_png(image))
