"""Processor time of a whole coded pad and of the plain one, read in turns; the least of many readings."""

from __future__ import annotations

import time
from typing import NamedTuple

import cv2

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
    readers, images, least = [], [], [float("inf")] * 2
    for code in (0, CODE):
        layout = coded_layout(case.layers, code)
        camera, optics = Camera(case.pitch_px, ROTATION_DEG), Optics(BLUR_SHARE * case.pitch_px)
        scene = Scene(layout, camera, optics=optics, sensor=Sensor(noise=2.0), seed=3)
        images.append(render(scene, size=case.size).image)
        readers.append(Extractor(layout.reference()))
    for _ in range(readings):
        for k in (0, 1):
            started = time.process_time()
            readers[k].extract(images[k])
            least[k] = min(least[k], 1e3 * (time.process_time() - started))
    return least[0], least[1]
