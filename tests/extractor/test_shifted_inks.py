"""Inks that lie off, each by itself: markers and points of gridlines are stated between their two places."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scenes import standard_layout
from benchmarks.suites.scoring.calibration import Calibration, squared_distances, summarise
from benchmarks.suites.scoring.reading import cached_extractor
from cmpdesign.patterns.colors import BLACK
from extractor import Markers, Status, VirtualStatus

LAYERS, PITCH_PX, FINE = 7, 30.0, 8
INSIDE = 3 * LAYERS * (LAYERS - 1) + 1  # markers without the outermost layer
SIZE_PX = (560, 520)
# in the order of the colors' numbers; linear light, BGR
LIGHT = np.array([(45, 50, 200), (60, 150, 40), (190, 60, 45), (20, 20, 20), (230, 230, 230)])
SHIFTS_PX = np.array([(1.5, -0.6), (-1.2, -0.9), (-0.3, 1.5), (0, 0), (0.5, -0.5)])


class Shot(NamedTuple):
    """A flat pad whose inks lie off: where the inks agree, and where the sides of the cells cross, px."""

    markers: Markers
    agreed_px: NDArray[np.float64]
    crossing_px: NDArray[np.float64]

    def calibration(self, place_px: NDArray[np.float64]) -> Calibration:
        """Of the measured markers inside the pattern without those of the white cell, which has its own shift."""
        mine = (self.markers.status == Status.MEASURED)[4:INSIDE]
        error = (self.markers.xy_px - place_px)[4:INSIDE]
        return summarise([squared_distances(error[mine], self.markers.cov_px2[4:INSIDE][mine])])


@cache
def shot() -> Shot:
    """Drawn with polygons in eight times the size, one cell over the other; noise of 1.5 gray levels."""
    layout = standard_layout("honeycomb", LAYERS)
    pitch_mm = np.linalg.norm(layout.marker_xy_mm[1] - layout.marker_xy_mm[0])
    turn = np.array([(0.98, 0.2), (0.2, -0.98)]) * PITCH_PX / pitch_mm
    xy = layout.marker_xy_mm @ turn.T + 0.5 * np.array(SIZE_PX)
    picture = np.full((SIZE_PX[1] * FINE, SIZE_PX[0] * FINE, 3), 20, np.uint8)
    normals, products = [[] for _ in xy], [[] for _ in xy]
    for corners, color in zip(layout.cell_corners, layout.cell_color, strict=True):
        if color == BLACK:
            continue
        place = (xy[corners] + SHIFTS_PX[color] + 0.5) * FINE - 0.5
        cv2.fillPoly(picture, [np.round(place * 256).astype(np.int32)], LIGHT[color].tolist(), cv2.LINE_8, 8)
        for first, second in ((0, 1), (1, 2), (2, 0)):
            along = xy[corners[second]] - xy[corners[first]]
            normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            for marker in (corners[first], corners[second]):
                normals[marker].append(normal)
                products[marker].append(normal @ SHIFTS_PX[color])
    light = cv2.GaussianBlur(cv2.resize(picture, SIZE_PX, interpolation=cv2.INTER_AREA), (0, 0), 0.8) / 255
    values = 255 * (1.055 * light ** (1 / 2.4) - 0.055)  # sRGB
    values += np.random.default_rng(1).normal(0, 1.5, values.shape)
    image = np.clip(np.round(values), 0, 255).astype(np.uint8)
    crossing = [np.linalg.lstsq(n, p, rcond=None)[0] for n, p in zip(normals, products, strict=True)]
    return Shot(cached_extractor("honeycomb", LAYERS).extract(image), xy, xy + np.array(crossing))


def test_markers_lie_between_their_two_places_and_the_covariance_covers_both() -> None:
    """Solved together without the shifts, markers lie beyond the crossings by half of the distance."""
    found, agreed, crossing = shot()
    assert (found.status == Status.MEASURED).mean() > 0.97
    error = found.xy_px - 0.5 * (agreed + crossing)
    distance = np.abs(crossing - agreed)[4:INSIDE].mean()
    assert np.abs(error)[4:INSIDE].mean() < 0.12 * distance
    for place in (agreed, crossing):
        calibration = shot().calibration(place)
        assert 0.8 < calibration.z.value < 1.25 and calibration.beyond.value < 0.01


def test_points_of_gridlines_lie_between_the_markers_gridline_and_the_seen_one() -> None:
    found, agreed, _ = shot()
    layout = standard_layout("honeycomb", LAYERS)
    ends = agreed[layout.edges]
    share = (np.arange(layout.virtual_per_edge) + 1) / (layout.virtual_per_edge + 1)
    joined = ends[:, :1] + share[:, None] * (ends[:, 1:] - ends[:, :1])
    mine = found.virtual_status == VirtualStatus.MEASURED
    error = (found.virtual_xy_px - joined)[mine]
    calibration = summarise([squared_distances(error, found.virtual_cov_px2[mine])])
    assert mine.mean() > 0.9
    assert np.linalg.norm(error, axis=1).mean() < 0.7  # 1.07 of the seen gridlines
    assert 0.6 < calibration.z.value < 1.2 and calibration.beyond.value < 0.01
