"""The compared methods: each reads points from an image of the pattern or of the checkerboard, with its time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.article.method import ArticleReader
from benchmarks.suites.scenes import (
    BOARD_LAYERS,
    SceneCase,
    cached_extractor,
    cached_reference,
    make_extractor,
)
from extractor import Extractor
from extractor.presets import Preset

Image = NDArray[np.uint8]
Points = NDArray[np.float64]
INNER_CORNERS = (2 * BOARD_LAYERS, 2 * BOARD_LAYERS)
SB_FLAGS = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
# Of cornerSubPix: 11 px, the largest window with one corner only at a pitch of 20 px, tilted.
HALF_WINDOW_PX = 5
SUBPIX_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
REFERENCE_METHOD = "OpenCV findChessboardCornersSB"
MEASURING_STAGES = ("refine", "repair")  # the stages after the 7th


@dataclass(frozen=True, eq=False)
class FoundPoints:
    """The points of a method in one image.

    Attributes:
        points: (M, 2) px by marker id, NaN where lost, or (N, 2) px without numbers.
        ms: processor time, which excludes other processes.
        cov_px2: (M, 2, 2) px^2, the stated covariances; None if the method states none.
    """

    points: Points
    ms: float
    cov_px2: Points | None = None


@dataclass(frozen=True)
class Method:
    """A method.

    Attributes:
        name: the method's name in tables.
        board: the method reads the checkerboard.
        numbered: the points are by marker id.
        read: the function that reads an image.
    """

    name: str
    board: bool
    numbered: bool
    read: Callable[[SceneCase, Image], FoundPoints]


@cache
def method_extractor(case: SceneCase, preset: Preset, points: bool = True) -> Extractor:
    """An extractor of the case's pattern, with or without virtual markers (``points``)."""
    if points:
        return cached_extractor(case, preset)
    reference = replace(cached_reference(case.pattern, case.layers), virtual_per_edge=0)
    return make_extractor(reference, preset, case.response)


def extractor_method(preset: Preset, points: bool = True) -> Method:
    """A preset; without virtual markers (``points``) the extractor measures the same points as other detectors."""

    def read(case: SceneCase, image: Image) -> FoundPoints:
        reader = method_extractor(case, preset, points)
        started = time.process_time()
        found = reader.extract(image)
        return FoundPoints(found.xy_px, _elapsed_ms(started), found.cov_px2)

    return Method(f"cmpdesign, {preset}" + ("" if points else ", markers only"), False, True, read)


def read_numbered_corners(case: SceneCase, image: Image) -> FoundPoints:
    """Stages 1 to 7: corners fitted to the edges of each triangle separately, and merged."""
    reader = method_extractor(case, "balanced")
    started = time.process_time()
    markers = reader.extract(image)
    ms, stages_ms = _elapsed_ms(started), markers.timings_ms
    measuring = sum(stages_ms[stage] for stage in MEASURING_STAGES) / sum(stages_ms.values())
    return FoundPoints(markers.stages["place"].xy_px, ms * (1 - measuring))


def read_subpix_by_id(case: SceneCase, image: Image) -> FoundPoints:
    """Stages 1 to 7, then OpenCV's cornerSubPix on the gray image."""
    coarse = read_numbered_corners(case, image)
    started = time.process_time()
    points = coarse.points.copy()
    found = np.flatnonzero(np.isfinite(points[:, 0]))
    points[found] = _refine_sub_pixel(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), points[found])
    return FoundPoints(points, coarse.ms + _elapsed_ms(started))


@cache
def article_reader(pattern: str, layers: int) -> ArticleReader:
    return ArticleReader(cached_reference(pattern, layers))


def read_by_article(case: SceneCase, image: Image) -> FoundPoints:
    """The article's method: regions by AGA, triangles fitted to contours, merged and averaged corners, SSA."""
    reader = article_reader(case.pattern, case.layers)
    started = time.process_time()
    points = np.full((len(cached_reference(case.pattern, case.layers).layer), 2), np.nan)
    triangles, found = reader.read(image)
    if found is not None:
        ids = found.marker_of_corner.reshape(-1)
        corner = triangles.corner_px.reshape(-1, 2)[ids >= 0]
        count = np.bincount(ids[ids >= 0], minlength=len(points))
        sums = [np.bincount(ids[ids >= 0], corner[:, axis], len(points)) for axis in (0, 1)]
        points[count > 0] = np.stack(sums, axis=1)[count > 0] / count[count > 0, None]
    return FoundPoints(points, _elapsed_ms(started))


def read_chessboard_sb(case: SceneCase, image: Image) -> FoundPoints:
    """OpenCV's findChessboardCornersSB."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    started = time.process_time()
    _, corners = cv2.findChessboardCornersSB(gray, INNER_CORNERS, None, SB_FLAGS)
    return FoundPoints(_as_points(corners), _elapsed_ms(started))


def read_chessboard(case: SceneCase, image: Image) -> FoundPoints:
    """OpenCV's findChessboardCorners with cornerSubPix."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    started = time.process_time()
    found, corners = cv2.findChessboardCorners(gray, INNER_CORNERS)
    points = _refine_sub_pixel(gray, _as_points(corners)) if found else np.empty((0, 2))
    return FoundPoints(points, _elapsed_ms(started))


def chess_corners_reader(refiner: str) -> Callable[[SceneCase, Image], FoundPoints]:
    """The ChESS detector of the package chess-corners with one of its refiners."""

    @cache
    def detector() -> Any:
        import chess_corners as package

        chosen = getattr(package.ChessRefiner, refiner)()
        return package.Detector(package.DetectorConfig.chess().with_chess(refiner=chosen))

    def read(case: SceneCase, image: Image) -> FoundPoints:
        gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        started = time.process_time()
        points = detector().detect(gray).xy
        return FoundPoints(points.astype(np.float64), _elapsed_ms(started))

    return read


def _refine_sub_pixel(gray: Image, points: Points) -> Points:
    corners = points.astype(np.float32)[:, None].copy()
    half = (HALF_WINDOW_PX, HALF_WINDOW_PX)
    return _as_points(cv2.cornerSubPix(gray, corners, half, (-1, -1), SUBPIX_STOP))


def _as_points(corners: Any) -> Points:
    return np.empty((0, 2)) if corners is None else np.asarray(corners, np.float64).reshape(-1, 2)


def _elapsed_ms(started: float) -> float:
    return 1e3 * (time.process_time() - started)


METHODS = (
    extractor_method("balanced", points=False),
    extractor_method("balanced"),
    extractor_method("accurate"),
    Method("the article's AGA corners", False, True, read_by_article),
    Method("our stages 1 to 7 alone", False, True, read_numbered_corners),
    Method("cornerSubPix on our ids", False, True, read_subpix_by_id),
    Method("chess-corners, saddle point, on ours", False, False, chess_corners_reader("saddle_point")),
    Method(REFERENCE_METHOD, True, False, read_chessboard_sb),
    Method("OpenCV findChessboardCorners + cornerSubPix", True, False, read_chessboard),
    Method("chess-corners, its default", True, False, chess_corners_reader("center_of_mass")),
    Method("chess-corners, saddle point", True, False, chess_corners_reader("saddle_point")),
)
