"""The part of docs/explanation/hard-cases.md on path-traced pictures, and its sheet of pictures.

Both are made from docs/measured/photoreal.json and the pictures alone, so that they can be made again without reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2

from benchmarks.frame.published import Page
from benchmarks.frame.sheet import TILE_PX, Tile, draw_dots, draw_sheet
from benchmarks.suites.photoreal.pictures import PICTURES_FOLDER, TracedPicture, load_pictures

IMAGE = "photoreal.jpg"
UNMEASURED_BGR = (0, 220, 255)


def page(measured: Mapping[str, Any]) -> Page:
    """The block and the sheet from the content of docs/measured/photoreal.json."""
    text = (
        f"Written by `python -m benchmarks.photoreal --publish`.\n\n"
        f"![Path-traced pictures](../images/{IMAGE})\n\n"
        "Below each picture: its effects, and the measured markers of the visible ones, or the reason. Yellow: "
        "visible markers that are not measured.\n\n"
        f"```text\n{measured['table']}\n```"
    )
    by_name = {picture.name: picture for picture in load_pictures(PICTURES_FOLDER)}
    tiles = [_tile(by_name[entry["name"]], entry) for entry in measured["pictures"]]
    return Page({"photoreal": text}, {IMAGE: draw_sheet(tiles, columns=5, lines=2, text_scale=0.36)})


def _tile(picture: TracedPicture, entry: Mapping[str, Any]) -> Tile:
    image = cv2.resize(picture.image, TILE_PX, interpolation=cv2.INTER_AREA)
    scale = TILE_PX[0] / picture.image.shape[1]
    lost = [*entry["unmeasured"]] if entry["measured"] else []
    draw_dots(image, picture.truth.xy_px[lost].reshape(-1, 2) * scale + 0.5 * (scale - 1), UNMEASURED_BGR)
    counts = f"{entry['measured']} of {entry['visible']}" if entry["visible"] else "no pattern"
    effects = ", ".join(picture.effects)
    more = f"{effects[:26]}..." if len(effects) > 29 else effects
    return Tile(image, (f"{picture.family}: {more}", entry["reason"] or counts))
