"""What a camera's driver offers, asked by the ioctls of Linux (V4L2); OpenCV does not list them.

Source of numbers and structures: linux/videodev2.h. The library linuxpy does the same under the GPL.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

Ioctl = Callable[[int, int, bytearray], object]

_CAPTURE = 0x1 | 0x1000  # V4L2_CAP_VIDEO_CAPTURE, _MPLANE
_BUFFER_TYPE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
_DISCRETE = 1  # V4L2_FRMSIZE_TYPE_DISCRETE, V4L2_FRMIVAL_TYPE_DISCRETE
_MAX_ENTRIES = 256  # of a list that a driver gives
_CAPABILITY, _FORMAT, _SIZE, _INTERVAL, _CONTROL = "<16s32s32s6I", "<3I32s5I", "<11I", "<13I", "<2I32s4i3I"
_QUERYCAP, _ENUM_FMT, _ENUM_SIZES, _ENUM_INTERVALS, _QUERYCTRL = 0, 2, 74, 75, 36
# Controls that are shown -> their numbers, V4L2_CID_*.
_CONTROLS = {
    "exposure": 0x009A0902,
    "gain": 0x00980913,
    "white balance": 0x0098091A,
    "focus": 0x009A090A,
}
_UNITS = {"exposure": (0.1, "ms"), "white balance": (1.0, "K")}  # V4L2 counts exposure in 100 us
_DISABLED = 1  # V4L2_CTRL_FLAG_DISABLED


@dataclass(frozen=True)
class CameraFormat:
    """One size of one pixel format: the rates are the discrete ones, or the smallest and the largest, 1/s."""

    format: str
    size_px: tuple[int, int]
    fps: tuple[float, ...]


@dataclass(frozen=True)
class CameraRange:
    """The range of a control: of the exposure in ms, of the white balance in K, else in the driver's unit."""

    name: str
    least: float
    most: float
    step: float
    usual: float
    unit: str = ""


@dataclass(frozen=True)
class CameraOffer:
    """What a driver offers; ``formats`` is empty for a device that takes no pictures."""

    formats: tuple[CameraFormat, ...] = ()
    ranges: tuple[CameraRange, ...] = ()
    problem: str = ""


def offer_of(path: str) -> CameraOffer:
    """What the driver of a device offers; a device that cannot be opened has the reason in ``problem``."""
    import fcntl

    def ask(descriptor: int, request: int, data: bytearray) -> object:
        return fcntl.ioctl(descriptor, request, data)

    try:
        descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        return CameraOffer(problem=f"cannot be opened ({error.strerror or error})")
    try:
        return _offer(descriptor, ask)
    except OSError as error:
        return CameraOffer(problem=f"is no camera ({error.strerror or error})")
    finally:
        os.close(descriptor)


def _offer(descriptor: int, ask: Ioctl) -> CameraOffer:
    *_, all_capabilities, own, _, _, _ = _asked(
        descriptor, ask, _QUERYCAP, _CAPABILITY, bytes(struct.calcsize(_CAPABILITY)), read_only=True
    )
    if not (own or all_capabilities) & _CAPTURE:
        return CameraOffer(problem="takes no pictures")
    formats = [
        CameraFormat(name, size_px, tuple(_rates(descriptor, ask, code, size_px)))
        for code, name in _pixel_formats(descriptor, ask)
        for size_px in _sizes(descriptor, ask, code)
    ]
    return CameraOffer(tuple(formats), tuple(_ranges(descriptor, ask)))


def _asked(
    descriptor: int, ask: Ioctl, number: int, layout: str, given: bytes, read_only: bool = False
) -> tuple[int, ...]:
    """The fields of a structure after an ioctl of V4L2: _IOR or _IOWR of 'V', the number and the size."""
    data = bytearray(given.ljust(struct.calcsize(layout), b"\0"))
    direction = 2 if read_only else 3
    ask(descriptor, direction << 30 | len(data) << 16 | ord("V") << 8 | number, data)
    return struct.unpack(layout, data)


def _entries(descriptor: int, ask: Ioctl, number: int, layout: str, *key: int) -> Iterator[tuple[int, ...]]:
    """The entries of a list that a driver ends with an error."""
    for index in count():
        if index == _MAX_ENTRIES:
            return
        given = struct.pack(f"<{1 + len(key)}I", index, *key)
        try:
            yield _asked(descriptor, ask, number, layout, given)
        except OSError:
            return


def _pixel_formats(descriptor: int, ask: Ioctl) -> Iterator[tuple[int, str]]:
    for fields in _entries(descriptor, ask, _ENUM_FMT, _FORMAT, _BUFFER_TYPE):
        yield fields[4], fields[4].to_bytes(4, "little").decode("ascii", "replace").rstrip()


def _sizes(descriptor: int, ask: Ioctl, code: int) -> Iterator[tuple[int, int]]:
    """Discrete sizes, or the smallest and the largest of a range."""
    for fields in _entries(descriptor, ask, _ENUM_SIZES, _SIZE, code):
        if fields[2] == _DISCRETE:
            yield fields[3], fields[4]
            continue
        yield fields[3], fields[6]
        yield fields[4], fields[7]
        return


def _rates(descriptor: int, ask: Ioctl, code: int, size_px: tuple[int, int]) -> Iterator[float]:
    for fields in _entries(descriptor, ask, _ENUM_INTERVALS, _INTERVAL, code, *size_px):
        is_discrete = fields[4] == _DISCRETE
        for over, under in ((5, 6),) if is_discrete else ((7, 8), (5, 6)):
            if fields[over]:
                yield round(fields[under] / fields[over], 3)
        if not is_discrete:
            return


def _ranges(descriptor: int, ask: Ioctl) -> Iterator[CameraRange]:
    for name, number in _CONTROLS.items():
        try:
            fields = _asked(descriptor, ask, _QUERYCTRL, _CONTROL, struct.pack("<I", number))
        except OSError:
            continue
        if fields[7] & _DISABLED:
            continue
        factor, unit = _UNITS.get(name, (1.0, ""))
        least, most, step, usual = (round(factor * value, 4) for value in fields[3:7])
        yield CameraRange(name, least, most, step, usual, unit)
