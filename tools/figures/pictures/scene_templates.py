"""One picture of all scene templates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.design.templates import scene_templates
from cmpdesign.layout.build import build_layout
from cmpdesign.scene import Scene, load_scene, render

ORDER = ("flat-print", "pressed-ball", "tac3d-binocular", "press-and-twist")
TILE_PX = (400, 300)
GAP_PX = 8
STEP = 8  # of the colors, which compresses better as PNG


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    from cmpdesign.files.images import to_png

    tiles = dict(_tiles())
    rows = [np.hstack([_framed(tiles[name]) for name in pair]) for pair in (ORDER[:2], ORDER[2:])]
    return {"scenes.png": to_png(np.vstack(rows) // STEP * STEP)}


def _tiles() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    layout = build_layout(load_design("tac3d"))
    for name in ORDER:
        scene_file = load_scene(scene_templates()[name], layout)
        *_, last_scene = scene_file.scenes()
        picture = render(_quiet(last_scene), size=scene_file.size_px).image
        yield name, _scaled(picture.astype(np.uint8))


def _quiet(scene: Scene) -> Scene:
    """The scene without noise, which would need a large file."""
    return replace(scene, sensor=None)


def _scaled(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture in the middle of a tile, as large as fits."""
    import cv2

    height, width = picture.shape[:2]
    factor = min(TILE_PX[0] / width, TILE_PX[1] / height)
    small = cv2.resize(picture, (round(width * factor), round(height * factor)), interpolation=cv2.INTER_AREA)
    tile = np.zeros((TILE_PX[1], TILE_PX[0], 3), np.uint8)
    top, left = (TILE_PX[1] - small.shape[0]) // 2, (TILE_PX[0] - small.shape[1]) // 2
    tile[top : top + small.shape[0], left : left + small.shape[1]] = small
    return tile


def _framed(tile: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.pad(tile, ((0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=255)
