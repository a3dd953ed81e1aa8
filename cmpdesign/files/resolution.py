"""The resolution that an image file states, if the statement is plausible."""

from __future__ import annotations

import warnings
from pathlib import Path

from cmpdesign.errors import InputError
from cmpdesign.files.image_header import open_header
from cmpdesign.inputs.files import read_file

# Cameras and programs without a resolution write 72 or 96; the code of a sheet is not legible in such coarse scans.
MIN_DPI = 100.0
# EXIF: directory of the camera; time and aperture of an exposure, which scanners do not write.
_CAMERA, _EXPOSURE = 0x8769, (0x829A, 0x829D)


def resolution_dpi(path: str | Path) -> tuple[float, float] | str:
    """Read the resolution of a PNG (pHYs), JPEG (JFIF or EXIF), TIFF or BMP file.

    Returns:
        Pixels per inch in x and y, or a text that states the reason for the failure.
    """
    try:
        image = open_header(read_file(path))
        if image is None:
            return "the file's resolution cannot be read"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd tags
            exif = image.getexif().get_ifd(_CAMERA)
        stated = image.info.get("dpi")
        x, y = (float(value) for value in stated) if stated else (0.0, 0.0)
    except (InputError, OSError, ValueError, SyntaxError, TypeError, ArithmeticError):
        return "the file's resolution cannot be read"
    if any(tag in exif for tag in _EXPOSURE):
        return "the resolution tag of a photo is not the resolution of the sheet"
    if not stated:
        return "the file states no resolution"
    if not (x >= MIN_DPI and y >= MIN_DPI):
        return f"the file states {x:.3g} dpi, the default of programs that know no resolution"
    return x, y
