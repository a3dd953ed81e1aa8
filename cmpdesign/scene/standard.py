"""The standard scene: the conditions of stated figures of accuracy and speed."""

from __future__ import annotations

from cmpdesign.layout.layout import Layout
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.parts.background import Plain
from cmpdesign.scene.parts.optics import Optics
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.scene import Scene

BLACK_RGB = (20.0, 20.0, 20.0)
INKS = {
    "red": (200.0, 50.0, 45.0),
    "green": (40.0, 150.0, 60.0),
    "blue": (45.0, 60.0, 190.0),
    "black": BLACK_RGB,
    "white": (245.0, 245.0, 245.0),
}
STANDARD_SIZE = (640, 480)
STANDARD_LAYERS = 11


def standard_layout(pattern: str = "honeycomb", layers: int = STANDARD_LAYERS, code: int = 0) -> Layout:
    """The pattern of the standard scene, plain or with a code."""
    from cmpdesign.design.design import load_design
    from cmpdesign.layout.build import build_layout

    return build_layout(load_design(pattern, {"layers": str(layers), "pitch_mm": "1.0", "code": str(code)}))


def standard_scene(layout: Layout | None = None, *, seed: int = 0) -> Scene:
    """Pitch 20 px, rotation 7.3 degrees, blur 1 px, noise 2/255, black background; for images of ``STANDARD_SIZE``.

    The standard layout is larger than that image: only the truth's visible markers count.
    """
    return Scene(
        layout=layout if layout is not None else standard_layout(),
        camera=Camera(pitch_px=20.0, rotation_deg=7.3),
        background=Plain(BLACK_RGB),
        optics=Optics(blur_px=1.0),
        sensor=Sensor(noise=2.0),
        inks=INKS,
        seed=seed,
    )
