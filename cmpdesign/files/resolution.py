"""The resolution that an image file states, if the statement is plausible."""

from __future__ import annotations

from pathlib import Path

# Cameras and programs without a resolution write 72 or 96; the code of a sheet is not legible in such coarse scans.
LEAST_DPI = 100.0
# EXIF: directory of the camera; time and aperture of an exposure, which scanners do not write.
_CAMERA, _EXPOSURE = 0x8769, (0x829A, 0x829D)


def resolution_dpi(path: str | Path) -> tuple[float, float] | str:
    """Read the resolution of a PNG (pHYs), JPEG (JFIF or EXIF), TIFF or BMP file.

    Returns:
        Pixels per inch in x and y, or a text that states the reason for the failure.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            exif = image.getexif().get_ifd(_CAMERA)
            stated = image.info.get("dpi")
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError):
        return "the file's resolution cannot be read"
    if any(tag in exif for tag in _EXPOSURE):
        return "a photo's resolution tag says nothing of the sheet"
    if stated is None:
        return "the file states no resolution"
    x, y = (float(value) for value in stated)
    if not (x >= LEAST_DPI and y >= LEAST_DPI):
        return f"the file states {x:.3g} dpi, which programs write that know no resolution"
    return x, y
