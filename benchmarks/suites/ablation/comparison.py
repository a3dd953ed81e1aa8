"""A rule's effect: paired differences between the reader without the rule and the full reader, over the same
pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.ablation.rules import Rule
from benchmarks.suites.ablation.trial import PictureScore

MIN_LOSS = 0.02  # by which wrong, lost or RMS must rise without a rule that is kept
RESAMPLES, SEED = 2000, 20250101
INTERVAL_PERCENT = (2.5, 97.5)
Verdict = Literal["keep", "goes"]
Floats = NDArray[np.float64]


class Change(NamedTuple):
    """A figure with and without the rule.

    Attributes:
        full, without: the figure of the full reader, and without the rule.
        low, high: the 95 % interval of their difference, by paired bootstrap over pictures.
    """

    full: float
    without: float
    low: float
    high: float

    @property
    def difference(self) -> float:
        return self.without - self.full

    @property
    def is_worse(self) -> bool:
        """Larger without the rule by ``MIN_LOSS`` or more, with an interval above zero."""
        return self.low > 0 and self.difference >= MIN_LOSS * self.full


class Comparison(NamedTuple):
    """The effect of a rule.

    Attributes:
        rule: the rule that was switched off.
        pictures: number of pictures; ``touched`` is the number with a different result.
        wrong_ids, wrong_positions: summed.
        ids_saved: wrong ids that only the reader without the rule reports; ``ids_cost``: that only the full one does.
        wrong, lost: the counts that are judged.
        rms_px: of all measured markers together, which gross errors and poor pictures rule.
        typical_px: the geometric mean of the pictures' RMS, in which every picture counts the same.
        z: sqrt(mean d2 / 2) of all reported markers that are not wrong, with and without.
        departure: of z from 1, the larger one of z and 1 / z.
        beyond: share of these markers with d2 above ``BEYOND_D2``.
        ms: processor time, summed.
        time_ratio: median over pictures of the processor time without the rule over that with it.
    """

    rule: Rule
    pictures: int
    touched: int
    wrong_ids: tuple[int, int]
    wrong_positions: tuple[int, int]
    ids_saved: int
    ids_cost: int
    wrong: Change
    lost: Change
    rms_px: Change
    typical_px: Change
    z: tuple[float, float]
    departure: Change
    beyond: Change
    ms: Change
    time_ratio: float

    @property
    def judged(self) -> tuple[Change, ...]:
        """The figures by which a rule of its kind is judged, besides the ids that it saves."""
        usual = (self.wrong, self.lost, self.rms_px, self.typical_px)
        return (
            (*usual, self.departure, self.beyond, self.ms) if self.rule.kind == "errors and time" else usual
        )

    @property
    def verdict(self) -> Verdict:
        """A rule stays that saves more ids than it costs, or without which a figure that is judged is worse."""
        saves_ids = self.ids_saved > self.ids_cost
        return "keep" if saves_ids or any(change.is_worse for change in self.judged) else "goes"


def compare(rule: Rule, full: Sequence[PictureScore], without: Sequence[PictureScore]) -> Comparison:
    """Compare the scores of the same pictures, at least one."""
    ids = np.array([(b.wrong_ids - a.wrong_ids) for a, b in zip(full, without, strict=True)])
    both = [pair for pair in zip(full, without, strict=True) if min(one.squared_px2 for one in pair) > 0]
    ratios = [b.ms / a.ms for a, b in zip(full, without, strict=True) if a.ms > 0 and math.isfinite(b.ms)]
    return Comparison(
        rule=rule,
        pictures=len(full),
        touched=sum(a[:-1] != b[:-1] for a, b in zip(full, without, strict=True)),
        wrong_ids=(sum(a.wrong_ids for a in full), sum(b.wrong_ids for b in without)),
        wrong_positions=(sum(a.wrong_positions for a in full), sum(b.wrong_positions for b in without)),
        ids_saved=int(ids[ids > 0].sum()),
        ids_cost=int(-ids[ids < 0].sum()),
        wrong=_change(full, without, lambda score: (score.wrong, 0.0), _total),
        lost=_change(full, without, lambda score: (score.lost, 0.0), _total),
        rms_px=_change(full, without, lambda score: (score.squared_px2, 2.0 * score.measured), _root),
        typical_px=_change(*_columns(both), _log_of_rms, _exponential),
        z=(_z(full), _z(without)),
        departure=_change(full, without, lambda score: (score.d2, 2.0 * score.reported), _departure),
        beyond=_change(full, without, lambda score: (score.beyond, score.reported), _ratio),
        ms=_change(full, without, lambda score: (np.nan_to_num(score.ms), 0.0), _total),
        time_ratio=float(np.median(ratios)) if ratios else math.nan,
    )


def _change(
    full: Sequence[PictureScore],
    without: Sequence[PictureScore],
    terms: Callable[[PictureScore], tuple[float, float]],
    figure: Callable[[Floats], Floats],
) -> Change:
    """The figure of the summed terms (2,) of all pictures, and the interval of its difference."""
    before, after = (np.array([terms(score) for score in scores]) for scores in (full, without))
    pictures = len(before)
    if pictures == 0:
        return Change(math.nan, math.nan, math.nan, math.nan)
    times = np.random.default_rng(SEED).multinomial(pictures, np.full(pictures, 1 / pictures), RESAMPLES)
    difference = figure(times @ after) - figure(times @ before)
    known = difference[np.isfinite(difference)] if pictures > 1 else np.empty(0)
    low, high = np.percentile(known, INTERVAL_PERCENT) if len(known) else (math.nan, math.nan)
    ones = np.ones((1, pictures))
    return Change(float(figure(ones @ before)[0]), float(figure(ones @ after)[0]), float(low), float(high))


def _columns(
    pairs: Sequence[tuple[PictureScore, PictureScore]],
) -> tuple[list[PictureScore], list[PictureScore]]:
    return [before for before, _ in pairs], [after for _, after in pairs]


def _z(scores: Sequence[PictureScore]) -> float:
    reported = sum(score.reported for score in scores)
    return math.sqrt(sum(score.d2 for score in scores) / (2 * reported)) if reported else math.nan


def _log_of_rms(score: PictureScore) -> tuple[float, float]:
    return 0.5 * math.log(score.squared_px2 / (2.0 * score.measured)), 1.0


def _exponential(sums: Floats) -> Floats:
    """The exponential of the mean: the first sums (N, 2) over the second sums."""
    return np.asarray(np.exp(sums[:, 0] / sums[:, 1]))


def _total(sums: Floats) -> Floats:
    return sums[:, 0]


def _ratio(sums: Floats) -> Floats:
    """The first sums (N, 2) over the second ones; NaN where nothing was measured."""
    out = np.full(len(sums), np.nan)
    np.divide(sums[:, 0], sums[:, 1], out=out, where=sums[:, 1] > 0)
    return out


def _root(sums: Floats) -> Floats:
    return np.asarray(np.sqrt(_ratio(sums)))


def _departure(sums: Floats) -> Floats:
    """Of the root of that ratio from 1, as a ratio of at least 1."""
    root = _root(sums)
    with np.errstate(divide="ignore"):
        return np.asarray(np.maximum(root, 1.0 / root))
