"""Reading of one path-traced picture: counts of markers, squared errors over covariances, time, reason.

A marker is wrong if it is reported more than half an edge from its true place: its id is wrong if another marker's
place is nearer, else its position. In a picture without a pattern every reported marker is invented.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.timing import timed
from benchmarks.suites.photoreal.pictures import NO_PATTERN, TracedPicture, TracedTruth
from benchmarks.suites.scoring.calibration import squared_distances
from benchmarks.suites.scoring.wrong import wrong_markers
from cmpdesign.files.layout_json import layout_to_json
from extractor import Extractor, Markers, Reason, Reference, Status, parse_layout
from extractor.presets import Preset

WRONG_SHARE = 0.5  # of the edge at a marker; a marker with a larger error is wrong
# The places by which z is stated, and for which pictures.
DESIGNED, LINES, DEEP, SURFACE, WITH_DATA = (
    "as designed", "misregistered, scattered: crossings", "relief: half the height", "relief: black",
    "relief, height given: black",
)  # fmt: skip
PLACES = (DESIGNED, LINES, DEEP, SURFACE, WITH_DATA)


@dataclass(frozen=True, eq=False)
class TracedResult:
    """The result of one picture. Counts are of markers.

    Attributes:
        picture: the picture.
        visible: visible markers; 0 without a pattern.
        unmeasured: ids of the visible markers that are not measured.
        reported: markers with a position.
        wrong_ids, wrong_places: see the module.
        squares: ``PLACES`` -> (N,) errors of measured markers over their covariances.
        reason: the reader's reason; empty without one.
        is_reason_right: whether the truth agrees with the reason, or with its absence.
        ms: processor time of the fastest reading.
    """

    picture: TracedPicture
    visible: int
    unmeasured: tuple[int, ...]
    reported: int
    wrong_ids: int
    wrong_places: int
    squares: dict[str, NDArray[np.float64]]
    reason: str
    is_reason_right: bool
    ms: float

    @property
    def measured(self) -> int:
        """Visible markers that are measured."""
        return self.visible - len(self.unmeasured)

    @property
    def invented(self) -> int:
        """Markers that are reported where there is no pattern."""
        return self.reported if self.picture.family == NO_PATTERN else 0

    @property
    def is_read(self) -> bool:
        return self.reported > 0


def read_picture(picture: TracedPicture, preset: Preset = "balanced", runs: int = 1) -> TracedResult:
    """Read a picture with the layout of its pad, the side told; a pad with relief also with the cells' height."""
    truth = picture.truth
    extractor = _extractor(picture, preset, False)
    readings = [timed(partial(extractor.extract, picture.image)) for _ in range(runs)]
    markers = readings[0].result
    has_pattern = picture.family != NO_PATTERN
    squares = place_squares(markers, truth) if has_pattern else {}
    if has_pattern and truth.relief_mm:
        informed = _extractor(picture, preset, True).extract(picture.image)
        squares[WITH_DATA] = _squares(informed, truth.xy_lines_px)
    unmeasured = truth.visible & (markers.status != Status.MEASURED)
    wrong = wrong_markers(markers, truth.xy_px, WRONG_SHARE * truth.edge_px)
    return TracedResult(
        picture=picture,
        visible=int(truth.visible.sum()) if has_pattern else 0,
        unmeasured=tuple(np.flatnonzero(unmeasured).tolist()) if has_pattern else (),
        reported=int((markers.status != Status.LOST).sum()),
        wrong_ids=int(wrong.ids.sum()) if has_pattern else 0,
        wrong_places=int(wrong.places.sum()) if has_pattern else 0,
        squares=squares,
        reason=str(markers.reason or ""),
        is_reason_right=is_reason_right(markers, truth, extractor.layout, has_pattern),
        ms=min(one.cpu_ms for one in readings),
    )


@cache
def _extractor(picture: TracedPicture, preset: Preset, with_relief: bool) -> Extractor:
    return Extractor(reference_of(picture, with_relief), preset)


def reference_of(picture: TracedPicture, with_relief: bool = False) -> Reference:
    """The reader's layout of the picture's pad; see ``TracedTruth.layout``."""
    return parse_layout(layout_to_json(picture.truth.layout(with_relief)))


def place_squares(markers: Markers, truth: TracedTruth) -> dict[str, NDArray[np.float64]]:
    """The squared errors over covariances by ``PLACES``; without the height of the cells."""
    if truth.is_as_designed:
        return {DESIGNED: _squares(markers, truth.xy_px)}
    if not truth.relief_mm:
        return {LINES: _squares(markers, truth.xy_lines_px)}
    deep_px = truth.xy_lines_px + truth.xy_deep_px - truth.xy_px
    return {DEEP: _squares(markers, deep_px), SURFACE: _squares(markers, truth.xy_lines_px)}


def _squares(markers: Markers, true_px: NDArray[np.float64]) -> NDArray[np.float64]:
    measured = markers.status == Status.MEASURED
    return squared_distances((markers.xy_px - true_px)[measured], markers.cov_px2[measured])


def is_reason_right(markers: Markers, truth: TracedTruth, layout: Reference, has_pattern: bool) -> bool:
    """Whether the truth agrees with the reader's reason, or with its absence.

    Where there is no pattern, the reason must not presume one. Where there is one, triangles and colors are there, the
    white cell is lost only if it is not wholly visible, and markers are few only if fewer than half of the visible
    markers are reported.
    """
    reported = int((markers.status != Status.LOST).sum())
    if not has_pattern:
        return reported == 0 and markers.reason in (Reason.NO_PATTERN, Reason.NO_COLOR, Reason.AMBIGUOUS)
    is_few = 2 * reported < int(truth.visible.sum())
    if markers.reason is None:
        return not is_few
    if markers.reason is Reason.FEW_MARKERS:
        return is_few
    white_is_hidden = not truth.visible[layout.cell_corners[layout.reference_cell]].all()
    return markers.reason in (Reason.REFERENCE_LOST, Reason.AMBIGUOUS) and white_is_hidden
