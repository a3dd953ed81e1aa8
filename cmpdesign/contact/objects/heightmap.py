"""Objects of any shape, from a picture or an array of heights."""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from tokenize import TokenError
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.errors import ContactError, require
from cmpdesign.contact.objects.indenters import Indenter
from cmpdesign.errors import InputError
from cmpdesign.files.images import ImageFileError, decode_image
from cmpdesign.inputs.files import read_file
from cmpdesign.libraries import extra

Array = NDArray[np.float64]
MAX_HEIGHTS = 25_000_000  # of a height map


@dataclass(frozen=True, eq=False)
class HeightMap(Indenter):
    """A stamp: the height of its face towards the elastic layer, on square pixels.

    Attributes:
        heights_mm: (rows, columns) float64, seen from the front as the stamp lies on the pattern, first row at the
            largest y. The largest height touches first. NaN: no material.
        pixel_mm: the side of a pixel. Heights are interpolated linearly between pixel centres.
    """

    heights_mm: Array = field(repr=False)
    pixel_mm: float
    positive: ClassVar[tuple[str, ...]] = ("pixel_mm",)

    def __post_init__(self) -> None:
        super().__post_init__()
        heights = np.array(self.heights_mm, dtype=np.float64)
        good = heights.ndim == 2 and min(heights.shape) >= 2
        require(good, "heights_mm", f"of shape {heights.shape}", "two-dimensional, at least 2 x 2 pixels")
        require(bool(np.isfinite(heights).any()), "heights_mm", "nowhere finite", "finite in the material")
        require(
            not np.isinf(heights).any(), "heights_mm", "infinite somewhere", "finite, or NaN for no material"
        )
        heights.setflags(write=False)
        object.__setattr__(self, "heights_mm", heights)

    @classmethod
    def read(
        cls, path: str | Path, pixel_mm: float, depth_mm: float | None = None, **placed: Any
    ) -> HeightMap:
        """Read a grayscale PNG (8 or 16 bits: white is ``depth_mm`` higher than black) or an NPY file in mm.

        Raises:
            ContactError: the file is neither, or ``depth_mm`` is missing for a PNG or given for an NPY file.
        """
        path = Path(path)
        if path.suffix.lower() == ".npy":
            require(depth_mm is None, "depth_mm", depth_mm, f"left out, as {path.name} holds heights in mm")
            return cls(_read_npy(path), pixel_mm, **placed)
        require(
            depth_mm is not None and depth_mm > 0, "depth_mm", depth_mm, "above 0: from black to white, in mm"
        )
        return cls(_read_gray(path) * float(depth_mm or 0), pixel_mm, **placed)

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        with extra("evaluate"):
            from scipy.ndimage import map_coordinates

        rows, columns = self.heights_mm.shape
        row = (rows - 1) / 2 - np.asarray(y_mm) / self.pixel_mm
        column = (columns - 1) / 2 + np.asarray(x_mm) / self.pixel_mm
        depth = np.nanmax(self.heights_mm) - self.heights_mm
        has_material = np.isfinite(depth)
        # The outermost pixels extend half a pixel beyond their centres.
        inside = (row >= -0.5) & (row <= rows - 0.5) & (column >= -0.5) & (column <= columns - 0.5)
        positions = np.stack([row, column])
        height = map_coordinates(np.where(has_material, depth, 0.0), positions, order=1, mode="nearest")
        inside &= (
            map_coordinates(has_material.astype(np.float64), positions, order=1, mode="nearest") > 1 - 1e-9
        )
        return np.where(inside, height, np.inf)

    @property
    def smallest_radius_mm(self) -> float:
        return self.pixel_mm


def _read_npy(path: Path) -> Array:
    """(rows, columns) float64 from an NPY file; its header is tested before memory is taken."""
    try:
        data = read_file(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the header's style
            has_all = _has_all_numbers(data)
            heights = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False) if has_all else None
    except InputError as error:
        raise ContactError(str(error)) from None
    except (ValueError, TypeError, SyntaxError, TokenError, EOFError, MemoryError, RecursionError) as error:
        reason = str(error).partition("\n")[0]
        raise ContactError(f"{path}: cannot be read as an NPY file ({reason})") from None
    if heights is None:
        raise ContactError(
            f"{path}: the header states more numbers than the file holds, or more than {MAX_HEIGHTS}"
        )
    if heights.dtype.kind not in "fiu":
        raise ContactError(f"{path}: holds no array of numbers; save heights in mm with numpy.save")
    return np.asarray(heights, dtype=np.float64)


def _has_all_numbers(data: bytes) -> bool:
    """True if the bytes after the header of an NPY file are as many as its shape needs.

    Raises:
        ValueError: no NPY file of version 1 or 2.
    """
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    readers = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in readers:
        raise ValueError(f"version {version[0]}.{version[1]}; expected 1.0 or 2.0")
    shape, _, kind = readers[version](file)
    count = math.prod(shape)
    return count <= MAX_HEIGHTS and count * kind.itemsize <= len(data) - file.tell()


def _read_gray(path: Path) -> Array:
    """(rows, columns) float64 brightness from 0 to 1."""
    try:
        pixels = decode_image(path, MAX_HEIGHTS)
    except ImageFileError as error:
        raise ContactError(f"{error} (a height map is a grayscale PNG, or an NPY file in mm)") from None
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ContactError(f"{path}: has pixels of type {pixels.dtype}; expected 8 or 16 bits")
    if pixels.ndim == 3:
        gray = pixels[:, :, 0]
        if any((pixels[:, :, i] != gray).any() for i in range(1, min(3, pixels.shape[2]))):
            raise ContactError(f"{path}: is a color image; a height map is grayscale")
        pixels = gray
    return np.asarray(pixels, dtype=np.float64) / (255 if pixels.dtype == np.uint8 else 65535)
