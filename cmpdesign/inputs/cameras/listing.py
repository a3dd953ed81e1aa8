"""The cameras of this machine, and a camera by its path, its serial number or a part of its name."""

from __future__ import annotations

import re
import stat
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from cmpdesign.errors import InputError, SourceError
from cmpdesign.inputs.cameras.v4l2 import CameraOffer, offer_of
from cmpdesign.inputs.files import read_text
from cmpdesign.inputs.texts import visible

SYSTEM = Path("/sys/class/video4linux")
DEVICES = Path("/dev")
_DEVICE = re.compile(r"video(\d+)", re.ASCII)
_MAX_BYTES = 4096  # of a file of the kernel
_PARENTS = 4  # from a device to the USB device that has the serial number


@dataclass(frozen=True)
class ListedCamera:
    """A device of Linux that takes pictures.

    Attributes:
        number: as OpenCV counts it.
        path: its file.
        name: as the driver states it.
        serial: serial number; "" where there is none.
        by_id: a file that names the same camera after it was plugged in elsewhere; "" where there is none.
        offer: its formats, sizes, rates and ranges.
    """

    number: int
    path: str
    name: str
    serial: str
    by_id: str
    offer: CameraOffer


def list_cameras() -> list[ListedCamera]:
    """The cameras, by number; a device that takes no pictures, as one of meta data, is left out.

    Raises:
        SourceError: this system has no V4L2.
    """
    if not SYSTEM.parent.is_dir():
        raise SourceError("cameras are listed on Linux only; name a camera by its number, from 0")
    return sorted(_found(), key=lambda camera: camera.number)


def find_camera(text: str) -> ListedCamera | None:
    """The camera with this serial number, or with this text in its name; None if there is none.

    Raises:
        SourceError: several cameras.
    """
    if not text or not SYSTEM.is_dir():
        return None
    cameras = list_cameras()
    found = [camera for camera in cameras if camera.serial == text]
    found = found or [camera for camera in cameras if text.lower() in camera.name.lower()]
    if len(found) > 1:
        names = ", ".join(f"{camera.path} ({camera.name}, serial {camera.serial})" for camera in found)
        raise SourceError(
            f"{text}: {len(found)} cameras have this name: {names}; give the path or the serial"
        )
    return found[0] if found else None


def camera_of_path(text: str) -> int | None:
    """The number of a camera by its file, or by a link to it; None for another file."""
    path = Path(text)
    with suppress(OSError, ValueError):
        if stat.S_ISCHR(path.stat().st_mode) and (match := _DEVICE.fullmatch(path.resolve().name)):
            return int(match[1])
    return None


def _found() -> Iterator[ListedCamera]:
    by_id = {link.resolve(): str(link) for link in sorted((DEVICES / "v4l" / "by-id").glob("*"))}
    for entry in SYSTEM.glob("video*"):
        match = _DEVICE.fullmatch(entry.name)
        if match is None:
            continue
        path = DEVICES / entry.name
        offer = offer_of(str(path))
        if offer.formats or offer.problem.startswith("cannot"):
            name = _text(entry / "name") or entry.name
            yield ListedCamera(int(match[1]), str(path), name, _serial(entry), by_id.get(path, ""), offer)


def _serial(entry: Path) -> str:
    device = (entry / "device").resolve()
    parents = (device, *list(device.parents)[:_PARENTS])
    return next((text for parent in parents if (text := _text(parent / "serial"))), "")


def _text(path: Path) -> str:
    try:
        return visible(read_text(path, _MAX_BYTES).strip())[:100]
    except InputError:
        return ""
