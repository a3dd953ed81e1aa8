"""Scores of extractions against the truth: found and wrong markers, and whether the promise applies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import rms_of
from benchmarks.suites.scenes import WRONG_SHARE, shortest_edges
from benchmarks.suites.scoring.wrong import WrongMarkers, wrong_markers
from benchmarks.suites.stress.frames import CaseImage
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, WHITE
from cmpdesign.scene import Scene, Truth
from cmpdesign.scene.parts.light import light_gain
from extractor.result import Markers, Status

PROMISED_EDGE_PX, PROMISED_BLUR, PROMISED_NOISE = 8.0, 1 / 5, 1 / 10  # px, of the edge, of the contrast
MIN_RIM_DISTANCE_PX = 2.0  # nearer to the image's rim a marker's surroundings are incomplete
PITCH_ROUNDING = 1e-6  # tolerance of the smallest edge
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class MarkerScore:
    """Counts of markers.

    Attributes:
        visible: visible by the truth; of these measured, repaired, fitted, lost.
        reported: not lost, visible or not.
        wrong: reported with an error above 0.3 of the shortest edge; ``others`` of them are nearest to another marker.
        outside: reported with a true position outside the image.
        hidden: reported with a true position inside the image, but not visible.
        sure: markers of ``promised_markers``.
        kept: measured or repaired markers of ``promised_markers``, not wrong.
        promised: at least 99 % of the promised markers must be kept.
        rms_px: per axis, of measured markers that are not wrong.
        repaired_rms_px: per axis, of repaired and fitted markers that are not wrong.
    """

    visible: int
    measured: int
    repaired: int
    fitted: int
    lost: int
    reported: int
    wrong: int
    others: int
    outside: int
    hidden: int
    sure: int
    kept: int
    promised: bool
    rms_px: float
    repaired_rms_px: float


def score_markers(markers: Markers, shot: CaseImage, *, promised: bool) -> MarkerScore:
    """The best score over the patterns in the image; without a pattern all reported markers are wrong."""
    if shot.scene is None:
        reported = int((markers.status != Status.LOST).sum())
        return replace(EMPTY_SCORE, reported=reported, wrong=reported)
    scene = shot.scene
    one = promised and len(shot.truths) == 1
    scores = [_score_pattern(markers, truth, scene, shot.image.shape, promised=one) for truth in shot.truths]
    return min(scores, key=lambda result: (result.wrong, -result.reported))


def wrong_in_scene(markers: Markers, layout: Layout, truth: Truth) -> WrongMarkers:
    """The markers with an error above 0.3 of the shortest edge."""
    true_px = truth.marker_xy_px
    return wrong_markers(markers, true_px, WRONG_SHARE * shortest_edges(layout, true_px))


def promised_markers(layout: Layout, truth: Truth, shape: tuple[int, ...]) -> Bools:
    """(M,) bool: visible markers off the image's rim that are corners of a visible colored or white cell."""
    touching = np.zeros(len(truth.visible), dtype=np.bool_)
    touching[layout.cell_corners[truth.cell_visible & (layout.cell_color != BLACK)]] = True
    from_rim = np.minimum(truth.marker_xy_px, np.array(shape[1::-1]) - 1 - truth.marker_xy_px).min(axis=1)
    return np.asarray(touching & truth.visible & (from_rim >= MIN_RIM_DISTANCE_PX))


def _score_pattern(
    markers: Markers, truth: Truth, scene: Scene, shape: tuple[int, ...], *, promised: bool
) -> MarkerScore:
    status, layout, visible = markers.status, scene.layout, truth.visible
    swapped, misplaced = wrong_in_scene(markers, layout, truth)
    wrong = swapped | misplaced
    reported = status != Status.LOST
    true_px = truth.marker_xy_px
    inside = np.all((true_px >= -0.5) & (true_px < np.array(shape[1::-1]) - 0.5), axis=1)
    promised_mask = promised_markers(layout, truth, shape)
    counts = {name: int((status[visible] == name).sum()) for name in Status}
    return MarkerScore(
        visible=int(visible.sum()),
        measured=counts[Status.MEASURED],
        repaired=counts[Status.REPAIRED],
        fitted=counts[Status.FITTED],
        lost=counts[Status.LOST],
        reported=int(reported.sum()),
        wrong=int(wrong.sum()),
        others=int(swapped.sum()),
        outside=int((reported & ~inside).sum()),
        hidden=int((reported & inside & ~visible).sum()),
        sure=int(promised_mask.sum()),
        kept=int((promised_mask & ~wrong & np.isin(status, (Status.MEASURED, Status.REPAIRED))).sum()),
        promised=promised and bool(promised_mask.any()) and _is_promised(scene, truth, promised_mask, shape),
        rms_px=_rms(markers, truth, (status == Status.MEASURED) & ~wrong),
        repaired_rms_px=_rms(markers, truth, (status > Status.MEASURED) & ~wrong),
    )


def _rms(markers: Markers, truth: Truth, chosen: Bools) -> float:
    return rms_of(markers.xy_px[chosen] - truth.marker_xy_px[chosen])


def _is_promised(scene: Scene, truth: Truth, promised_mask: Bools, shape: tuple[int, ...]) -> bool:
    """Whether the promise applies: visible white cell, edges of 8 px, limits of blur and noise."""
    edge_px = float(shortest_edges(scene.layout, truth.marker_xy_px)[promised_mask].min()) * (
        1 + PITCH_ROUNDING
    )
    noise = scene.sensor.noise if scene.sensor else 0.0
    return (
        bool(truth.cell_visible[scene.layout.reference_cell])
        and edge_px >= PROMISED_EDGE_PX
        and scene.blur_px <= PROMISED_BLUR * edge_px
        and noise <= PROMISED_NOISE * smallest_contrast(scene, truth, (shape[1], shape[0]))
    )


def smallest_contrast(scene: Scene, truth: Truth, size: tuple[int, int]) -> float:
    """The smallest contrast of the visible colored cells to black under the light, largest channel, 8-bit units."""
    layout = scene.layout
    cells = np.flatnonzero(truth.cell_visible & (layout.cell_color != BLACK) & (layout.cell_color != WHITE))
    if not len(cells):
        return 0.0
    black = np.array(scene.ink(BLACK)[::-1])
    ink = np.array([scene.ink(int(color))[::-1] for color in layout.cell_color[cells]])
    light = np.ones((len(cells), 3))
    if scene.light:
        centre = truth.marker_xy_px[layout.cell_corners[cells]].mean(axis=1)
        x, y = np.clip(np.rint(centre), 0, np.asarray(size) - 1).astype(int).T
        light = light_gain(scene.light, size)[:, y, x].T.astype(np.float64)
    contrast = np.minimum(light * ink, 255) - np.minimum(light * black, 255)
    return float(contrast.max(axis=1).min())


EMPTY_SCORE = MarkerScore(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, False, float("nan"), float("nan"))
