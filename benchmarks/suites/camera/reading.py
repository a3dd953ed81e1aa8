"""Reading of one picture of the suite: the markers, their errors, their errors over stated covariances, the time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.timing import timed
from benchmarks.suites.camera.cases import CameraCase, sample_chain
from benchmarks.suites.camera.shoot import CameraPicture, shoot
from benchmarks.suites.scenes import WRONG_SHARE, shortest_edges, standard_layout
from benchmarks.suites.scoring.calibration import squared_distances
from benchmarks.suites.scoring.contrast import neighbour_contrast
from benchmarks.suites.scoring.wrong import wrong_markers
from cmpdesign.files.layout_json import layout_to_json
from extractor import Extractor, Markers, Status, parse_layout
from extractor.presets import Preset

RUNS = 2  # readings of a picture
NO_REASON = "no reason given"
# a marker's outcome as one letter
UNSEEN, MEASURED, ESTIMATED, LOST, WRONG_PLACE, WRONG_ID = ".merpi"


@dataclass(frozen=True, eq=False)
class PictureResult:
    """The result of one picture. Counts are of markers.

    Attributes:
        case: the picture.
        outcomes: one letter for each marker: not visible, measured, repaired or fitted, lost, reported with an error
            above ``WRONG_SHARE`` of the shortest edge, reported at another marker's place. The last two are given to
            markers that are not visible, too.
        d2: (N,) errors over stated covariances of all measured markers, wrong ones included.
        squared_px2: sum of the squared errors of both axes over ``right`` markers.
        right: markers that are visible, measured and not wrong.
        measured: markers that are visible and measured, wrong ones included.
        visible: visible markers.
        ms: processor time of the faster of two readings; the first one may load modules. NaN where not known.
        reason: the extractor's reason, or the text of its exception; empty if there is none.
        contrast: CIE76 of neighbouring cells, see ``neighbour_contrast``.
        raised: the extractor raised an exception.
    """

    case: CameraCase
    outcomes: str
    d2: NDArray[np.float64]
    squared_px2: float
    right: int
    measured: int
    visible: int
    ms: float
    reason: str = ""
    contrast: float = float("nan")
    raised: bool = False

    @property
    def pitch_px(self) -> float:
        """Of its pattern."""
        return sample_chain(self.case).pose.pitch_px

    @property
    def reported(self) -> int:
        """Visible markers that are not lost."""
        return self.visible - self.outcomes.count(LOST)

    @property
    def wrong_ids(self) -> int:
        return self.outcomes.count(WRONG_ID)

    @property
    def wrong_places(self) -> int:
        return self.outcomes.count(WRONG_PLACE)

    @property
    def is_unread(self) -> bool:
        """No marker is reported."""
        return not self.outcomes.strip(UNSEEN + LOST)

    @property
    def measured_share(self) -> float:
        return self.measured / self.visible if self.visible else 0.0

    @property
    def rms_px(self) -> float:
        """See the function."""
        return rms_px([self])


def rms_px(results: Sequence[PictureResult]) -> float:
    """RMS error per axis of the right markers of all pictures; NaN without any."""
    right = 2 * sum(result.right for result in results)
    return math.sqrt(sum(result.squared_px2 for result in results) / right) if right else math.nan


@cache
def cached_extractor(pattern: str, layers: int, preset: Preset, code: int = 0) -> Extractor:
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, layers, code))), preset)


def read_case(case: CameraCase, preset: Preset) -> PictureResult:
    """Make the picture of a case, read and score it. An exception of the extractor is a result."""
    chain = sample_chain(case)
    picture = shoot(chain)
    extractor = cached_extractor(chain.pose.pattern, chain.pose.layers, preset)
    try:
        runs = [timed(partial(extractor.extract, picture.image)) for _ in range(RUNS)]
    except Exception as error:
        return raised_result(case, picture, repr(error))
    return score_picture(case, picture, runs[0].result, min(one.cpu_ms for one in runs))


def raised_result(case: CameraCase, picture: CameraPicture, reason: str) -> PictureResult:
    """The result of a picture on which the extractor raised an exception: all markers are lost."""
    return PictureResult(
        case=case, outcomes="".join(np.where(picture.visible, LOST, UNSEEN)), d2=np.empty(0), squared_px2=0.0, right=0,
        measured=0, visible=int(picture.visible.sum()), ms=math.nan, reason=reason, contrast=picture_contrast(picture),
        raised=True,
    )  # fmt: skip


def picture_contrast(picture: CameraPicture) -> float:
    """CIE76 of neighbouring cells, see ``neighbour_contrast``."""
    return neighbour_contrast(picture.image, picture.layout, picture.marker_xy_px)


def score_picture(
    case: CameraCase, picture: CameraPicture, markers: Markers, ms: float = math.nan
) -> PictureResult:
    """The result of markers that were read in a picture in ``ms``."""
    outcome = marker_outcomes(picture, markers)
    error_px = markers.xy_px - picture.marker_xy_px
    measured, right = markers.status == Status.MEASURED, outcome == MEASURED
    return PictureResult(
        case=case,
        outcomes="".join(outcome),
        d2=squared_distances(error_px[measured], markers.cov_px2[measured]),
        squared_px2=float((error_px[right] ** 2).sum()),
        right=int(right.sum()),
        measured=int((measured & picture.visible).sum()),
        visible=int(picture.visible.sum()),
        ms=ms,
        reason=str(markers.reason or ("" if markers.found else NO_REASON)),
        contrast=picture_contrast(picture),
    )


def marker_outcomes(picture: CameraPicture, markers: Markers) -> NDArray[np.str_]:
    """(M,) letters, see ``PictureResult``."""
    true_px, is_measured = picture.marker_xy_px, markers.status == Status.MEASURED
    wrong = wrong_markers(markers, true_px, WRONG_SHARE * shortest_edges(picture.layout, true_px))
    outcome = np.full(len(true_px), UNSEEN)
    outcome[picture.visible] = ESTIMATED
    outcome[picture.visible & (markers.status == Status.LOST)] = LOST
    outcome[picture.visible & is_measured] = MEASURED
    outcome[wrong.places] = WRONG_PLACE
    outcome[wrong.ids] = WRONG_ID
    return outcome
