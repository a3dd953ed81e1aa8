"""The sensor's last frame, and the displacement that is reconstructed from it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from benchmarks.frame.plots import png_of, pyplot
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.scene import load_scene
from extractor import Reconstructor, Reference, Shape, ViewExtractor, load_rig, parse_layout

from .page_files import Picture, page_file, resized, scene_picture, to_jpeg, to_small_png

DOTS_PER_INCH = 100
FRAME_PX = (480, 270)


def figures(page: str) -> dict[str, bytes]:
    """File name -> JPEG or PNG."""
    layout = build_layout(load_design("tac3d", {"layers": "7"}))
    reference = parse_layout(layout_to_json(layout))
    with TemporaryDirectory() as folder:
        for name in ("press.toml", "rig.toml"):
            (Path(folder) / name).write_text(page_file(page, name), encoding="utf-8")
        scene_file = load_scene(Path(folder) / "press.toml", layout)
        scenes = list(scene_file.scenes())
        views = ViewExtractor(reference, load_rig(Path(folder) / "rig.toml"))
    rest, last = (scene_picture(scene, scene_file.size_px) for scene in (scenes[0], scenes[-1]))
    reconstructor = Reconstructor(views.layout, views.rig, views.extract(rest))
    shape = reconstructor.reconstruct(views.extract(last))
    return {
        "tutorial-sensor.jpg": to_jpeg(resized(last, FRAME_PX)),
        "tutorial-displacement.png": to_small_png(_arrows(reference, shape)),
    }


def _arrows(reference: Reference, shape: Shape) -> Picture:
    """Arrows along the pattern, five times as long as they are, on colors of the depth."""
    plt = pyplot()

    x, y = reference.xy_mm.T
    dx, dy, dz = shape.displacement_mm.T
    with plt.rc_context({"font.family": "DejaVu Sans", "font.size": 8}):
        figure, axes = plt.subplots(figsize=(4.8, 3.4), dpi=DOTS_PER_INCH)
        colors = axes.tricontourf(
            x, y, dz, levels=np.arange(-0.34, 0.07, 0.04), cmap="viridis", extend="both"
        )
        axes.quiver(x, y, dx, dy, angles="xy", scale_units="xy", scale=0.2, width=0.004, color="black")
        axes.set(aspect="equal", xlabel="x, mm", ylabel="y, mm")
        figure.colorbar(colors, ax=axes, label="displacement in z, mm")
        figure.tight_layout(pad=0.4)
        file = png_of(figure)
    return np.asarray(cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR), np.uint8)
