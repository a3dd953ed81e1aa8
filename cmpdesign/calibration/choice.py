"""The choice among models, by the error of each picture under the adjustment of all others.

The adjustment without picture v differs from the whole one by the step (S - S_v)^-1 b_v in the common unknowns, for
their information S, the picture's part S_v and its part b_v of the gradient; the picture's squares then change by
2 b_v' step + step' S_v step. So leaving out each picture in turn costs no further adjustment. Models are compared by
the likelihood of the pictures left out, each with a scale of its own, so that a picture that contradicts decides
nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.adjustment import Adjusted, Guess, Problem, adjust
from cmpdesign.calibration.models import MODELS, CameraModel
from cmpdesign.calibration.start import with_model

Array = NDArray[np.float64]

# Deviations of the mean difference between two models, over pictures, from which the richer one is better; chosen.
CLEARLY_BETTER = 2.0


def left_out_scales(adjusted: Adjusted) -> Array:
    """(V,) the deviation of each picture's points over the stated ones, under the adjustment of all others."""
    total = adjusted.reduced.sum(axis=0) + np.diag(adjusted.prior)
    squares = []
    for part, gradient, chi2 in zip(adjusted.reduced, adjusted.gradients, adjusted.chi2, strict=True):
        step = np.linalg.solve(total - part, gradient)
        squares.append(chi2 + 2 * gradient @ step + step @ part @ step)
    return np.asarray(np.sqrt(np.array(squares) / adjusted.problem.freedom) * adjusted.scales)


def _unlikelihood(adjusted: Adjusted) -> Array:
    """(V,) minus twice the log-likelihood of each picture left out."""
    return np.asarray(2 * adjusted.problem.freedom * np.log(left_out_scales(adjusted)))


def best_of(candidates: Sequence[Adjusted]) -> Adjusted:
    """The candidate of the least error, or an earlier one that is not clearly worse."""
    losses = [_unlikelihood(one) for one in candidates]
    best = losses[int(np.argmin([loss.sum() for loss in losses]))]
    for one, loss in zip(candidates, losses, strict=True):
        worse = loss - best
        if worse.sum() <= CLEARLY_BETTER * np.sqrt(len(worse)) * worse.std():
            return one
    return candidates[int(np.argmin([loss.sum() for loss in losses]))]


def choose_model(problem: Problem, start: Guess, models: Sequence[CameraModel] = MODELS) -> Adjusted:
    """The likeliest model of the lens, and a flat or a bent sheet; the fields of ``problem`` for these are ignored.

    The sheet is first taken to be as in ``start``: bent where that has a shape.
    """
    was_bent = len(start.shape) > 0
    likely = best_of(_fitted(problem, start, models, bent=was_bent))
    (other,) = _fitted(problem, likely.guess, [likely.problem.model], bent=not was_bent)
    flat, bent = (other, likely) if was_bent else (likely, other)
    if best_of([flat, bent]) is likely:
        return likely
    return best_of(_fitted(problem, other.guess, models, bent=not was_bent))


def _fitted(problem: Problem, start: Guess, models: Sequence[CameraModel], *, bent: bool) -> list[Adjusted]:
    """Every model adjusted, each from the one before."""
    out = []
    if not bent:
        start = Guess(start.views, start.shape[:0])
    for model in models:
        one = Problem(problem.sheet, problem.sightings, model, bent, problem.size_px)
        out.append(adjust(one, with_model(start, model, problem.size_px)))
        start = out[-1].guess
    return out
