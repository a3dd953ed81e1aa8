"""A new sensor file, commented: the views of calibrated cameras, and what the user measures with calipers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cmpdesign.sensor.sensor_file import SensorFile
from cmpdesign.sensor.tables import SensorError
from cmpdesign.sensor.toml_text import toml_table, toml_value, view_table
from extractor import View

REMAINDER = """\
# Between pattern and camera: what calipers and data sheets say, in mm, and how well they say it (standard deviations).
# Without a window and a gel leave both tables out. [medium] gel_mm: from the pattern to the window.
# [medium]
# gel_mm = 4.0
# gel_index = 1.41             # silicone; acrylic 1.49, glass 1.52
# window_mm = 2.0
# window_index = 1.49
# [medium_deviation]
# gel_mm = 0.1                 # as cast
# gel_index = 0.005            # of a data sheet
# window_mm = 0.02             # calipers

# The camera, and what its driver is asked for; `cmpdesign cameras` lists both. What is absent stays as it is.
# [camera]
# source = "0"
# fps = 30.0
# format = "MJPG"
# exposure_ms = 8.0
# gain = 0.0
# white_balance_k = 4600.0
# focus = 0.0

# What is accepted of the running sensor.
# [limits]
# max_age_ms = 100.0           # of a result
# max_rest_error_px = 0.1      # RMS of the markers at rest; without it by their deviations
# min_share_read = 0.9         # of the markers in view

# The elastic layer, for the touched surface (reconstruct --surface) and for forces (--contact).
# [elastomer]
# thickness_mm = 5.0
# marker_depth_mm = 0.5        # of the pattern below the touched surface
# poisson = 0.5
# young_mpa = 0.3              # from `cmpdesign calibrate force`, with young_sigma_mpa
# gel = "gel.npz"              # from `cmpdesign calibrate gel`
"""


def sensor_text(name: str, layout: str, cameras: Sequence[SensorFile]) -> str:
    """The text of a sensor file.

    Args:
        name: the sensor's.
        layout: name of the pad's layout file, relative to the sensor file.
        cameras: the camera file of each view; the same one twice: two mirrors side by side before one camera.

    Raises:
        SensorError: cameras of different sizes, or several calibrations.
    """
    first = cameras[0]
    for one in cameras[1:]:
        if one.table.size_px != first.table.size_px:
            raise SensorError(
                f"{one.path}: size_px is {one.table.size_px}, of {first.path} {first.table.size_px}; all views need "
                "pictures of one size"
            )
    size = first.table.size_px
    top = {
        "format": "cmp-sensor",
        "version": 1,
        "name": name,
        "layout": layout,
        "size_px": size,
        "response": first.table.response,
    }
    lines = [f"{key} = {toml_value(value)}" for key, value in top.items() if value is not None]
    parts = ["\n".join(lines) + "\n", *map(view_table, _views(cameras)), REMAINDER]
    calibration = first.table.calibration.camera
    if calibration is not None and len({one.path for one in cameras}) == 1:
        parts.append(toml_table("[calibration.camera]", calibration.model_dump()))
    return "\n".join(parts)


def _views(cameras: Sequence[SensorFile]) -> list[View]:
    views = [one.rig.views[0] for one in cameras]
    if len(views) == 1:
        return views
    names = ("left", "right") if len(views) == 2 else tuple(f"view{number}" for number in range(len(views)))
    named = [replace(view, name=name) for view, name in zip(views, names, strict=True)]
    size = cameras[0].table.size_px
    if len({one.path for one in cameras}) > 1 or size is None:
        return named
    width = size[0] // len(named)
    return [
        replace(view, area_px=(number * width, 0, width, size[1]), mirrored=True)
        for number, view in enumerate(named)
    ]


def relative_name(path: Path, folder: Path) -> str:
    """The name of a file in a file of this folder."""
    import os

    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
