"""What an image file says of its own resolution, where that can be believed."""

from __future__ import annotations

from pathlib import Path

# Cameras and programs that know no resolution write 72 or 96; no scan as coarse shows a sheet's code.
LEAST_DPI = 100.0
# EXIF: the camera's own directory; time and aperture of an exposure, which no scanner has.
_CAMERA, _EXPOSURE = 0x8769, (0x829A, 0x829D)


def resolution_dpi(path: str | Path) -> tuple[float, float] | str:
    """Pixels per inch in x and y as the file states them, or in a few words why it does not.

    Read are PNG (pHYs), JPEG (JFIF or EXIF), TIFF and BMP.
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
