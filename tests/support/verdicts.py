"""Pictures and claimed markers to be judged: a small honeycomb."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene import Camera, Light, Optics, Rendered, Scene, Sensor, colored_leds, render
from extractor import Markers, Reason, Reference, parse_layout
from tests.support.layouts import small_layout, small_text

LAYERS = 4


@cache
def reference() -> Reference:
    return parse_layout(small_text("honeycomb", LAYERS))


@cache
def picture(pitch_px: float = 24, light: str = "none", noise: float = 2, mirrored: bool = False) -> Rendered:
    lights = {"none": None, "warm": Light(rgb=(1.0, 0.7, 0.5)), "leds": colored_leds()}
    scene = Scene(
        small_layout("honeycomb", LAYERS),
        camera=Camera(pitch_px, 33, 20, mirrored=mirrored),
        light=lights[light],
        optics=Optics(1.2),
        sensor=Sensor(noise=noise),
    )
    return render(scene, size=(320, 240))


def markers_at(
    xy_px: NDArray[np.float64], mirrored: bool | None = False, reason: Reason | None = None
) -> Markers:
    """A result that claims these places."""
    count, edges = len(xy_px), len(reference().edges)
    return Markers(
        xy_px=xy_px,
        cov_px2=np.full((count, 2, 2), np.nan),
        status=np.isfinite(xy_px).all(axis=1).astype(np.uint8),
        virtual_xy_px=np.full((edges, 5, 2), np.nan),
        virtual_cov_px2=np.full((edges, 5, 2, 2), np.nan),
        virtual_status=np.zeros((edges, 5), np.uint8),
        mirrored=mirrored,
        reason=reason,
        timings_ms={},
    )
