"""The response that an image file states: an ICC profile, or PNG's gamma.

The tone curves of matrix and gray profiles ("rTRC", "gTRC", "bTRC", "kTRC") of types "curv" and "para" are read, as
ICC.1 defines them. Profiles of tables ("A2B0") state no curves.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import read_file
from extractor.image.response import Response, light_of_values

Values = NDArray[np.float64]
TONE_CURVES = (b"rTRC", b"gTRC", b"bTRC", b"kTRC")
HEADER_BYTES, ENTRY_BYTES, MAX_TAGS = 128, 12, 1000
# Largest difference of light (0 to 255) from sRGB's for a curve to be sRGB.
SRGB_TOLERANCE = 0.3
# Parameters of each "para" function, in the order g a b c d e f, and the omitted parameters.
PARAMETERS = (1, 3, 4, 5, 7)


def stated_response(path: str | Path) -> Response | None:
    """The response that a file states; None if the file states no response or cannot be read."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(read_file(path))) as image:
            info: dict[Any, Any] = dict(image.info)
    except (InputError, OSError, UnidentifiedImageError, ValueError, Image.DecompressionBombError):
        return None
    profile = info.get("icc_profile")
    if isinstance(profile, bytes) and profile:
        return profile_response(profile)
    if "srgb" in info:
        return "srgb"
    gamma = info.get("gamma")
    return 1 / gamma if isinstance(gamma, float) and 0.2 <= gamma <= 5 else None


def profile_response(profile: bytes) -> Response | None:
    """The response of an ICC profile: the mean of its tone curves; None without such curves.

    Returns:
        "srgb" where the curve is sRGB's, else (256,) the light of each 8-bit value.
    """
    try:
        curves = [_tone_curve(data) for name, data in _tags(profile).items() if name in TONE_CURVES]
    except (struct.error, ValueError, IndexError):
        return None
    if not curves:
        return None
    light = np.mean(curves, axis=0)
    if not np.isfinite(light).all() or light[-1] <= light[0]:
        return None
    light = 255.0 * np.maximum.accumulate(np.clip(light, 0, None)) / light[-1]
    if np.abs(light - light_of_values("srgb")).max() < SRGB_TOLERANCE:
        return "srgb"
    # Tables of 16 bits repeat values near black; a response rises.
    rising = light + 1e-6 * np.arange(len(light))
    return np.asarray(rising / rising[-1])


def _tags(profile: bytes) -> dict[bytes, bytes]:
    """The data of a profile's tags, by signature."""
    (count,) = struct.unpack_from(">I", profile, HEADER_BYTES)
    if count > MAX_TAGS:
        raise ValueError("too many tags")
    tags = {}
    for number in range(count):
        entry = struct.unpack_from(">4sII", profile, HEADER_BYTES + 4 + ENTRY_BYTES * number)
        name, offset, size = entry
        tags[name] = profile[offset : offset + size]
    return tags


def _tone_curve(data: bytes) -> Values:
    """(256,) light from 0 to 1 of equal steps of the value."""
    value = np.linspace(0.0, 1.0, 256)
    if data[:4] == b"curv":
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return value
        numbers = np.frombuffer(data, dtype=">u2", count=count, offset=12).astype(np.float64)
        if count == 1:
            return np.asarray(value ** (numbers[0] / 256))
        return np.interp(value, np.linspace(0, 1, count), numbers / 65535)
    if data[:4] != b"para":
        raise ValueError("neither curv nor para")
    (kind,) = struct.unpack_from(">H", data, 8)
    given = np.array(struct.unpack_from(f">{PARAMETERS[kind]}i", data, 12)) / 65536
    return _parametric_curve(value, kind, given)


def _parametric_curve(value: Values, kind: int, given: Values) -> Values:
    """One of the five functions of "para"."""
    g, a, b, c, d, e, f = np.concatenate([given, np.zeros(7 - len(given))])
    if kind == 0:
        return np.asarray(value**g)
    power = np.maximum(a * value + b, 0) ** g
    if kind == 1:
        return np.asarray(np.where(a * value + b >= 0, power, 0.0))
    if kind == 2:
        return np.asarray(np.where(a * value + b >= 0, power, 0.0) + c)
    return np.asarray(np.where(value >= d, power + e, c * value + f))
