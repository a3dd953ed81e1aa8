"""The part of docs/explanation/hard-cases.md on the camera suite, with the pictures that fail.

The page is made from docs/measured/camera.json alone: its pictures are made again from their seed, and the reader's
results are stored in the file. The page can therefore be drawn again without reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.published import Page
from benchmarks.frame.sheet import TILE_PX, Tile, draw_dots, draw_sheet
from benchmarks.suites.camera.cases import COMBINED, KINDS, CameraCase, sample_chain
from benchmarks.suites.camera.reading import LOST, UNSEEN, WRONG_ID, WRONG_PLACE, PictureResult
from benchmarks.suites.camera.shoot import CameraPicture, shoot
from benchmarks.suites.scoring.calibration import summarise

IMAGE = "camera-failures.jpg"
MIN_MEASURED, MAX_RMS_PITCHES, MAX_Z = 0.95, 0.05, 5.0  # beyond these a picture fails
LOST_BGR, WRONG_BGR = (0, 220, 255), (60, 60, 255)


def fails(result: PictureResult) -> bool:
    """Raised, wrong markers, fewer than 95 % measured, an RMS error above a twentieth of the pitch, or z above 5."""
    return (
        result.raised
        or result.wrong_ids + result.wrong_places > 0
        or result.measured_share < MIN_MEASURED
        or result.rms_px > MAX_RMS_PITCHES * result.pitch_px
        or picture_z(result) > MAX_Z
    )


def picture_z(result: PictureResult) -> float:
    """z of all measured markers, see ``Calibration``; NaN without any."""
    return summarise([result.d2]).z.value


def shown_results(results: Sequence[PictureResult]) -> list[PictureResult]:
    """Of each effect that fails, the worst picture at the mildest strength that fails; combined: at each strength."""
    shown = []
    for kind in KINDS:
        failed = [result for result in results if result.case.kind == kind and fails(result)]
        strengths = sorted({result.case.strength for result in failed})
        for strength in strengths if kind == COMBINED else strengths[:1]:
            shown.append(max((r for r in failed if r.case.strength == strength), key=_severity))
    return shown


def _severity(result: PictureResult) -> float:
    """Exceptions before wrong ids before wrong positions before lost markers before errors above the stated errors."""
    lost = 1.0 - result.measured_share
    beyond = 1e-3 * picture_z(result) if result.right else 0.0
    return 1e6 * result.raised + 1e3 * result.wrong_ids + 10 * result.wrong_places + lost + beyond


def shown_record(result: PictureResult) -> dict[str, Any]:
    """The values of a picture for the page."""
    z = picture_z(result)
    return {
        "number": result.case.number,
        "name": result.case.name,
        "visible": result.visible,
        "measured": result.measured,
        "wrong_ids": result.wrong_ids,
        "wrong_places": result.wrong_places,
        "rms_px": result.rms_px if math.isfinite(result.rms_px) else None,
        "z": z if math.isfinite(z) else None,
        "reason": result.reason,
        "outcomes": result.outcomes,
    }


def page(measured: Mapping[str, Any]) -> Page:
    """The block and the sheet from the content of docs/measured/camera.json."""
    text = (
        f"Written by `{measured['command']} --publish`.\n\n"
        f"![Pictures of the camera suite that fail](../images/{IMAGE})\n\n"
        "A picture fails if a marker has another's id or an error above 0.3 of an edge, if fewer than 95 % of the "
        "visible markers are measured, if their RMS error is above a twentieth of the pitch, or if z is above 5. Of "
        "every effect that fails, the worst picture at the mildest strength that fails is shown; of all effects "
        "combined, the worst at every strength. Below each: measured markers of visible ones, RMS error per axis, "
        "z. Yellow: lost. Red: wrong.\n\n"
        f"```text\n{measured['table']}\n```"
    )
    tiles = [_tile(CameraCase(measured["seed"], entry["number"]), entry) for entry in measured["shown"]]
    return Page({"camera": text}, {IMAGE: draw_sheet(tiles, columns=4, lines=3, text_scale=0.38)})


def _tile(case: CameraCase, entry: Mapping[str, Any]) -> Tile:
    picture = shoot(sample_chain(case))
    nothing = entry["outcomes"].strip(UNSEEN + LOST) == ""
    marked = picture.image if nothing else marked_picture(picture, entry["outcomes"])
    return Tile(_cropped(marked, picture), _caption(entry))


def _caption(entry: Mapping[str, Any]) -> tuple[str, str, str]:
    wrong = entry["wrong_ids"] + entry["wrong_places"]
    counts = f"{entry['measured']} of {entry['visible']}" + (f", {wrong} wrong" if wrong else "")
    errors = "" if entry["rms_px"] is None else f"{entry['rms_px']:.2f} px, z {entry['z'] or math.nan:.1f}"
    return entry["name"].rpartition("/")[0], counts, entry["reason"] or errors


def _cropped(image: NDArray[np.uint8], picture: CameraPicture) -> NDArray[np.uint8]:
    """The visible markers with a margin, in the tile's size."""
    xy_px = picture.marker_xy_px[picture.visible]
    middle = 0.5 * (xy_px.min(axis=0) + xy_px.max(axis=0))
    scale = float((np.ptp(xy_px, axis=0) * 1.15 / TILE_PX).max())
    corner = middle - 0.5 * scale * np.array(TILE_PX)
    window = np.array([[1 / scale, 0, -corner[0] / scale], [0, 1 / scale, -corner[1] / scale]])
    smooth = cv2.GaussianBlur(image, (0, 0), 0.4 * scale) if scale > 1 else image
    drawn = cv2.warpAffine(smooth, window, TILE_PX, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(drawn, dtype=np.uint8)


def marked_picture(picture: CameraPicture, outcomes: str) -> NDArray[np.uint8]:
    """The picture with a dot at the true position of every lost or wrong marker."""
    canvas = picture.image.copy()
    for xy_px, letter in zip(picture.marker_xy_px, outcomes, strict=True):
        color = {LOST: LOST_BGR, WRONG_PLACE: WRONG_BGR, WRONG_ID: WRONG_BGR}.get(letter)
        if color is not None:
            draw_dots(canvas, [xy_px], color)
    return canvas
