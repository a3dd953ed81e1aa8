"""The source's images beside the chunks of a run: one PNG file for each frame and image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import read_file

_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"


def keep_images(folder: Path, frame: int, images: Any) -> None:
    """Write a frame's images, without loss.

    Args:
        folder: where the run's chunks are.
        frame: the frame's number.
        images: (H, W, 3) BGR of 8 or 16 bits, or None; or a list of these, one for each view.

    Raises:
        OSError: an image cannot be written.
    """
    for view in (None, *range(len(images) if isinstance(images, list) else 0)):
        png = png_of(images, view)
        if png is not None:
            _image_path(folder, frame, view).write_bytes(png)


def png_of(images: Any, view: int | None) -> bytes | None:
    """One of a frame's images as PNG, with fast compression; None without an image.

    Args:
        images: see ``keep_images``.
        view: see ``kept_image``.
    """
    import cv2

    named: dict[int | None, Any] = {None: images}
    if isinstance(images, list):
        named = dict(enumerate(images))
    image = named.get(view)
    if not isinstance(image, np.ndarray):
        return None
    return bytes(cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])


def kept_image(folder: Path, frame: int, view: int | None) -> bytes | None:
    """A frame's image as PNG; None where the frame has no image, or where the file of a killed run is incomplete.

    Args:
        folder: where the run's chunks are.
        frame: the frame's number.
        view: the view with a separate image; None for the image with all views.
    """
    try:
        data = read_file(_image_path(folder, frame, view))
    except InputError:
        return None
    return data if data.startswith(_PNG_START) and data.endswith(_PNG_END) else None


def _image_path(folder: Path, frame: int, view: int | None) -> Path:
    return folder / (f"{frame:09d}.png" if view is None else f"{frame:09d}.{view}.png")
