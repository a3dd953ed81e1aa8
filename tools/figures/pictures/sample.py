"""The sample of the pictures: the template tac3d, at rest and pressed, rendered and extracted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Camera, Gradient, Optics, Press, Scene, Sensor, Shear, composed, render
from extractor import Extractor, Markers, Reference, parse_layout

SIZE = (640, 480)
CAMERA = Camera(pitch_px=21.0, rotation_deg=9.0, tilt_deg=12.0, tilt_axis_deg=25.0)
# A press with shear beside the centre.
CONTACT = composed(Press(4.5, 1.0, (-2.5, 1.5)), Shear(5.0, (0.55, -0.35), (-2.5, 1.5)))
BEHIND = Gradient((150.0, 150.0, 152.0), (96.0, 97.0, 100.0), 60.0)


@dataclass(frozen=True, eq=False)
class Sample:
    """One layout, two images (H, W, 3) uint8 BGR, and the markers in them."""

    layout: Layout
    reference: Reference
    rest_image: NDArray[np.uint8]
    pressed_image: NDArray[np.uint8]
    rest: Markers
    pressed: Markers


@cache
def sample() -> Sample:
    """The sample, made once."""
    layout = build_layout(load_design("tac3d"))
    reference = parse_layout(layout_to_json(layout))
    extractor = Extractor(reference)
    rest = Scene(layout, CAMERA, background=BEHIND, optics=Optics(1.0), sensor=Sensor(noise=2.0), seed=4)
    pressed = replace(rest, surface=CONTACT, seed=5)
    images = [render(scene, size=SIZE).image.astype(np.uint8) for scene in (rest, pressed)]
    markers = [extractor.extract(image) for image in images]
    return Sample(layout, reference, *images, *markers)
