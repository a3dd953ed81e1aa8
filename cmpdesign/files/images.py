"""Reading of image files as arrays, and encoding of images by the ending of a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, InputError, parameter
from cmpdesign.files.image_header import is_raw_of_camera, pictures_in_file, size_in_header
from cmpdesign.inputs.file_kinds import HEAD_BYTES, RAW, describe_file, is_raw_picture
from cmpdesign.inputs.files import MAX_PIXELS, open_file, read_file
from cmpdesign.inputs.sources import has_jpeg_end

SMALLEST_PX = 16
_HEADER_BYTES = 1 << 16
_TAIL_BYTES = 4096
_JPEG_STREAMS = (".mjpeg", ".mjpg")
FEWEST_BITS, _MAX_BITS = 8, 14  # of a camera's values in a file of 16 bits
PNG_PIXELS_PER_BYTE = 8 * 1032  # at most: one bit a pixel, and deflate makes no more than 1032 bytes of one
_NO_IMAGE = "is not an image that can be read; expected PNG, JPEG, TIFF, BMP or WebP"
# Endings of images that are written -> largest number of bits.
IMAGE_BITS = {".png": 16, ".tif": 16, ".tiff": 16, ".bmp": 8, ".webp": 8, ".jpg": 8, ".jpeg": 8}
JPEG_QUALITY = 95
LOSSLESS_WEBP = 101

Image = NDArray[np.uint8] | NDArray[np.uint16]


class ImageFileError(CmpDesignError, ValueError):
    """A file that is not a color image of sufficient size."""


@dataclass(frozen=True)
class BitRange:
    """Where values stand in 16 bits: below bit ``top``, from bit ``bottom`` on."""

    top: int
    bottom: int = 0

    @property
    def bits(self) -> int:
        return self.top - self.bottom


def read_image(
    path: str | Path, most_pixels: int = MAX_PIXELS, *, gray: bool = False, bits: int | None = None
) -> Image:
    """Read the pixels of an image file.

    An alpha channel is dropped. A rotation in EXIF is not applied, because the sensor's pixels are measured;
    ``cv2.imread`` applies it. Values of 10 to 14 bits in a file of 16 bits are scaled to the whole range.

    Args:
        path: a PNG, JPEG, TIFF, BMP, WebP, PGM or PPM file.
        most_pixels: limit of width x height; the header is tested before memory is taken.
        gray: grayscale images are read, too; their three channels are equal.
        bits: bits of the values in a file of 16 bits; None: found from the values.

    Returns:
        (H, W, 3) uint8 or uint16, BGR.

    Raises:
        ImageFileError: the file cannot be read, is no image, has one channel (unless ``gray``), has other than 8 or
            16 bits, or is smaller than 16 x 16 or larger than ``most_pixels`` pixels.
    """
    pixels = read_stored(path, most_pixels, gray=gray)
    return pixels if pixels.dtype != np.uint16 else full_range(pixels, range_of(pixels, path, bits))


def read_stored(path: str | Path, most_pixels: int = MAX_PIXELS, *, gray: bool = False) -> Image:
    """As ``read_image``, with the values as they are stored."""
    return _to_bgr(decode_image(path, most_pixels), Path(path), gray)


def range_of(pixels: Image, path: str | Path, bits: int | None, used: int = 0) -> BitRange:
    """Where the values of a picture stand in 16 bits; ``used``: the bits that earlier pictures use.

    Raises:
        ImageFileError: the values have more bits than stated.
    """
    used |= used_values(pixels)
    try:
        return bits_of(used) if bits is None else stated_bits(used, bits)
    except ImageFileError as error:
        raise ImageFileError(f"{path}: {error}") from None


def is_image_file(path: str | Path) -> bool:
    """True if a file begins like an image that ``read_image`` knows; False also for a file that cannot be read.

    A bare stream of JPEGs begins like one JPEG; it is known by its name.
    """
    if Path(path).suffix.lower() in _JPEG_STREAMS:
        return False
    try:
        with open_file(path) as file:
            return size_in_header(file.read(_HEADER_BYTES)) is not None
    except (InputError, OSError):
        return False


def decode_image(path: str | Path, most_pixels: int = MAX_PIXELS) -> NDArray[Any]:
    """Read the pixels of an image file as they are stored: (H, W) or (H, W, C), of any depth.

    Raises:
        ImageFileError: the file cannot be read, is no image, or has more than ``most_pixels`` pixels.
    """
    try:
        data = read_file(path)
    except InputError as error:
        raise ImageFileError(str(error)) from None
    return decode_bytes(data, path, most_pixels)


def decode_bytes(data: bytes, path: str | Path, most_pixels: int = MAX_PIXELS) -> NDArray[Any]:
    """The pixels in the bytes of an image file, as ``decode_image``; ``path`` is for messages.

    Raises:
        ImageFileError: see ``decode_image``.
    """
    import cv2

    if not data:
        raise ImageFileError(f"{path} is empty; expected an image")
    size = size_in_header(data)
    if size is None:
        raise ImageFileError(f"{path}: {_NO_IMAGE}{_described(path)}")
    if is_raw_picture(path, data[:HEAD_BYTES]) or is_raw_of_camera(data):
        raise ImageFileError(f"{path}: {_NO_IMAGE}; {RAW}")
    if (count := pictures_in_file(data)) > 1:
        raise ImageFileError(
            f"{path}: holds {count} pictures; expected one a file: save them one by one, or as a video"
        )
    if size[0] * size[1] > most_pixels:
        raise ImageFileError(
            f"{path}: is {size[0]} x {size[1]} px, {size[0] * size[1] / 1e6:.4g} megapixels; the limit is "
            f"{most_pixels / 1e6:.4g}; make it smaller, or raise {parameter('max_pixels')}"
        )
    if data.startswith(b"\x89PNG") and size[0] * size[1] > PNG_PIXELS_PER_BYTE * len(data):
        raise ImageFileError(
            f"{path}: {_NO_IMAGE}; it claims {size[0]} x {size[1]} px, which {len(data)} bytes cannot hold"
        )
    if (data.startswith(b"\x89PNG") and b"IEND" not in data[-_TAIL_BYTES:]) or (
        data.startswith(b"\xff\xd8") and not has_jpeg_end(data)
    ):
        raise ImageFileError(f"{path}: is cut off: its end is missing; copy the file again")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):  # OpenCV refuses to decode: too many pixels, or an unknown type
        pixels = None
    if pixels is None:
        raise ImageFileError(f"{path}: {_NO_IMAGE}")
    return np.asarray(pixels)


def _to_bgr(pixels: NDArray[Any], path: Path, gray: bool) -> Image:
    height, width = pixels.shape[:2]
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    if height < SMALLEST_PX or width < SMALLEST_PX:
        raise ImageFileError(
            f"{path}: is {width} x {height} px; expected at least {SMALLEST_PX} x {SMALLEST_PX} px"
        )
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ImageFileError(
            f"{path}: has pixels of type {pixels.dtype}; expected 8 or 16 bits, save it as PNG"
        )
    if channels == 1 and gray:
        return np.ascontiguousarray(np.repeat(pixels.reshape(height, width, 1), 3, axis=2))
    if channels < 3:
        raise ImageFileError(f"{path} is a grayscale image; a multicolor pattern needs color (3 channels)")
    return np.ascontiguousarray(pixels[:, :, :3])


def used_values(pixels: Image) -> int:
    """The bits that are set in any value."""
    return int(np.bitwise_or.reduce(pixels, axis=None))


def bits_of(used: int) -> BitRange:
    """Where a camera wrote its values into 16 bits, by the bits that pictures use, see ``used_values``.

    Cameras write 10 to 14 bits into the lower or into the upper bits, and leave the others 0. From a dark picture alone
    fewer bits are found than the camera has.
    """
    if not used:
        return BitRange(16)
    top, bottom = max(used.bit_length(), FEWEST_BITS), (used & -used).bit_length() - 1
    if top > _MAX_BITS and bottom < 16 - _MAX_BITS:
        return BitRange(16)
    return BitRange(top, min(bottom, top - FEWEST_BITS))


def stated_bits(used: int, bits: int) -> BitRange:
    """Where values of a stated number of bits are.

    Raises:
        ImageFileError: the values have more bits.
    """
    if used < 1 << bits:
        return BitRange(bits)
    if used & ((1 << (16 - bits)) - 1):
        raise ImageFileError(
            f"its values have {used.bit_length()} bits, {parameter('bits')} states {bits}; leave it out, or give more"
        )
    return BitRange(16, 16 - bits)


def full_range(pixels: Image, place: BitRange) -> Image:
    """A picture of 16 bits with the whole range: light that is linear stays linear, a clipped value is 65535 again."""
    if pixels.dtype != np.uint16 or place.bits == 16:
        return pixels
    largest = (1 << place.bits) - 1
    scaled = (pixels >> place.bottom).astype(np.uint32) * 65535
    return ((scaled + largest // 2) // largest).astype(np.uint16)


def _described(path: str | Path) -> str:
    """What a file is that is no image, as "; it is a zip archive: ..."; empty where that is not known."""
    try:
        text = describe_file(path)
    except InputError:
        return ""
    return f"; {text}" if text else ""


def require_color_picture(pixels: object) -> Image:
    """An array as a color picture.

    Raises:
        ImageFileError: not (H, W, 3) uint8 or uint16, or a side below 16 px.
    """
    if not isinstance(pixels, np.ndarray):
        raise ImageFileError(
            f"the picture is a value of the type {type(pixels).__name__}; give a file or an array"
        )
    shape = "x".join(map(str, pixels.shape))
    if pixels.ndim != 3 or pixels.shape[2] != 3 or min(pixels.shape[:2]) < SMALLEST_PX:
        raise ImageFileError(
            f"the picture's shape is {shape}; expected (H, W, 3), {SMALLEST_PX} px a side or more"
        )
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ImageFileError(f"the picture's values are {pixels.dtype}; expected uint8 or uint16")
    return np.ascontiguousarray(pixels)


def to_png(pixels: Image) -> bytes:
    """Encode a (H, W, 3) BGR image as PNG."""
    import cv2

    return bytes(cv2.imencode(".png", pixels)[1])


def to_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """Encode a (H, W, 3) BGR image as JPEG of a quality from 1 to 100, with the full resolution of color (4:4:4)."""
    import cv2

    full_color = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return bytes(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality, *full_color])[1])


def require_image_kind(path: Path, bits: int) -> None:
    """Check that the ending of a file names an image format for the bits of a channel.

    Raises:
        CmpDesignError: another ending, or a format of fewer bits.
    """
    kinds = [suffix for suffix, most in IMAGE_BITS.items() if most >= bits]
    if path.suffix.lower() not in IMAGE_BITS:
        raise CmpDesignError(f"{path}: unknown ending; expected one of {', '.join(kinds)}")
    if path.suffix.lower() not in kinds:
        raise CmpDesignError(
            f"{path}: this format has 8 bits, the image {bits}; expected one of {', '.join(kinds)}"
        )


def encode_image(pixels: Image, path: Path) -> bytes:
    """Encode a (H, W, 3) BGR image by the ending of a file; all formats but JPEG are lossless.

    Raises:
        CmpDesignError: see ``require_image_kind``.
    """
    import cv2

    require_image_kind(path, 8 * pixels.itemsize)
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY, cv2.IMWRITE_WEBP_QUALITY, LOSSLESS_WEBP]
    suffix = path.suffix.lower()
    options = {".jpg": quality[:2], ".jpeg": quality[:2], ".webp": quality[2:]}.get(suffix, [])
    return bytes(cv2.imencode(suffix, pixels, options)[1])
