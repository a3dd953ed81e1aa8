"""Views of coded pads without the reference cell, covered, cropped and scratched, and four pads of a family."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Blob, Camera, Damage, Gradient, Optics, Scene, Scratch, Sensor, render
from extractor import Extractor, parse_layout
from extractor.draw import draw_markers

Picture = NDArray[np.uint8]
RGB = tuple[float, float, float]
CODE, FAMILY = 7, (1, 2, 3, 4)
SIZE_PX, WIDTH_PX, QUALITY = (320, 240), 520, 75
SKIN: RGB = (196.0, 150.0, 128.0)
METAL: RGB = (120.0, 122.0, 126.0)
SCRATCHES = (((-14.0, -9.0), (13.0, 12.0)), ((-13.0, 8.0), (14.0, -6.0)), ((-2.0, 14.0), (3.0, -14.0)))


@cache
def pad(code: int) -> Layout:
    """tac3d with a code, or plain."""
    return build_layout(load_design("tac3d", {"code": str(code)}))


def views(code: int) -> dict[str, Picture]:
    """Name -> picture of the pad; the reference cell is not seen in any."""
    layout = pad(code)
    middle = Blob((0.0, 0.8), 2.0, SKIN)
    finger = tuple(Blob((-2.0 + 0.9 * k, -2.5 + 0.9 * k), 3.6, SKIN) for k in range(-12, 4))
    scratches = tuple(Scratch(start, end, 0.7, METAL) for start, end in SCRATCHES)
    whole, near = Camera(17.0, 8.0, 10.0, 30.0), Camera(24.0, 68.0, 8.0, 30.0, centre_px=(350.0, 130.0))
    return {
        "covered": _shot(layout, whole, Damage(blobs=finger)),
        "cropped": _shot(layout, near, None),
        "scratched": _shot(layout, whole, Damage(blobs=(middle,), scratches=scratches)),
    }


def _shot(layout: Layout, camera: Camera, damage: Damage | None) -> Picture:
    ground = Gradient((150.0, 150.0, 152.0), (96.0, 97.0, 100.0), 60.0)
    scene = Scene(
        layout, camera, background=ground, optics=Optics(0.7), sensor=Sensor(noise=1.0), damage=damage
    )
    return render(scene, size=SIZE_PX).image


def figures() -> dict[str, bytes]:
    """File name -> JPEG."""
    reader = Extractor(parse_layout(layout_to_json(pad(CODE))))
    drawn = {
        name: draw_markers(image, reader.layout, reader.extract(image)) for name, image in views(CODE).items()
    }
    return {f"coded-{name}.jpg": _jpeg(picture) for name, picture in {**drawn, "family": family()}.items()}


def family() -> Picture:
    """Half of each of four pads, with the code that one reader of all four finds."""
    reader = Extractor([parse_layout(layout_to_json(pad(code))) for code in FAMILY])
    tiles = []
    for number, code in enumerate(FAMILY):
        camera = Camera(9.5, 40.0 * number, 10.0, 30.0, centre_px=(310.0, 130.0))
        image = _shot(pad(code), camera, None)
        tile = np.ascontiguousarray(cv2.resize(image, None, fx=2, fy=2))
        text = f"Markers.code = {reader.extract(image).code}"
        cv2.putText(tile, text, (16, 40), cv2.FONT_HERSHEY_SIMPLEX, 1.0, (255, 255, 255), 2, cv2.LINE_AA)
        tiles.append(tile)
    return np.asarray(np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])]), np.uint8)


def _jpeg(picture: Picture) -> bytes:
    height = round(WIDTH_PX * picture.shape[0] / picture.shape[1])
    small = cv2.resize(picture, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])
