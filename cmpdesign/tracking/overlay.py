"""The overlay video: every frame with its markers, displacements and status."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.files.video_writer import CODECS, VideoWriter

if TYPE_CHECKING:
    from extractor.layout.reference import Reference
    from extractor.track.displacement import Rest
    from extractor.track.tracker import Tracked

Picture = NDArray[np.uint8]

EMPTY_SIZE = (640, 480)  # (width, height) of the video when its first frame has no image, px
WAY_BGR = (255, 200, 0)
PRESSURE_BGR = (60, 60, 240)
MIN_PRESSURE = 0.05  # of the largest pressure, below which a marker has no disc
FIXED_BITS = 4  # OpenCV draws with 4 fractional bits


class OverlayWriter:
    """Writes the overlay video; ``close`` completes the file.

    Args:
        path: file with a suffix of ``CODECS``.
        reference: the layout.
        fps: frames per second.

    Raises:
        CmpDesignError: the suffix names no codec.
        OutputError: the video cannot be written.
    """

    def __init__(self, path: Path, reference: Reference, fps: float) -> None:
        if path.suffix not in CODECS:
            raise CmpDesignError(
                f"{parameter('overlay')} {path}: unknown ending; expected one of {', '.join(CODECS)}"
            )
        self._video = VideoWriter(path, fps)
        self._reference = reference
        self._size: tuple[int, int] | None = None

    def add(self, image: NDArray[Any] | None, frame: Tracked, rest: Rest | None) -> None:
        """Append a frame; pictures of another size than the first are scaled to its size."""
        picture = draw_frame(image, self._reference, frame, rest, self._size or EMPTY_SIZE)
        if self._size is None:
            self._size = (picture.shape[1], picture.shape[0])
        self._video.add(_letterbox(picture, self._size))

    def close(self) -> None:
        """Complete the video.

        Raises:
            OutputError: see ``VideoWriter.close``.
        """
        self._video.close()


def draw_frame(
    image: NDArray[Any] | None, reference: Reference, frame: Tracked, rest: Rest | None, size: tuple[int, int]
) -> Picture:
    """Draw a frame: gridlines, markers by status, lines from the places at rest, and captions.

    Args:
        image: (H, W, 3) BGR; None for a frame without an image.
        reference: the layout.
        frame: the tracked frame.
        rest: the rest frame, if known.
        size: (width, height) of the picture for a frame without an image, px.

    Returns:
        (H, W, 3) uint8 BGR.
    """
    from extractor.draw import CaptionPart, draw_caption, draw_markers

    parts = [CaptionPart(_frame_text(frame))]
    if image is None:
        picture = np.zeros((size[1], size[0], 3), np.uint8)
    else:
        picture = draw_markers(image, reference, frame.markers)
        if rest is not None:
            _draw_ways(picture, rest.xy_px, frame.markers.xy_px, picture.shape[1] // image.shape[1])
            parts.append(CaptionPart("way from the place at rest", WAY_BGR, "line"))
        if frame.contact is not None and frame.contact.regions:
            pressure_mpa = -frame.contact.marker_traction_mpa[:, 2]
            _draw_pressure(picture, frame.markers.xy_px, pressure_mpa, picture.shape[1] // image.shape[1])
            parts.append(CaptionPart("pressure", PRESSURE_BGR))
    draw_caption(picture, parts, at_top=True)
    return picture


def _frame_text(frame: Tracked) -> str:
    time = "" if np.isnan(frame.time_s) else f"  {frame.time_s:.3f} s"
    start = f"  {frame.start}" if frame.start else ""
    reason = f"  {frame.reason}" if frame.reason else ""
    force = ""
    if frame.contact is not None and frame.contact.regions:
        sigmas = np.sqrt(np.diag(frame.contact.force_cov_n2))
        pairs = zip("xyz", frame.contact.force_n, sigmas, strict=True)
        force = "  " + ", ".join(f"F{axis} {value:.2f} +- {sigma:.2f} N" for axis, value, sigma in pairs)
    status = frame.status.name.lower().replace("_", " ")
    return f"frame {frame.index}{time}  {status}{start}{force}{reason}"


def _draw_ways(
    picture: Picture, rest_px: NDArray[np.float64], xy_px: NDArray[np.float64], scale: int
) -> None:
    import cv2

    ends = np.stack([rest_px, xy_px], axis=1)
    known = np.isfinite(ends).all(axis=(1, 2))
    fixed = np.round(((ends[known] + 0.5) * scale - 0.5) * (1 << FIXED_BITS)).astype(np.int32)
    cv2.polylines(picture, list(fixed), False, WAY_BGR, 1, cv2.LINE_AA, FIXED_BITS)


def _draw_pressure(
    picture: Picture, xy_px: NDArray[np.float64], pressure_mpa: NDArray[np.float64], scale: int
) -> None:
    """A disc at every marker under pressure: its area is proportional to the pressure."""
    import cv2

    largest = float(np.nanmax(pressure_mpa, initial=0.0))
    shown = np.isfinite(xy_px[:, 0]) & (pressure_mpa > MIN_PRESSURE * largest)
    if not shown.any():
        return
    known = xy_px[np.isfinite(xy_px[:, 0])]
    reach = scale * float(np.sqrt(np.ptp(known, axis=0).prod() / len(known)))
    discs = picture.copy()
    for place, pressure in zip(xy_px[shown], pressure_mpa[shown], strict=True):
        middle = np.round(((place + 0.5) * scale - 0.5) * (1 << FIXED_BITS)).astype(int).tolist()
        radius = round(0.5 * reach * float(np.sqrt(pressure / largest)) * (1 << FIXED_BITS))
        cv2.circle(discs, middle, radius, PRESSURE_BGR, -1, cv2.LINE_AA, FIXED_BITS)
    cv2.addWeighted(discs, 0.5, picture, 0.5, 0.0, dst=picture)


def _letterbox(picture: Picture, size: tuple[int, int]) -> Picture:
    """Scale a picture to (width, height) with its aspect ratio kept, centred on black."""
    import cv2

    height, width = picture.shape[:2]
    if (width, height) == size:
        return picture
    factor = min(size[0] / width, size[1] / height)
    small = cv2.resize(
        picture, (max(1, int(width * factor)), max(1, int(height * factor))), interpolation=cv2.INTER_AREA
    )
    canvas = np.zeros((size[1], size[0], 3), np.uint8)
    top, left = (size[1] - small.shape[0]) // 2, (size[0] - small.shape[1]) // 2
    canvas[top : top + small.shape[0], left : left + small.shape[1]] = small
    return canvas
