"""``cmpdesign cameras``: lists the cameras of this machine."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

from cmpdesign.api import sequences
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import say, say_text
from cmpdesign.inputs.texts import visible

if TYPE_CHECKING:
    from cmpdesign.documents.runs import CameraFormatPart, CamerasDocument, ListedCameraPart

EXAMPLES = ("cmpdesign cameras", "cmpdesign cameras --json")


@derived(sequences.cameras, "listing")
def cameras(found: CamerasDocument) -> None:
    """track takes a camera by its number, its file, its serial number or a part of its name."""
    if not found.cameras:
        say("no camera is connected")
    for camera in found.cameras:
        say_text("\n".join(map(visible, _lines(camera))) + "\n")


def _size_text(each: CameraFormatPart) -> str:
    rates = ", ".join(f"{fps:g}" for fps in each.fps)
    return f"{each.size_px[0]}x{each.size_px[1]}" + (f" at {rates}" if rates else "")


def _lines(camera: ListedCameraPart) -> Iterator[str]:
    serial = f", serial {camera.serial}" if camera.serial else ""
    yield f"camera {camera.number}: {camera.name}{serial}"
    yield f"  {camera.path}" + (f"  {camera.by_id}" if camera.by_id else "")
    if camera.problem:
        yield f"  {camera.problem}"
    for letters, sizes in groupby(camera.formats, key=lambda each: each.format):
        yield f"  {letters}  {'; '.join(map(_size_text, sizes))}"
    for each in camera.ranges:
        unit = f" {each.unit}" if each.unit else ""
        yield f"  {each.name}  {each.least:g} to {each.most:g}{unit}, usually {each.usual:g}"
