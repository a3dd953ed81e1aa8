"""Statistics of features in LeRobot's form: of an episode, and of all episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
LEVELS = 256  # of a channel of an image


@dataclass(frozen=True, eq=False)
class Statistics:
    """Statistics over frames; 0 without known values, because JSON has no NaN.

    Attributes:
        frames: number of frames.
        known: number of known values behind each figure.
        figures: "min", "max", "mean", "std" and the names of ``QUANTILES`` -> values, all of one shape.
    """

    frames: int
    known: Values
    figures: dict[str, Values]

    def to_json(self) -> dict[str, Any]:
        """Lists by name; ``count`` is the number of frames."""
        return {name: values.tolist() for name, values in self.figures.items()} | {"count": [self.frames]}


def statistics_of(values: NDArray[Any]) -> Statistics:
    """Statistics of (F, ...): of (F,) one figure, of (F, M) one per element, of (F, M, k) one per coordinate.

    NaN counts as unknown.
    """
    rows = values.reshape(-1, values.shape[-1] if values.ndim > 1 else 1).astype(np.float64)
    known = np.isfinite(rows).sum(axis=0).astype(np.float64)
    is_known = known > 0
    figures = {name: np.zeros(rows.shape[1]) for name in ("min", "max", "mean", "std", *QUANTILES)}
    some = rows[:, is_known]
    if some.size:
        figures["min"][is_known], figures["max"][is_known] = np.nanmin(some, axis=0), np.nanmax(some, axis=0)
        figures["mean"][is_known], figures["std"][is_known] = (
            np.nanmean(some, axis=0),
            np.nanstd(some, axis=0),
        )
        for name, share in QUANTILES.items():
            figures[name][is_known] = np.nanquantile(some, share, axis=0)
    return Statistics(len(values), known, figures)


class ImageStatistics:
    """Statistics of images, channel by channel, in shares of the largest value: 0 to 1; (3, 1, 1).

    Every fourth pixel in both directions counts.
    """

    def __init__(self) -> None:
        self._counts = np.zeros((3, LEVELS))
        self._frames = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Count an image (H, W, 3) BGR; the figures are those of RGB."""
        for channel in range(3):
            values = picture[::4, ::4, 2 - channel].ravel()
            self._counts[channel] += np.bincount(values, minlength=LEVELS)
        self._frames += 1

    def result(self) -> Statistics:
        """The statistics of the images so far, at least one."""
        levels = np.arange(LEVELS) / (LEVELS - 1)
        total = self._counts.sum(axis=1)
        shares = self._counts / total[:, None]
        mean = shares @ levels
        figures = {
            "min": levels[(self._counts > 0).argmax(axis=1)],
            "max": levels[LEVELS - 1 - (self._counts[:, ::-1] > 0).argmax(axis=1)],
            "mean": mean,
            "std": np.sqrt(np.maximum(0, shares @ levels**2 - mean**2)),
        }
        below = np.cumsum(shares, axis=1)
        for name, share in QUANTILES.items():
            figures[name] = levels[(below >= share - 1e-12).argmax(axis=1)]
        return Statistics(
            self._frames,
            total.reshape(3, 1, 1),
            {name: values.reshape(3, 1, 1) for name, values in figures.items()},
        )


def pooled(parts: Sequence[Statistics]) -> Statistics:
    """The statistics of several episodes together.

    All are exact except for the quantiles, which are the episodes' means weighted by their numbers of known values.
    """
    known = np.sum([part.known for part in parts], axis=0)
    weights = [part.known / np.maximum(known, 1) for part in parts]

    def mean_of(values: Sequence[Values]) -> Values:
        return np.sum([w * v for w, v in zip(weights, values, strict=True)], axis=0)  # type: ignore[no-any-return]

    figures = {name: mean_of([part.figures[name] for part in parts]) for name in ("mean", *QUANTILES)}
    squares = [part.figures["std"] ** 2 + (part.figures["mean"] - figures["mean"]) ** 2 for part in parts]
    figures["std"] = np.sqrt(mean_of(squares))
    for name, best, none in (("min", np.min, np.inf), ("max", np.max, -np.inf)):
        values = [np.where(part.known > 0, part.figures[name], none) for part in parts]
        figures[name] = np.where(known > 0, best(values, axis=0), 0.0)
    return Statistics(sum(part.frames for part in parts), known, figures)
