"""Moving patterns for the tests and the benchmark of tracking: the content of each frame, and the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene import (
    Camera,
    Optics,
    Plain,
    Press,
    Rendered,
    Scene,
    Sensor,
    Shear,
    Twist,
    composed,
    render,
)
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Reference, parse_layout
from tests.support.layouts import small_layout, small_text

LAYERS = 5
SIZE = (320, 240)
PITCH_PX = 19.0
PITCH_MM = 1.5


@cache
def reference(pattern: str = "honeycomb", layers: int = LAYERS) -> Reference:
    return parse_layout(small_text(pattern, layers))


def scene(pattern: str = "honeycomb", layers: int = LAYERS, **changes: Any) -> Scene:
    """At rest; the keywords change the scene's or the camera's fields."""
    camera = Camera(pitch_px=PITCH_PX, rotation_deg=7.3)
    on_camera = {name: changes.pop(name) for name in list(changes) if hasattr(camera, name)}
    base = Scene(
        layout=small_layout(pattern, layers),
        camera=replace(camera, **on_camera),
        background=Plain(BLACK_RGB),
        optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
        inks=INKS,
    )
    return replace(base, **changes)


def shot(pattern: str = "honeycomb", **changes: Any) -> Rendered:
    return render(scene(pattern, **changes), size=SIZE)


def moving(count: int, pattern: str = "honeycomb", speed: float = 1.0) -> Iterator[Rendered]:
    """A pattern that is pressed, twisted, dragged and carried about at once; frame 0 is at rest."""
    for index in range(count):
        turn = 2 * np.pi * speed * index / 60
        push = 0.5 - 0.5 * np.cos(turn)
        surface = composed(
            Press(4.0, 0.6 * push),
            Twist(5.0, 14 * np.sin(turn)),
            Shear(5.0, (0.5 * np.sin(2 * turn), 0.3 * push)),
        )
        centre = (
            (SIZE[0] - 1) / 2 + 12 * np.sin(0.7 * turn),
            (SIZE[1] - 1) / 2 + 8 * (1 - np.cos(1.3 * turn)) / 2,
        )
        yield shot(
            pattern, surface=surface, centre_px=centre, rotation_deg=7.3 + 6 * np.sin(turn), seed=index
        )


def errors(xy_px: NDArray[np.float64], rendered: Rendered) -> NDArray[np.float64]:
    """Distances from the truth in px, of the markers that were found."""
    away = np.linalg.norm(xy_px - rendered.truth.marker_xy_px, axis=1)
    return np.asarray(away[np.isfinite(away)])
