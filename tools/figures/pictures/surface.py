"""A reconstructed surface: the image of two views of a pressed ball, and the reconstruction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.plots import png_of, pyplot
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Scene, load_scene, render
from extractor import Reconstructor, Shape, ViewExtractor, load_rig, parse_layout

RIG = Path(__file__).parents[3] / "templates" / "scenes" / "tac3d-binocular.toml"
STEP_MM = 0.2


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    plt = pyplot()

    layout = build_layout(load_design("tac3d"))
    found = load_scene(RIG, layout)
    surface = solve(
        Elastomer(6.0, 0.2), Ball(radius_mm=20.0, centre_mm=(2.0, 1.0)), Motion(0.6, (0.4, 0.2))
    ).surface()
    like = found.scene()
    scene = Scene(layout, like.camera, surface, optics=like.optics, sensor=like.sensor, medium=like.medium)
    image = render(scene, size=found.size_px).image
    rest = render(replace(scene, surface=None, seed=1), size=found.size_px).image
    views = ViewExtractor(parse_layout(layout_to_json(layout)), load_rig(RIG).without_poses())
    reconstructor = Reconstructor(views.layout, views.rig, views.extract(rest))
    shape = reconstructor.reconstruct(views.extract(image))

    figure, axes = plt.subplots(2, 1, figsize=(8, 8.2), height_ratios=(1, 1.8))
    axes[0].imshow(cv2.cvtColor(image[150:570], cv2.COLOR_BGR2RGB))
    axes[0].set_axis_off()
    _map(figure, axes[1], layout, reconstructor, shape)
    figure.tight_layout()
    file = png_of(figure)
    return {"reconstruction.png": _packed(file)}


def _map(figure: Any, axis: Any, layout: Layout, reconstructor: Reconstructor, shape: Shape) -> None:
    """Height by color, at and between the markers; in-plane displacement of the markers by arrows."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    x, y = np.meshgrid(*(np.arange(low[k], high[k], STEP_MM) for k in (0, 1)))
    grid = np.column_stack([x.ravel(), y.ravel()])
    dense = reconstructor.field.at(shape.displacement_mm, grid).reshape(*x.shape, 3)
    shown = axis.pcolormesh(x, y, dense[..., 2], cmap="viridis", shading="nearest", rasterized=True)
    axis.contour(x, y, dense[..., 2], levels=np.arange(-0.55, 0.0, 0.1), colors="white", linewidths=0.5)
    moved = shape.displacement_mm
    axis.quiver(
        *layout.marker_xy_mm.T, *moved[:, :2].T, angles="xy", scale_units="xy", scale=0.25, width=0.0016
    )
    axis.set(
        xlabel="x, mm",
        ylabel="y, mm",
        aspect="equal",
        title="displacement: z by color, x and y by arrows (4 : 1)",
    )
    figure.colorbar(shown, ax=axis, label="dz, mm")


def _packed(png: bytes) -> bytes:
    """Colors in steps of 8, as in the other pictures."""
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    stepped: NDArray[np.uint8] = (np.asarray(pixels) // 8 * 8 + 4).astype(np.uint8)
    return bytes(cv2.imencode(".png", stepped, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
