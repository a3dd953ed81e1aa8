"""Success shares with confidence intervals, and statistics of samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

# The normal distribution's 97.5 % point: two-sided 95 %.
Z_95 = 1.959963984540054


@dataclass(frozen=True)
class SuccessShare:
    """``successful`` of ``trials``, with Wilson's 95 % interval."""

    trials: int
    successful: int

    def __post_init__(self) -> None:
        if not 0 <= self.successful <= self.trials:
            raise ValueError(f"{self.successful} of {self.trials} is no share")

    @property
    def share(self) -> float:
        return self.successful / self.trials if self.trials else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        return wilson_interval(self.successful, self.trials)

    def to_json(self) -> dict[str, object]:
        low, high = self.interval
        return {
            "trials": self.trials,
            "successful": self.successful,
            "share": round(self.share, 6) if self.trials else None,
            "interval_95": [round(low, 6), round(high, 6)],
        }


def wilson_interval(successful: int, trials: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson's score interval of a binomial share; (0, 1) without trials.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927).
    """
    if trials == 0:
        return 0.0, 1.0
    share, spread = successful / trials, z * z / trials
    middle = share + spread / 2
    half = z * sqrt(share * (1 - share) / trials + spread / (4 * trials))
    low, high = (middle - half) / (1 + spread), (middle + half) / (1 + spread)
    # The ends 0 and 1 are exact; rounding must not leave 1e-17.
    return (0.0 if successful == 0 else low), (1.0 if successful == trials else high)


@dataclass(frozen=True)
class SampleStatistics:
    """Statistics of a sample of finite values; NaN for an empty sample."""

    count: int
    mean: float
    deviation: float
    low: float
    median: float
    high: float

    def to_json(self) -> dict[str, object]:
        figures = {name: getattr(self, name) for name in ("mean", "deviation", "low", "median", "high")}
        return {"count": self.count, **{name: round_for_json(value) for name, value in figures.items()}}


def sample_statistics(values: Sequence[float]) -> SampleStatistics:
    """Count, mean, standard deviation (n - 1), smallest, median and largest of the finite values."""
    finite = np.asarray([value for value in values if value is not None], dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        return SampleStatistics(0, *[float("nan")] * 5)
    deviation = float(finite.std(ddof=1)) if len(finite) > 1 else 0.0
    low, median, high = (float(np.quantile(finite, share)) for share in (0, 0.5, 1))
    return SampleStatistics(len(finite), float(finite.mean()), deviation, low, median, high)


def round_for_json(value: float, digits: int = 6) -> float | None:
    """A rounded value for JSON; None if it is not finite."""
    return round(float(value), digits) if np.isfinite(value) else None
