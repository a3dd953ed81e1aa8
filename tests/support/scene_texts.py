"""Scene files as tests write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cmpdesign.layout.layout import Layout
from cmpdesign.scene import SceneFile, load_scene

SIZE = (96, 80)
MOVING = """
size_px = [96, 80]
[camera]
pitch_px = 16
[surface.dent]
radius_mm = 1.5
depth_mm = 0
[sensor]
noise = 3
[damage]
missing_share = 0.3
[sequence]
frames = 5
fps = 4
[sequence.values]
surface.dent.depth_mm = [[0.25, 0.0], [0.75, 1.0]]
surface.dent.centre_mm = [[0.0, [0, 0]], [1.0, [1, 2]]]
"""


def scene_writer(folder: Path, layout: Layout) -> Callable[..., SceneFile]:
    """Writes a text into the folder and loads it."""

    def write(text: str, **options: object) -> SceneFile:
        path = folder / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path, layout, **options)  # type: ignore[arg-type]

    return write
