"""The part of docs/explanation/hard-cases.md on path-traced pictures, and its sheet of pictures.

Both are made from docs/measured/photoreal.json and the pictures alone, so that they can be made again without reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.photoreal.pictures import PICTURES_FOLDER, TracedPicture, load_pictures
from benchmarks.support.published import MEASURED_FOLDER, ROOT, read_measured, write_published
from cmpdesign.files.atomic import write_file

NAME = "photoreal"
IMAGE = "photoreal.jpg"
TILE_PX, CAPTION_PX, COLUMNS, QUALITY = (208, 156), 32, 5, 72
DOT_PX = 2  # radius
UNMEASURED_BGR, PAPER_BGR, TEXT_BGR = (0, 220, 255), (255, 255, 255), (54, 47, 43)


def publish(measured: Mapping[str, Any]) -> list[Path]:
    """Write docs/measured/photoreal.json, the sheet, and its part of the page. Returns the written files."""
    written = write_published(NAME, measured, documentation_blocks(measured))
    image = ROOT / "docs" / "images" / IMAGE
    write_file(image, pictures_sheet(measured))
    return [*written, image]


def documentation_blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """The block of the page from the content of docs/measured/photoreal.json."""
    return {
        NAME: (
            f"Written by `python -m benchmarks.photoreal --publish`.\n\n"
            f"![Path-traced pictures](../images/{IMAGE})\n\n"
            "Below each picture: its effects, and the measured markers of the visible ones, or the reason. Yellow: "
            "visible markers that are not measured.\n\n"
            f"```text\n{measured['table']}\n```"
        )
    }


def page_pictures() -> dict[str, bytes]:
    """Name in docs/images -> JPEG, from docs/measured/photoreal.json; empty as long as there is no such file."""
    if not (MEASURED_FOLDER / f"{NAME}.json").exists():
        return {}
    return {IMAGE: pictures_sheet(read_measured(NAME))}


def pictures_sheet(measured: Mapping[str, Any]) -> bytes:
    """JPEG of a sheet: the pictures, the markers that are not measured, and the result of each."""
    by_name = {picture.name: picture for picture in load_pictures(PICTURES_FOLDER)}
    tiles = [_tile(by_name[entry["name"]], entry) for entry in measured["pictures"]]
    tiles += [np.full_like(tiles[0], PAPER_BGR[0])] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[first : first + COLUMNS]) for first in range(0, len(tiles), COLUMNS)]
    return bytes(cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])


def _tile(picture: TracedPicture, entry: Mapping[str, Any]) -> NDArray[np.uint8]:
    image, width = picture.image, picture.image.shape[1]
    tile = np.full((TILE_PX[1] + CAPTION_PX, TILE_PX[0], 3), PAPER_BGR, dtype=np.uint8)
    tile[: TILE_PX[1]] = cv2.resize(image, TILE_PX, interpolation=cv2.INTER_AREA)
    scale = TILE_PX[0] / width
    lost = entry["unmeasured"] if entry["measured"] else []
    for x, y in picture.truth.xy_px[lost].reshape(-1, 2) * scale + 0.5 * (scale - 1):
        cv2.circle(tile, (round(16 * x), round(16 * y)), 16 * DOT_PX, UNMEASURED_BGR, -1, cv2.LINE_AA, 4)
    counts = f"{entry['measured']} of {entry['visible']}" if entry["visible"] else "no pattern"
    effects = ", ".join(picture.effects)
    more = f"{effects[:26]}..." if len(effects) > 29 else effects
    for line, text in enumerate((f"{picture.family}: {more}", entry["reason"] or counts)):
        place = (3, TILE_PX[1] + 12 + 14 * line)
        cv2.putText(tile, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.36, TEXT_BGR, 1, cv2.LINE_AA)
    return tile
