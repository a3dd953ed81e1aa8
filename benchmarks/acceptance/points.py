"""Points of the curve: what is wrong and what is lost at one value of the threshold, with bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from scipy.special import betaincinv

from benchmarks.suites.ablation.trial import PictureScore

CONFIDENCE = 0.95
MILLION = 1e6
MAX_WRONG = 10.0  # per million reported markers, that the upper bound may be
MAX_LOST = 1.05  # times as many as at the reader's own threshold


def upper_share(wrong: int, count: int) -> float:
    """The one-sided upper bound of a share (Clopper and Pearson, Biometrika 26, 404, 1934); 3 / count of none."""
    return float(betaincinv(wrong + 1, count - wrong, CONFIDENCE)) if wrong < count else 1.0


class Point(NamedTuple):
    """All pictures at one threshold; counts are of markers.

    Attributes:
        threshold: its value.
        reported: all reported ones.
        wrong_ids: reported at the place of another marker.
        wrong_positions: reported more than half of the shortest edge off, but at no other's place.
        lost: visible, not reported.
        visible: visible ones.
    """

    threshold: float
    reported: int
    wrong_ids: int
    wrong_positions: int
    lost: int
    visible: int

    @property
    def wrong_per_million(self) -> float:
        """Wrong positions of a million reported markers."""
        return MILLION * self.wrong_positions / max(self.reported, 1)

    @property
    def upper_per_million(self) -> float:
        """The upper bound of these."""
        return MILLION * upper_share(self.wrong_positions, self.reported)

    def holds(self, own: Point) -> bool:
        """No wrong id, the upper bound of wrong positions kept, and hardly more lost than at the own threshold."""
        is_right = self.wrong_ids == 0 and self.upper_per_million <= MAX_WRONG
        return is_right and self.lost <= MAX_LOST * own.lost


def pooled_point(threshold: float, scores: Sequence[PictureScore]) -> Point:
    """The sums over pictures read at one threshold."""
    return Point(
        threshold=threshold,
        reported=sum(one.reported + one.wrong for one in scores),
        wrong_ids=sum(one.wrong_ids for one in scores),
        wrong_positions=sum(one.wrong_positions for one in scores),
        lost=sum(one.lost for one in scores),
        visible=sum(one.visible for one in scores),
    )
