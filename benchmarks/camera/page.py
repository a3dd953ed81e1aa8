"""Pictures that fail: files with overlays, and the part of docs/explanation/hard-cases.md that ``--page`` writes.

The page is made from docs/measured/camera.json alone: its pictures are made again from their seed, and the reader's
results are stored in the file. The page can therefore be drawn again without reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.camera.report import EffectRow, rows_table
from benchmarks.suites.camera.cases import COMBINED, KINDS, CameraCase, sample_chain
from benchmarks.suites.camera.reading import (
    LOST,
    UNSEEN,
    WRONG_ID,
    WRONG_PLACE,
    PictureResult,
    cached_extractor,
)
from benchmarks.suites.camera.shoot import CameraPicture, shoot
from benchmarks.suites.scoring.calibration import summarise
from benchmarks.support.published import MEASURED_FOLDER, ROOT, read_measured, write_published
from cmpdesign.files.atomic import write_file
from extractor.presets import Preset

NAME = "camera"
IMAGE = "camera-failures.jpg"
LEAST_MEASURED, MOST_RMS_PITCHES, MOST_Z = 0.95, 0.05, 5.0  # beyond these a picture fails
TILE_PX, CAPTION_PX, COLUMNS, QUALITY = (208, 156), 46, 4, 72
DOT_PX = 2  # radius
LOST_BGR, WRONG_BGR, PAPER_BGR, TEXT_BGR = (0, 220, 255), (60, 60, 255), (255, 255, 255), (54, 47, 43)


def fails(result: PictureResult) -> bool:
    """Raised, wrong markers, fewer than 95 % measured, an RMS error above a twentieth of the pitch, or z above 5."""
    return (
        result.raised
        or result.wrong_ids + result.wrong_places > 0
        or result.measured_share < LEAST_MEASURED
        or result.rms_px > MOST_RMS_PITCHES * result.pitch_px
        or picture_z(result) > MOST_Z
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


def publish(
    found: Mapping[str, Any], rows: Sequence[EffectRow], results: Sequence[PictureResult]
) -> list[Path]:
    """Write docs/measured/camera.json, the picture, and its part of the hard cases. Returns the written files."""
    shown = [shown_record(result) for result in shown_results(results)]
    kept = {name: value for name, value in found.items() if name != "graded"}
    measured = {**kept, "shown": shown, "table": rows_table(rows)}
    written = write_published(NAME, measured, documentation_blocks(measured))
    image = ROOT / "docs" / "images" / IMAGE
    write_file(image, failures_picture(measured))
    return [*written, image]


def documentation_blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """The part of docs/explanation/hard-cases.md from the content of docs/measured/camera.json."""
    command = (
        f"python -m benchmarks.camera --seed {measured['seed']} --pictures {measured['pictures']} "
        f"--preset {measured['preset']} --page"
    )
    text = (
        f"Written by `{command}`.\n\n"
        f"![Pictures of the camera suite that fail](../images/{IMAGE})\n\n"
        "A picture fails if a marker has another's id or an error above 0.3 of an edge, if fewer than 95 % of the "
        "visible markers are measured, if their RMS error is above a twentieth of the pitch, or if z is above 5. Of "
        "every effect that fails, the worst picture at the mildest strength that fails is shown; of all effects "
        "combined, the worst at every strength. Below each: measured markers of visible ones, RMS error per axis, "
        "z. Yellow: lost. Red: wrong.\n\n"
        f"```text\n{measured['table']}\n```"
    )
    return {NAME: text}


def page_pictures() -> dict[str, bytes]:
    """Name in docs/images -> JPEG, from docs/measured/camera.json; empty as long as there is no such file."""
    if not (MEASURED_FOLDER / f"{NAME}.json").exists():
        return {}
    return {IMAGE: failures_picture(read_measured(NAME))}


def failures_picture(measured: Mapping[str, Any]) -> bytes:
    """JPEG of a sheet: the shown pictures with lost and wrong markers, and the reader's result."""
    tiles = [_tile(CameraCase(measured["seed"], entry["number"]), entry) for entry in measured["shown"]]
    blank = np.full((TILE_PX[1] + CAPTION_PX, TILE_PX[0], 3), PAPER_BGR, dtype=np.uint8)
    tiles += [blank] * (-len(tiles) % COLUMNS or (COLUMNS if not tiles else 0))
    rows = [np.hstack(tiles[first : first + COLUMNS]) for first in range(0, len(tiles), COLUMNS)]
    return bytes(cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])


def _tile(case: CameraCase, entry: Mapping[str, Any]) -> NDArray[np.uint8]:
    picture = shoot(sample_chain(case))
    tile = np.full((TILE_PX[1] + CAPTION_PX, TILE_PX[0], 3), PAPER_BGR, dtype=np.uint8)
    nothing = entry["outcomes"].strip(UNSEEN + LOST) == ""
    marked = picture.image if nothing else marked_picture(picture, entry["outcomes"])
    tile[: TILE_PX[1]] = _cropped(marked, picture)
    for line, text in enumerate(_caption(entry)):
        place = (3, TILE_PX[1] + 12 + 14 * line)
        cv2.putText(tile, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.38, TEXT_BGR, 1, cv2.LINE_AA)
    return tile


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
    for (x, y), letter in zip(picture.marker_xy_px, outcomes, strict=True):
        color = {LOST: LOST_BGR, WRONG_PLACE: WRONG_BGR, WRONG_ID: WRONG_BGR}.get(letter)
        if color is not None:
            place = (round(16 * float(x)), round(16 * float(y)))
            cv2.circle(canvas, place, 16 * DOT_PX, color, -1, cv2.LINE_AA, 4)
    return canvas


def save_pictures(results: Sequence[PictureResult], preset: Preset, folder: Path) -> None:
    """Write the pictures of results, and overlays of the reader's results, into a folder."""
    from extractor.draw import draw_markers

    folder.mkdir(parents=True, exist_ok=True)
    for result in results:
        chain = sample_chain(result.case)
        picture = shoot(chain)
        stem = result.case.name.replace("/", "-").replace(" ", "_")
        cv2.imwrite(str(folder / f"{stem}.png"), picture.image)
        if result.raised:
            continue
        extractor = cached_extractor(chain.pose.pattern, chain.pose.layers, preset)
        markers = extractor.extract(picture.image)
        overlay = draw_markers(marked_picture(picture, result.outcomes), extractor.layout, markers)
        cv2.imwrite(str(folder / f"{stem}.overlay.png"), overlay)
