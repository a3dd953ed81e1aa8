"""Reading of one case: its image, the extraction, its time relative to the plain frame's time, its score."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.timing import timed
from benchmarks.suites.scenes import shortest_edges, standard_layout
from benchmarks.suites.scoring.score import (
    EMPTY_SCORE,
    MarkerScore,
    promised_markers,
    score_markers,
    wrong_in_scene,
)
from benchmarks.suites.scoring.squares import PictureSquares, nearest_truth, picture_squares
from benchmarks.suites.stress.conditions import BY_NAME, LARGE_PX
from benchmarks.suites.stress.frames import CaseImage, plain_frame
from benchmarks.suites.stress.kinds import StressCase, make_frame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import STANDARD_SIZE, Truth
from extractor import Extractor, Markers, Status, parse_layout

MAX_LOST_LINES = 8
Image = NDArray[Any]


@dataclass(frozen=True)
class CaseResult:
    """The result of one image.

    Attributes:
        case: the case.
        score: counts of markers.
        ms: processor time of the best run.
        ratio: median ratio of times to the plain frame's time; NaN for other sizes of image.
        reason: the extractor's reason, or the text of its exception.
        raised: the extractor raised an exception.
        squares: errors over stated covariances; empty without a pattern or markers.
    """

    case: StressCase
    score: MarkerScore
    ms: float
    ratio: float
    reason: str
    raised: bool
    squares: PictureSquares = field(default_factory=dict, compare=False, repr=False)


class CaseReading(NamedTuple):
    """A case's result, its image, and the markers; None if the extractor raised an exception."""

    result: CaseResult
    shot: CaseImage
    markers: Markers | None


@cache
def cached_extractor(pattern: str, layers: int) -> Extractor:
    """An extractor that reads both sides: one condition shows the back."""
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, layers))), side="either")


@cache
def render_plain_image(pattern: str) -> Image:
    return plain_frame(pattern, 0).shoot().image


def layout_layers(shot: CaseImage) -> int:
    """Layers of the layout to search: the scene's layers, or 11 in images without a pattern."""
    return int(shot.scene.layout.marker_layer.max()) if shot.scene else 11


def read_case(case: StressCase, runs: int, *, timing: bool = True) -> CaseReading:
    """Render a case's image, extract and score. An exception of the extractor is a result.

    Args:
        case: the case.
        runs: number of extractions.
        timing: read the plain frame before each extraction, to measure the ratio of times.
    """
    kind = BY_NAME[case.kind]
    shot = make_frame(case, kind).shoot()
    pixels = shot.image.shape[0] * shot.image.shape[1]
    comparable = timing and shot.image.shape[:2] == STANDARD_SIZE[::-1]
    times_ms, ratios = [], []
    try:
        extractor = cached_extractor(case.pattern, layout_layers(shot))
        for _ in range(1 if pixels > LARGE_PX else runs):
            plain_ms = math.nan
            if comparable:
                plain, image = cached_extractor(case.pattern, 11), render_plain_image(case.pattern)
                plain_ms = timed(partial(plain.extract, image)).cpu_ms
            markers, ms, _ = timed(partial(extractor.extract, shot.image))
            times_ms.append(ms)
            ratios.append(ms / plain_ms)
    except Exception as error:
        failed = CaseResult(case, EMPTY_SCORE, math.nan, math.nan, repr(error), True)
        return CaseReading(failed, shot, None)
    score = score_markers(markers, shot, promised=kind.promised)
    reason = "" if markers.found else str(markers.reason)
    squares = picture_squares(markers, nearest_truth(markers, shot.truths)) if shot.truths else {}
    result = CaseResult(case, score, min(times_ms), float(np.median(ratios)), reason, False, squares)
    return CaseReading(result, shot, markers)


def notable_lines(shot: CaseImage, markers: Markers | None) -> list[str]:
    """Lines on every wrong marker with position and error, and on the first markers that should not be lost."""
    if markers is None or shot.scene is None:
        return []
    wrong, truth = find_wrong_markers(shot, markers)
    edge_px = shortest_edges(shot.scene.layout, truth.marker_xy_px)
    lost = promised_markers(shot.scene.layout, truth, shot.image.shape) & (markers.status == Status.LOST)
    lines = []
    for marker in [*np.flatnonzero(wrong), *np.flatnonzero(lost)[:MAX_LOST_LINES]]:
        x, y = truth.marker_xy_px[marker]
        status = Status(markers.status[marker]).name.lower()
        visibility = "visible" if truth.visible[marker] else "not visible"
        line = (
            f"marker {marker} {status}, truth ({x:.1f}, {y:.1f}), {visibility}, edge {edge_px[marker]:.1f} px"
        )
        if wrong[marker]:
            error = np.linalg.norm(markers.xy_px[marker] - truth.marker_xy_px[marker])
            line += f": WRONG by {error:.1f} px"
        lines.append(line)
    return lines


def find_wrong_markers(shot: CaseImage, markers: Markers) -> tuple[NDArray[np.bool_], Truth]:
    """(M,) bool: the wrong markers, and the truth of the pattern with the fewest wrong markers."""
    assert shot.scene is not None
    layout = shot.scene.layout
    both = [(wrong_in_scene(markers, layout, truth).any_kind, truth) for truth in shot.truths]
    return min(both, key=lambda one: int(one[0].sum()))


def draw_overlay(shot: CaseImage, case: StressCase, markers: Markers) -> NDArray[np.uint8]:
    """The extractor's overlay with a red line from every wrong marker to its true position."""
    import cv2

    from extractor.draw import draw_markers

    extractor = cached_extractor(case.pattern, layout_layers(shot))
    canvas = draw_markers(shot.image, extractor.layout, markers)
    if shot.scene is not None:
        scale = canvas.shape[0] / shot.image.shape[0]
        wrong, truth = find_wrong_markers(shot, markers)
        for marker in np.flatnonzero(wrong):
            ends = ((np.stack([markers.xy_px[marker], truth.marker_xy_px[marker]]) + 0.5) * scale).astype(int)
            cv2.line(canvas, tuple(ends[0].tolist()), tuple(ends[1].tolist()), (0, 0, 255), 2, cv2.LINE_AA)
            cv2.circle(canvas, tuple(ends[0].tolist()), 7, (0, 0, 255), 2, cv2.LINE_AA)
    return canvas
