"""Reading one case: its image, the extraction, its time beside the plain frame's, its score."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scoring.score import (
    EMPTY_SCORE,
    MarkerScore,
    promised_markers,
    score_markers,
    shortest_edges,
    wrong_markers,
)
from benchmarks.suites.stress.conditions import BY_NAME, LARGE_PX
from benchmarks.suites.stress.frames import CaseImage, cached_layout, plain_frame
from benchmarks.suites.stress.kinds import StressCase, make_frame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import STANDARD_SIZE, Truth
from extractor import Extractor, Markers, Status, parse_layout

MOST_LOST_LINES = 8
Image = NDArray[Any]


@dataclass(frozen=True)
class CaseResult:
    """One image read.

    Attributes:
        ms: processor time of the best run. ratio: to the plain frame's, the runs' median; NaN for other sizes of image.
        reason: the extractor's; an exception's text where it raised one.
    """

    case: StressCase
    score: MarkerScore
    ms: float
    ratio: float
    reason: str
    raised: bool


@cache
def cached_extractor(pattern: str, layers: int) -> Extractor:
    return Extractor(parse_layout(layout_to_json(cached_layout(pattern, layers))))


@cache
def render_plain_image(pattern: str) -> Image:
    return plain_frame(pattern, 0).shoot().image


def time_extraction(extractor: Extractor, image: Image) -> tuple[Markers, float]:
    """The markers, and ms of processor time."""
    started = time.process_time()
    markers = extractor.extract(image)
    return markers, 1e3 * (time.process_time() - started)


def layout_layers(shot: CaseImage) -> int:
    """Of the layout to look for: the scene's; the standard one's in images without a pattern."""
    return int(shot.scene.layout.marker_layer.max()) if shot.scene else 11


def read_case(
    case: StressCase, runs: int, *, timing: bool = True
) -> tuple[CaseResult, CaseImage, Markers | None]:
    """Shoot a case's image, extract, compare; an exception is a result, so that the suite goes on.

    Args:
        runs: how often it is read.
        timing: also read the plain frame, right before each run, to state the ratio.
    """
    kind = BY_NAME[case.kind]
    shot = make_frame(case, kind).shoot()
    pixels = shot.image.shape[0] * shot.image.shape[1]
    comparable = timing and shot.image.shape[:2] == STANDARD_SIZE[::-1]
    taken, ratios = [], []
    try:
        extractor = cached_extractor(case.pattern, layout_layers(shot))
        for _ in range(1 if pixels > LARGE_PX else runs):
            beside = math.nan
            if comparable:
                beside = time_extraction(
                    cached_extractor(case.pattern, 11), render_plain_image(case.pattern)
                )[1]
            markers, ms = time_extraction(extractor, shot.image)
            taken.append(ms)
            ratios.append(ms / beside)
    except Exception as error:
        return CaseResult(case, EMPTY_SCORE, math.nan, math.nan, repr(error), True), shot, None
    figures = score_markers(markers, shot, promised=kind.promised)
    reason = str(markers.reason) if markers.reason else ""
    return CaseResult(case, figures, min(taken), float(np.median(ratios)), reason, False), shot, markers


def warm_up() -> None:
    """Compile, so that no time of it is counted."""
    import cv2

    cv2.setNumThreads(1)
    cached_extractor("honeycomb", 11).extract(render_plain_image("honeycomb"))


def notable_lines(shot: CaseImage, markers: Markers | None) -> list[str]:
    """Every wrong marker with its place and error, and the first of those that should not be lost."""
    if markers is None or shot.scene is None:
        return []
    wrong, truth = find_wrong_markers(shot, markers)
    edge_px = shortest_edges(shot.scene.layout, truth)
    lost = promised_markers(shot.scene.layout, truth, shot.image.shape) & (markers.status == Status.LOST)
    lines = []
    for marker in [*np.flatnonzero(wrong), *np.flatnonzero(lost)[:MOST_LOST_LINES]]:
        x, y = truth.marker_xy_px[marker]
        status = Status(markers.status[marker]).name.lower()
        seen = "visible" if truth.visible[marker] else "not visible"
        line = f"marker {marker} {status}, truly at ({x:.1f}, {y:.1f}), {seen}, edge {edge_px[marker]:.1f} px"
        if wrong[marker]:
            error = np.linalg.norm(markers.xy_px[marker] - truth.marker_xy_px[marker])
            line += f": WRONG by {error:.1f} px"
        lines.append(line)
    return lines


def find_wrong_markers(shot: CaseImage, markers: Markers) -> tuple[NDArray[np.bool_], Truth]:
    """(M,) bool, and the truth of the pattern in the image that fits best."""
    assert shot.scene is not None
    layout = shot.scene.layout
    both = [(wrong_markers(markers, layout, truth), truth) for truth in shot.truths]
    return min(both, key=lambda one: int(one[0].sum()))


def draw_overlay(shot: CaseImage, case: StressCase, markers: Markers) -> NDArray[np.uint8]:
    """The extractor's own overlay, with a red line from every wrong marker to its true place."""
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
