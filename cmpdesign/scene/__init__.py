"""Scenes: rendered images of a pattern with exact ground truth, for tests and for the evaluation of designs.

In: layout, surface, camera, light, optics, sensor, damage. Out: an image and its truth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cmpdesign.scene.bounds.gridline_bound import cramer_rao
from cmpdesign.scene.camera.medium import Medium, WindowPlane
from cmpdesign.scene.camera.pinhole import Pinhole
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.drawing.render import Rendered, render
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.background import Busy, Gradient, Paper, Picture, Plain
from cmpdesign.scene.parts.damage import Blob, Damage, Glare, Scratch
from cmpdesign.scene.parts.light import Led, Light, colored_leds
from cmpdesign.scene.parts.optics import Optics
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.parts.surface import Dent, Press, Shear, Surface, Twist, composed
from cmpdesign.scene.scene import Scene
from cmpdesign.scene.standard import STANDARD_SIZE, standard_layout, standard_scene
from cmpdesign.scene.truth import Truth, load_truth, load_truths, save_truth, save_truths

if TYPE_CHECKING:
    from cmpdesign.scene.files.scene_file import SceneFile as SceneFile
    from cmpdesign.scene.files.scene_file import load_scene as load_scene


__all__ = [
    "STANDARD_SIZE",
    "Blob",
    "Busy",
    "Camera",
    "Damage",
    "Dent",
    "Glare",
    "Gradient",
    "Led",
    "Light",
    "Medium",
    "Optics",
    "Paper",
    "Picture",
    "Pinhole",
    "Plain",
    "Press",
    "Rendered",
    "Scene",
    "SceneError",
    "SceneFile",
    "Scratch",
    "Sensor",
    "Shear",
    "Surface",
    "Truth",
    "Twist",
    "WindowPlane",
    "colored_leds",
    "composed",
    "cramer_rao",
    "load_scene",
    "load_truth",
    "load_truths",
    "render",
    "save_truth",
    "save_truths",
    "standard_layout",
    "standard_scene",
]


def __getattr__(name: str) -> Any:
    """Load scene files at their first use: they need pydantic, scenes made in Python do not."""
    if name not in ("SceneFile", "load_scene"):
        raise AttributeError(f"module 'cmpdesign.scene' has no attribute {name!r}")
    from cmpdesign.scene.files import scene_file

    return getattr(scene_file, name)
