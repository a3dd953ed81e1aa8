"""Pictures that are not read, one for each reason of the reader, in the order of the reasons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.scene import Blob, Camera, Damage, Gradient, Optics, Scene, Sensor, render
from extractor import Reason, Reference, parse_layout

Picture = NDArray[np.uint8]
SIZE_PX = (320, 240)
LAYERS = 6
CODE_SHOWN, CODE_READ = 1, 2
COVER = 90  # gray level of what lies on the pattern
WHITE, BLACK = COLORS.index("white"), COLORS.index("black")


@dataclass(frozen=True, eq=False)
class Failure:
    """A picture (H, W, 3) uint8 BGR that gives a reason, and the layout with which it is read."""

    reason: Reason
    image: Picture
    layout: Reference


@cache
def pattern(code: int = 0) -> Layout:
    """The layout with which the pictures are read; with a code, for the picture of another code."""
    return build_layout(Design(pattern="honeycomb", layers=LAYERS, pitch_mm=1.5, code=code))


@cache
def pattern_reference(code: int = 0) -> Reference:
    """The same as the reader has it."""
    return parse_layout(layout_to_json(pattern(code)))


def figures() -> dict[str, bytes]:
    """File name -> JPEG."""
    options = [cv2.IMWRITE_JPEG_QUALITY, 82]
    return {
        f"reason-{one.reason}.jpg": bytes(cv2.imencode(".jpg", one.image, options)[1]) for one in failures()
    }


@cache
def failures() -> tuple[Failure, ...]:
    """A picture for each reason."""
    makers: dict[Reason, Callable[[], Picture]] = {
        Reason.NO_COLOR: gray,
        Reason.NO_PATTERN: out_of_focus,
        Reason.REFERENCE_LOST: covered_centre,
        Reason.AMBIGUOUS: two_bright_drops,
        Reason.SEVERAL_PADS: two_pads,
        Reason.OTHER_CODE: another_code,
        Reason.OTHER_SIDE: other_side_in_other_inks,
        Reason.MIRRORED: mirrored,
        Reason.SWAPPED_CHANNELS: swapped,
        Reason.FEW_MARKERS: mostly_covered,
    }
    read = {Reason.OTHER_CODE: pattern_reference(CODE_READ)}
    return tuple(
        Failure(reason, makers[reason](), read.get(reason, pattern_reference())) for reason in Reason
    )


def view(layout: Layout | None = None, pitch_px: float = 15.0, **changes: object) -> Picture:
    """A picture of the pattern that would be read."""
    scene = Scene(
        layout or pattern(),
        Camera(pitch_px, rotation_deg=8.0, tilt_deg=10.0, tilt_axis_deg=30.0),
        background=Gradient((150.0, 150.0, 152.0), (96.0, 97.0, 100.0), 60.0),
        optics=Optics(0.8),
        sensor=Sensor(noise=1.0),
        seed=7,
    )
    return render(replace(scene, **changes), size=SIZE_PX).image.astype(np.uint8)


def gray() -> Picture:
    return np.asarray(cv2.cvtColor(cv2.cvtColor(view(), cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR), np.uint8)


def out_of_focus() -> Picture:
    return view(pitch_px=6.0, optics=Optics(4.0))


def covered_centre() -> Picture:
    """Dirt over the white cell, and half of the pad beyond the picture: neither cell nor outline is seen."""
    return view(pitch_px=34.0, damage=Damage(blobs=(Blob((0.0, 0.8), 1.6, (60.0, 70.0, 80.0)),)))


def two_bright_drops() -> Picture:
    """Drops on two black cells, the white cell under dirt, and a ring of dirt that hides the rim."""
    layout = pattern()
    centres_mm = layout.marker_xy_mm[layout.cell_corners].mean(axis=1)
    black_mm = centres_mm[layout.cell_color == BLACK]
    white_mm = centres_mm[layout.cell_color == WHITE][0]
    places = (white_mm + (1.5, -2.6), white_mm + (-1.5, -2.6))
    drops = tuple(
        Blob(tuple(black_mm[np.linalg.norm(black_mm - place, axis=1).argmin()]), 0.4, (240.0, 240.0, 240.0))
        for place in places
    )
    dirt = Blob(tuple(white_mm), 0.8, (20.0, 20.0, 20.0))
    return framed(view(damage=Damage(blobs=(*drops, dirt))), 60)


def two_pads() -> Picture:
    return np.hstack([view(pitch_px=11.0)[:, 80:240]] * 2)


def another_code() -> Picture:
    return view(pattern(CODE_SHOWN))


def mirrored() -> Picture:
    return np.ascontiguousarray(view()[:, ::-1])


def other_side_in_other_inks() -> Picture:
    """The back of a pattern whose inks are as near to the palette's as to those with red and blue swapped."""
    inks = {**pattern().palette, "red": "#c3372d", "green": "#329632", "blue": "#2d37c3"}
    return np.ascontiguousarray(view(replace(pattern(), palette=inks))[:, ::-1])


def swapped() -> Picture:
    return np.ascontiguousarray(view()[..., ::-1])


def mostly_covered() -> Picture:
    image = view().copy()
    image[126:], image[:, :110] = COVER, COVER
    return image


def framed(image: Picture, radius_px: int) -> Picture:
    """The image with all but a disc around its middle covered."""
    shown = np.zeros(image.shape[:2], np.uint8)
    cv2.circle(shown, (SIZE_PX[0] // 2, SIZE_PX[1] // 2), radius_px, 1, -1)
    return np.where(shown[..., None] > 0, image, np.uint8(COVER))
