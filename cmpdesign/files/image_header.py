"""The header of an image file: its size, before memory for its pixels is taken, and its tags."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

# First bytes of the formats that are read -> Pillow's module and class.
_READERS: Mapping[bytes, tuple[str, str]] = {
    b"\x89PNG\r\n\x1a\n": ("PngImagePlugin", "PngImageFile"),
    b"\xff\xd8\xff": ("JpegImagePlugin", "JpegImageFile"),
    b"II*\0": ("TiffImagePlugin", "TiffImageFile"),
    b"MM\0*": ("TiffImagePlugin", "TiffImageFile"),
    b"BM": ("BmpImagePlugin", "BmpImageFile"),
    b"RIFF": ("WebPImagePlugin", "WebPImageFile"),
    b"P5": ("PpmImagePlugin", "PpmImageFile"),
    b"P6": ("PpmImagePlugin", "PpmImageFile"),
}
_TIFF_KIND, _TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_PHOTOMETRIC, _DNG_VERSION = 254, 256, 257, 262, 50706
_RAW_PHOTOMETRIC = (32803, 34892)  # mosaic of color filters; linear raw
_ODD = (
    OSError,
    ValueError,
    SyntaxError,
    ArithmeticError,
    KeyError,
    TypeError,
    IndexError,
)  # of damaged headers


def open_header(data: bytes) -> ImageFile | None:
    """Open an image without decoding its pixels; None if the file is no PNG, JPEG, TIFF, BMP, WebP, PGM or PPM.

    ``PIL.Image.open`` warns of large images and refuses very large images; here the caller sets the limit.
    """
    from importlib import import_module

    from PIL.Image import DecompressionBombError  # of WebP, beyond 179 megapixels

    for start, (module, name) in _READERS.items():
        if data.startswith(start):
            reader: Callable[[Any], ImageFile] = getattr(import_module(f"PIL.{module}"), name)
            with suppress(*_ODD, DecompressionBombError), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of odd tags, which say nothing about the pixels
                return reader(io.BytesIO(data))
    return None


def size_in_header(data: bytes) -> tuple[int, int] | None:
    """(width, height) in px as the header states them; None if the file is none of the formats that are read."""
    header = open_header(data)
    if header is not None:
        return header.size
    return _tiff_size(data) if data.startswith((b"II*\0", b"MM\0*")) else None


def pictures_in_file(data: bytes) -> int:
    """The number of pictures: pages of a TIFF, frames of an animated PNG or WebP; 1 where it is not stated."""
    header = open_header(data)
    with suppress(*_ODD), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return int(getattr(header, "n_frames", 1))
    return 1


def is_raw_of_camera(data: bytes) -> bool:
    """True for a TIFF whose pixels, or whose first page's larger sibling, are a camera's raw values (DNG, NEF, ...)."""
    if not data.startswith((b"II*\0", b"MM\0*")):
        return False
    tags = _tiff_tags(data)
    is_preview = bool(int(tags.get(_TIFF_KIND, 0)) & 1)
    return _DNG_VERSION in tags or is_preview or tags.get(_TIFF_PHOTOMETRIC) in _RAW_PHOTOMETRIC


def _tiff_size(data: bytes) -> tuple[int, int] | None:
    """The size of a TIFF file whose kind of pixels Pillow does not know."""
    tags = _tiff_tags(data)
    with suppress(*_ODD):
        return int(tags[_TIFF_WIDTH]), int(tags[_TIFF_HEIGHT])
    return None


def _tiff_tags(data: bytes) -> Mapping[int, Any]:
    """The tags of the first page; none of a damaged file."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    with suppress(*_ODD), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tags, file = ImageFileDirectory_v2(data[:8]), io.BytesIO(data)
        file.seek(tags.next)
        tags.load(file)
        return dict(tags)
    return {}
