"""Processor time of a whole coded pad and of the plain one, read in turns; the least of many readings."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2

from benchmarks.frame.timing import least_in_turns
from benchmarks.pad_codes.families import coded_layout
from cmpdesign.scene import Camera, Optics, Scene, Sensor, render
from extractor import Extractor


class Case(NamedTuple):
    """Layers, edges in px, and width and height of the picture."""

    layers: int
    pitch_px: float
    size: tuple[int, int]


CASES = (Case(10, 20.0, (640, 480)), Case(20, 12.0, (640, 480)), Case(20, 20.0, (960, 800)))
CODE, ROTATION_DEG, BLUR_SHARE = 7, 7.3, 0.05  # blur as a share of the edges


def least_ms(case: Case, readings: int) -> tuple[float, float]:
    """Of the plain pad, and of the coded one; one thread."""
    cv2.setNumThreads(1)

    def reading(code: int) -> Callable[[int], object]:
        layout = coded_layout(case.layers, code)
        camera, optics = Camera(case.pitch_px, ROTATION_DEG), Optics(BLUR_SHARE * case.pitch_px)
        scene = Scene(layout, camera, optics=optics, sensor=Sensor(noise=2.0), seed=3)
        image, reader = render(scene, size=case.size).image, Extractor(layout.reference())
        return lambda _: reader.extract(image)

    least = least_in_turns({"plain": reading(0), "coded": reading(CODE)}, readings)
    return least["plain"].cpu_ms, least["coded"].cpu_ms
