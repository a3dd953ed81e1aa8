"""The trial of rules: pictures read by a copy of the reader without them, and their scores."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.suites.ablation.pictures import KeptPicture, PatternTruth
from benchmarks.suites.ablation.rules import Rule
from benchmarks.suites.ablation.worker import ReadPicture
from benchmarks.suites.code_copy import CodeCopy, Replacement, environment
from benchmarks.suites.scoring.calibration import BEYOND_D2, squared_distances
from benchmarks.suites.scoring.wrong import wrong_markers
from extractor import Status

# In the shortest edges: beyond the first a position is wrong, up to the second it is at a marker's place.
WRONG_POSITION, SAME_PLACE = 0.5, 0.3


class PictureScore(NamedTuple):
    """Counts of markers in one picture.

    Attributes:
        wrong_ids: reported at the place of another marker, or in a picture without a pattern.
        wrong_positions: reported more than half of the shortest edge from their place, but not at another marker's
            place.
        lost: visible, not reported.
        visible: visible markers.
        measured: measured, not wrong.
        squared_px2: the sum of their squared errors, both axes.
        reported: reported, not wrong.
        d2: the sum of their squared errors over stated covariances.
        beyond: reported, not wrong, with such a square above ``BEYOND_D2``.
        ms: processor time; NaN after an exception.
    """

    wrong_ids: int
    wrong_positions: int
    lost: int
    visible: int
    measured: int
    squared_px2: float
    reported: int
    d2: float
    beyond: int
    ms: float

    @property
    def wrong(self) -> int:
        """Wrong ids and wrong positions."""
        return self.wrong_ids + self.wrong_positions


def read_without(
    rules: Sequence[Rule], pictures: Sequence[KeptPicture], preset: str, copy: CodeCopy
) -> list[PictureScore]:
    """The scores of the pictures, read by the copy of the reader without these rules.

    Raises:
        ValueError: a rule's text does not occur exactly once.
        RuntimeError: the reader cannot be built or run.
    """
    try:
        readings = read_changed([rule.change for rule in rules], [one.path for one in pictures], preset, copy)
    except RuntimeError as error:
        names = ", ".join(rule.name for rule in rules) or "any change"
        raise RuntimeError(f"without {names}: {error}") from error
    return [
        score_reading(reading, picture.truths) for reading, picture in zip(readings, pictures, strict=True)
    ]


def read_changed(
    changes: Iterable[Replacement], pictures: Sequence[Path], preset: str, copy: CodeCopy
) -> list[ReadPicture]:
    """What the copy of the reader finds in the pictures when its texts are changed.

    Raises:
        ValueError: a text to be replaced does not occur exactly once.
        RuntimeError: the reader cannot be built or run.
    """
    out = copy.folder / "readings"
    with copy.replaced(changes):
        result = subprocess.run(
            [
                *(sys.executable, "-m", "benchmarks.suites.ablation.worker"),
                *(str(copy.folder), preset, str(out)),
                *map(str, pictures),
            ],
            cwd=copy.folder,
            env=environment(copy.folder),
            capture_output=True,
            text=True,
            check=False,
        )
    if result.returncode != 0:
        raise RuntimeError(result.stderr[-2000:])
    return [ReadPicture(*entry) for entry in pickle.loads(out.read_bytes())]


def score_reading(reading: ReadPicture, truths: Sequence[PatternTruth]) -> PictureScore:
    """The score of a reading against the nearest pattern in the picture."""
    reported = reading.status != Status.LOST
    if not truths:
        return PictureScore(int(reported.sum()), 0, 0, 0, 0, 0.0, 0, 0.0, 0, reading.ms)
    scores = [_score_pattern(reading, truth) for truth in truths]
    return min(scores, key=lambda score: (score.wrong, score.lost))


def _score_pattern(reading: ReadPicture, truth: PatternTruth) -> PictureScore:
    reported = reading.status != Status.LOST
    wrong = wrong_markers(reading, truth.xy_px, WRONG_POSITION * truth.edge_px, SAME_PLACE * truth.edge_px)
    right = reported & ~wrong.any_kind
    measured = right & (reading.status == Status.MEASURED)
    d2 = squared_distances(reading.xy_px[right] - truth.xy_px[right], reading.cov_px2[right])
    return PictureScore(
        wrong_ids=int(wrong.ids.sum()),
        wrong_positions=int(wrong.places.sum()),
        lost=int((truth.visible & ~reported).sum()),
        visible=int(truth.visible.sum()),
        measured=int(measured.sum()),
        squared_px2=float(((reading.xy_px - truth.xy_px)[measured] ** 2).sum()),
        reported=int(right.sum()),
        d2=float(d2[np.isfinite(d2)].sum()),
        beyond=int((d2 > BEYOND_D2).sum()),
        ms=reading.ms,
    )
