"""A sensor small and coarse enough for tests: half the pixels, a third of the markers, a coarse contact grid."""

from __future__ import annotations

from functools import cache

from cmpdesign.evaluation.simulated.sensor import load_sensor

CHANGES = (
    ("size_px = [1280, 720]", "size_px = [640, 360]"),
    ("focal_px = [1000.0, 1000.0]", "focal_px = [900.0, 900.0]"),
    ("centre_px = [639.5, 359.5]", "centre_px = [319.5, 179.5]"),
    ("area_px = [0, 0, 640, 720]", "area_px = [0, 0, 320, 360]"),
    ("area_px = [640, 0, 640, 720]", "area_px = [320, 0, 320, 360]"),
    ("t_camera_from_layout_mm = [-18.2865436262,", "t_camera_from_layout_mm = [-10.157,"),
    ("t_camera_from_layout_mm = [18.2865436262,", "t_camera_from_layout_mm = [10.157,"),
    ("layers = 9", "layers = 5"),
    ("clip_width_mm = 30.5", "clip_width_mm = 18.5"),
    ("clip_height_mm = 30.5", "clip_height_mm = 18.5"),
    ("grid = 256", "grid = 64"),
    ("steps = 8", "steps = 2"),
)


@cache
def small_sensor_text() -> str:
    """The shipped sensor's file with these changes."""
    text = load_sensor("tac3d").text
    for old, new in CHANGES:
        assert old in text, old
        text = text.replace(old, new)
    return text
