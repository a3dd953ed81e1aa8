"""The kerfs of a picture whose response is expected but not known; the edges determine the response.

Expected responses (sRGB, or the response in the file) and the family of exponents around 2.2 are weighted by the fit of
symmetric edges in their light to the picture's edges. Kerfs are the weighted means over the responses, and the
deviation contains the uncertainty of the response.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cmpdesign.errors import parameter
from cmpdesign.products.laser.coupon.edge_model import EdgeFit, EdgeModel, bin_deviations
from cmpdesign.products.laser.coupon.edges import EdgeValues
from cmpdesign.products.laser.coupon.picture import PhotoError, Values
from extractor.image.response import Response, light_of_values

# Exponents of scanners and cameras: mean, deviation, and the share of pictures that follow one of them.
EXPONENT, EXPONENT_DEVIATION, EXPONENT_SHARE = 2.2, 0.25, 0.5
# Relative exponents from which fits start: edges of compressed pictures have several minima.
EXPONENT_STARTS = (0.85, 1.0, 1.15)
# The same for a stated response that may be wrong: linear for sRGB.
STATED_STARTS = (0.45, 1.0, 2.2)
# Fits whose exponents differ by less, relative to the exponent, count as one fit.
SAME_EXPONENT = 0.02
# Compression changes edges: residuals exceed the noise. The exponent has this relative error for each unit of
# their mean square over the noise's, above the usual value. Fitted to 70 pictures of the benchmark (seed 7): exponents
# have errors over stated deviations of 0.9 without JPEG, with JPEG of 2.0 without this term and 1.1 with it.
MISFIT_DEVIATION, USUAL_MISFIT = 0.2, 1.1
# Step of the exponent for the derivative of the kerfs.
EXPONENT_STEP = 0.1
# Edges further from a response than this many deviations contradict it.
LARGEST_MISFIT = 4.0
# Deviation of a stated response from the true one, relative to the exponent.
STATED_DEVIATION = 0.05


@dataclass(frozen=True, eq=False)
class KerfsInLight:
    """Kerfs by one response: (2, P) of cuts along y and along x, by patch, mm, and their standard deviations."""

    value_mm: Values
    sigma_mm: Values


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """Kerfs over all responses that the edges allow, as ``KerfsInLight``, and these responses in a few words."""

    kerfs: KerfsInLight
    description: str


KerfReader = Callable[[Response], KerfsInLight]


@dataclass(frozen=True, eq=False)
class _Candidate:
    """One response: its kerfs, the log of its weight, and its name."""

    kerfs: KerfsInLight
    log_weight: float
    name: str


def hold_response(read: KerfReader, edges: EdgeValues, response: Response) -> ResponseFit:
    """The kerfs by a response that the user states.

    Raises:
        PhotoError: the edges contradict the response.
    """
    fit = _free_fits(edges, response, STATED_STARTS).fits[0]
    limit = LARGEST_MISFIT * float(np.hypot(fit.sigma, STATED_DEVIATION))
    if abs(fit.exponent - 1) > limit:
        raise PhotoError(
            f"by {parameter('response')} {response} the light of the edges is off by an exponent of "
            f"{fit.exponent:.2f}, limit 1 +- {limit:.2f}; leave {parameter('response')} out, or scan without "
            "sharpening and automatic contrast"
        )
    return ResponseFit(read(response), f"{response_name(response)}, as stated")


def fit_response(read: KerfReader, edges: EdgeValues, expected: Sequence[Response]) -> ResponseFit:
    """Weigh expected responses and the exponents by the edges.

    Raises:
        PhotoError: the edges contradict all of them.
    """
    free = _free_fits(edges, EXPONENT, EXPONENT_STARTS)
    best = free.fits[0]
    candidates = [_exponent_candidate(read, fit, best) for fit in free.fits]
    for each in expected:
        squares = EdgeModel(edges, light_of_values(each), free.deviation).fit(1.0).squares
        log_weight = -0.5 * (squares - best.squares) / best.scatter
        share = (1 - EXPONENT_SHARE) / len(expected)
        candidates.append(_Candidate(read(each), float(np.log(share)) + log_weight, response_name(each)))
    if max(one.log_weight for one in candidates) < -0.5 * LARGEST_MISFIT**2 - 3:
        raise PhotoError(
            f"the edges are symmetric for an exponent of {EXPONENT * best.exponent:.2f}, expected "
            f"{' or '.join(map(response_name, expected))} or 2.2 +- 0.5: the picture has been sharpened or its "
            f"contrast changed; scan without sharpening and contrast, or state {parameter('response')}"
        )
    logs = np.array([one.log_weight for one in candidates])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    values = np.stack([one.kerfs.value_mm for one in candidates])
    mean = np.tensordot(weights, values, 1)
    variances = np.stack([one.kerfs.sigma_mm**2 for one in candidates]) + (values - mean) ** 2
    pooled = KerfsInLight(mean, np.sqrt(np.tensordot(weights, variances, 1)))
    likeliest = candidates[int(weights.argmax())].name
    return ResponseFit(pooled, f"{likeliest} ({100 * weights.max():.0f} % likely by the edges)")


def response_name(response: Response) -> str:
    """A response in a few words."""
    if isinstance(response, str):
        return "sRGB" if response == "srgb" else response
    return f"exponent {float(np.asarray(response)):.2f}" if np.ndim(response) == 0 else "the file's curve"


class _FreeFits(NamedTuple):
    """Fits of the exponent, the best first, and the deviations (N,) of the bins that they used."""

    fits: list[EdgeFit]
    deviation: Values


def _free_fits(edges: EdgeValues, response: Response, starts: Sequence[float]) -> _FreeFits:
    """Fit the exponent twice, the second time with the deviations from the first fit's residuals."""
    light_of_value = light_of_values(response)
    first = [EdgeModel(edges, light_of_value, bin_deviations(edges)).fit_exponent(each) for each in starts]
    first.sort(key=lambda one: one.squares)
    distinct = [
        one
        for k, one in enumerate(first)
        if all(abs(one.exponent - other.exponent) > SAME_EXPONENT for other in first[:k])
    ]
    misfit = float(np.mean((first[0].residual / bin_deviations(edges)) ** 2))
    bend = MISFIT_DEVIATION * max(misfit - USUAL_MISFIT, 0.0) ** 0.5
    deviation = bin_deviations(edges, first[0].residual)
    model = EdgeModel(edges, light_of_value, deviation)
    fits = [_with_bend(model.fit_exponent(each), bend) for each in distinct]
    return _FreeFits(sorted(fits, key=lambda one: one.squares), deviation)


def _with_bend(fit: EdgeFit, deviation: float) -> EdgeFit:
    """A fit with a relative deviation added to the exponent's, and its squares reduced accordingly."""
    sigma = float(np.hypot(fit.sigma, deviation * fit.exponent))
    return replace(fit, sigma=sigma, scatter=fit.scatter * (sigma / fit.sigma) ** 2)


def _exponent_candidate(read: KerfReader, free: EdgeFit, best: EdgeFit) -> _Candidate:
    """The exponent by the edges, combined with the usual exponent, weighted by their deviations."""
    asked, sigma = EXPONENT * free.exponent, EXPONENT * free.sigma
    precision = 1 / sigma**2 + 1 / EXPONENT_DEVIATION**2
    exponent = (asked / sigma**2 + EXPONENT / EXPONENT_DEVIATION**2) / precision
    first, second = read(exponent), read(exponent + EXPONENT_STEP)
    change = (second.value_mm - first.value_mm) / EXPONENT_STEP
    kerfs = KerfsInLight(first.value_mm, np.sqrt(first.sigma_mm**2 + change**2 / precision))
    spread = float(np.hypot(sigma, EXPONENT_DEVIATION))
    log_weight = -0.5 * ((asked - EXPONENT) / spread) ** 2 + float(np.log(sigma / spread))
    log_weight -= 0.5 * (free.squares - best.squares) / best.scatter
    return _Candidate(kerfs, float(np.log(EXPONENT_SHARE)) + log_weight, response_name(exponent))
