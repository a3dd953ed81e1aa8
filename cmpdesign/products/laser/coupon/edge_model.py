"""The response of a picture by its own edges.

Blur in linear light makes a straight edge symmetric; the response then makes the edge asymmetric. The model draws every
edge in this order: a symmetric edge (a sum of Gaussian ones, the same for all edges) between the light of sheet and
opening, encoded by a response. The residual is the part that is not symmetric in this light. The exponent of the light
is fitted, or held at 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cmpdesign.libraries import extra
from cmpdesign.products.laser.coupon.edges import EdgeValues
from cmpdesign.products.laser.coupon.picture import Values
from extractor.image.response import decode_values, encode_light

# The symmetric edge: a core and two wider parts, each a Gaussian edge averaged over the pixel. Its parameters are the
# log of the core's deviation, in units of the first guess, the logs of both parts' shares over the core's, and the logs
# of their widths over the core's: start values, and largest changes.
SHAPE_START = np.array([0.0, -2.5, -3.5, np.log(1.7), np.log(5.0)])
SHAPE_DEVIATION = np.array([1.0, 1.5, 1.5, 0.2, 0.3])
SHAPE_STEP = 1e-4
# Parameters of a single edge.
OWN = 4
# Places and weights that average over the width of a pixel.
PIXEL_PLACES, PIXEL_WEIGHTS = np.array([-0.3873, 0.0, 0.3873]), np.array([5.0, 8.0, 5.0]) / 18
# Blur, as a deviation in px, that is expected at least; the rise from 0.1 to 0.9 of a Gaussian edge.
MIN_BLUR_PX, RISE_SIGMA = 0.35, 2.563
STEPS, ENOUGH = 80, 0.01
# Deviation of one pixel's value, at least: steps of 1 are rounded.
MIN_NOISE = 0.3
# The fitted exponent stays within these, relative to the response.
SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.3, 3.0


@dataclass(frozen=True, eq=False)
class EdgeState:
    """The parameters of the drawn edges.

    Attributes:
        sheet, opening: (E,) light of each edge's two sides.
        place_px: (E,) place of each edge.
        slope: (E,) relative slope of the light, by px.
        blur_px: the first guess of the blur.
        shape: (5,) parameters of the symmetric edge.
        log_exponent: log of the exponent.
    """

    sheet: Values
    opening: Values
    place_px: Values
    slope: Values
    blur_px: float
    shape: Values
    log_exponent: float

    @property
    def exponent(self) -> float:
        return float(np.exp(self.log_exponent))


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """The fit of the edges by a response.

    Attributes:
        exponent: of the light, relative to the response: linear light is light ** exponent.
        sigma: its standard deviation; 0 where the exponent is held.
        squares: sum of the squares of the residuals over their deviations.
        scatter: variance of the exponent by its scatter between edges, over its variance by the deviations.
        residual: (N,) measured less drawn value of each bin.
        state: the parameters.
    """

    exponent: float
    sigma: float
    squares: float
    scatter: float
    residual: Values
    state: EdgeState


class EdgeModel:
    """The model of one picture's edges by one response (256,) of light 0 to 255.

    ``deviation`` (N,) is the deviation of the mean value of each bin.
    """

    def __init__(self, edges: EdgeValues, light_of_value: Values, deviation: Values) -> None:
        self._edges, self._light_of_value = edges, light_of_value
        self._weight = 1 / deviation

    def fit(self, exponent: float) -> EdgeFit:
        """Fit with the exponent held."""
        return self._fit(self._first_state(exponent), free_exponent=False)

    def fit_exponent(self, start: float | EdgeFit) -> EdgeFit:
        """Fit with the exponent free, from an exponent or from another fit of the same edges."""
        state = start.state if isinstance(start, EdgeFit) else self._first_state(start)
        return self._fit(state, free_exponent=True)

    def _fit(self, state: EdgeState, free_exponent: bool) -> EdgeFit:
        """Levenberg-Marquardt; the exponent's deviation is its deviation between edges."""
        system = self._system(state, free_exponent)
        damping = 1e-3
        for _ in range(STEPS):
            moved = _moved(state, system.step(damping), free_exponent)
            new = self._system(moved, free_exponent)
            if new.objective > system.objective:
                damping *= 8
                continue
            decrease = system.objective - new.objective
            state, system, damping = moved, new, max(damping / 5, 1e-7)
            if decrease < ENOUGH:
                break
        squares = float((system.residual**2).sum())
        value_residual = system.residual / self._weight
        if not free_exponent:
            return EdgeFit(state.exponent, 0.0, squares, 1.0, value_residual, state)
        information, sigma = self._exponent_deviation(system)
        scatter = sigma**2 * information
        return EdgeFit(state.exponent, sigma * state.exponent, squares, scatter, value_residual, state)

    def _first_state(self, exponent: float) -> EdgeState:
        edges = self._edges
        far = np.abs(edges.distance_px) > 0.6 * np.abs(edges.distance_px).max()
        light = 255.0 * (decode_values(edges.value, self._light_of_value) / 255.0) ** exponent
        levels = []
        for inside in (edges.distance_px < 0, edges.distance_px > 0):
            chosen = far & inside
            sums = np.bincount(edges.edge[chosen], light[chosen] * edges.pixels[chosen], edges.count)
            levels.append(sums / np.bincount(edges.edge[chosen], edges.pixels[chosen], edges.count))
        share = (light - levels[0][edges.edge]) / (levels[1] - levels[0])[edges.edge]
        zeros = np.zeros(edges.count)
        place_px = np.array([_edge_place(edges, share, number) for number in range(edges.count)])
        from_edge = edges.distance_px - place_px[edges.edge]
        order = np.argsort(from_edge)
        window = max(len(order) // 200, 1)
        kernel = np.ones(window) / window
        smooth = np.convolve(share[order], kernel, "valid")
        place = np.convolve(from_edge[order], kernel, "valid")
        rise = place[np.argmax(smooth > 0.9)] - place[len(smooth) - 1 - np.argmax(smooth[::-1] < 0.1)]
        blur_px = max(float(rise) / RISE_SIGMA, MIN_BLUR_PX)
        return EdgeState(levels[0], levels[1], place_px, zeros, blur_px, SHAPE_START, float(np.log(exponent)))

    def _system(self, state: EdgeState, free_exponent: bool) -> _System:
        """The linear equations at a state."""
        edges, number = self._edges, self._edges.edge
        t = edges.distance_px - state.place_px[number]
        blur = _Blur(state.blur_px, state.shape)
        rises = blur.rises(t)
        share = blur.share(rises)
        rise = (blur.share(blur.rises(t + SHAPE_STEP)) - share) / SHAPE_STEP
        by_shape = [(each - share) / SHAPE_STEP for each in blur.shares_of_steps(t, rises)]
        gain = 1 + state.slope[number] * t
        sheet, excess = state.sheet[number], (state.opening - state.sheet)[number]
        light = np.clip(gain * (sheet + excess * share), 1e-3, 400.0)
        exponent = np.exp(state.log_exponent)
        bent = 255.0 * (light / 255.0) ** (1 / exponent)
        value, by_bent = _encoded(bent, self._light_of_value)
        by_light = by_bent * bent / (exponent * light)
        columns = [
            -by_light * gain * excess * rise,
            by_light * gain * (1 - share),
            by_light * gain * share,
            by_light * light / gain * t,
            *(by_light * gain * excess * each for each in by_shape),
        ]
        if free_exponent:
            columns.append(by_bent * bent * -np.log(light / 255.0) / exponent)
        matrix = np.stack(columns, axis=1) * self._weight[:, None]
        residual = (edges.value - value) * self._weight
        return _System(matrix, residual, edges, (SHAPE_START - state.shape) / SHAPE_DEVIATION)

    def _exponent_deviation(self, system: _System) -> tuple[float, float]:
        """The information on the log of the exponent if bins were independent; its deviation by the edges' scatter."""
        others = _System(system.matrix[:, :-1], system.matrix[:, -1], self._edges, np.zeros(5))
        own = others.residual - others.drawn(others.step(1e-9))
        scores = np.bincount(self._edges.edge, own * system.residual, self._edges.count)
        information = float((own**2).sum())
        between = float(np.sqrt((scores**2).sum())) / information
        return information, max(between, information**-0.5)


@dataclass(frozen=True, eq=False)
class _Step:
    """Changes of the parameters: (E, 4) of each edge, and (5 or 6,) of all edges together."""

    own: Values
    common: Values


@dataclass(frozen=True, eq=False)
class _System:
    """Linear equations of the bins, over their deviations.

    Attributes:
        matrix: (N, 9 or 10) derivatives by an edge's place, sheet, opening and slope, and by the common parameters.
        residual: (N,) measured less drawn values.
        edges: the bins; those of an edge follow each other.
        prior: (5,) residuals of the shape's parameters, over their deviations.
    """

    matrix: Values
    residual: Values
    edges: EdgeValues
    prior: Values

    @property
    def objective(self) -> float:
        """The sum of the squares of all residuals."""
        return float((self.residual**2).sum() + (self.prior**2).sum())

    def step(self, damping: float) -> _Step:
        """Solve the damped normal equations; the parameters of single edges are eliminated."""
        starts = np.searchsorted(self.edges.edge, np.arange(self.edges.count))
        both = np.column_stack([self.matrix, self.residual])
        sums = np.stack([edge.T @ edge for edge in np.split(both, starts[1:])])
        products, right = sums[:, :-1, :-1], sums[:, :-1, -1]
        common = products[:, OWN:, OWN:].sum(axis=0)
        common[:5, :5] += np.diag(SHAPE_DEVIATION**-2.0)
        common_right = right[:, OWN:].sum(axis=0)
        common_right[:5] += self.prior / SHAPE_DEVIATION
        common = common + np.diag(damping * np.diag(common) + 1e-12)
        own = products[:, :OWN, :OWN]
        diagonal = np.einsum("eii->ei", own)
        own = own + (damping * diagonal + 1e-12)[:, :, None] * np.eye(OWN)
        mixed = products[:, :OWN, OWN:]
        solved = np.linalg.solve(own, np.concatenate([mixed, right[:, :OWN, None]], axis=2))
        reduced = common - np.einsum("eij,eik->jk", mixed, solved[:, :, :-1])
        reduced_right = common_right - np.einsum("eij,ei->j", mixed, solved[:, :, -1])
        change = np.linalg.solve(reduced, reduced_right)
        return _Step(solved[:, :, -1] - solved[:, :, :-1] @ change, change)

    def drawn(self, step: _Step) -> Values:
        """(N,) the change of the residuals by a step."""
        own = (self.matrix[:, :OWN] * step.own[self.edges.edge]).sum(axis=1)
        return np.asarray(own + self.matrix[:, OWN:] @ step.common)


def _moved(state: EdgeState, step: _Step, free_exponent: bool) -> EdgeState:
    place, sheet, opening, slope = step.own.T
    shape = state.shape + np.clip(step.common[:5], -0.7, 0.7)
    log_exponent = state.log_exponent + (float(np.clip(step.common[-1], -0.3, 0.3)) if free_exponent else 0.0)
    return EdgeState(
        np.maximum(state.sheet + sheet, 1e-2),
        np.maximum(state.opening + opening, 1e-2),
        state.place_px + np.clip(place, -2, 2),
        state.slope + slope,
        state.blur_px,
        shape,
        float(np.clip(log_exponent, np.log(SMALLEST_EXPONENT), np.log(LARGEST_EXPONENT))),
    )


class _Blur:
    """The blur of an edge of a shape (5,): the sum of three Gaussians over a pixel's box."""

    def __init__(self, blur_px: float, shape: Values) -> None:
        self._blur_px, self._shape = blur_px, shape
        self._widths = blur_px * np.exp(shape[0] + np.array([0.0, shape[3], shape[4]]))
        parts = np.exp(np.array([0.0, shape[1], shape[2]]))
        self._weights = ((parts / parts.sum())[:, None] * PIXEL_WEIGHTS).ravel()

    def rises(self, t: Values, gaussians: slice = slice(None)) -> Values:
        """(N, 3, places) the shares of the opening's light at distances (N,) px, by Gaussian and place in the pixel."""
        with extra("laser"):
            from scipy.special import ndtr

        return np.asarray(ndtr((t[:, None, None] + PIXEL_PLACES) / self._widths[gaussians, None]))

    def share(self, rises: Values) -> Values:
        """(N,) the share of the opening's light."""
        return np.asarray(rises.reshape(len(rises), -1) @ self._weights)

    def shares_of_steps(self, t: Values, rises: Values) -> Iterator[Values]:
        """The shares (N,) after a step of each number of the shape; two change no width, two change one width."""
        for number, unit in enumerate(np.eye(5)):
            changed = _Blur(self._blur_px, self._shape + SHAPE_STEP * unit)
            own = changed.rises(t) if number == 0 else rises
            if number > 2:
                own = rises.copy()
                only = slice(number - 2, number - 1)
                own[:, only] = changed.rises(t, only)
            yield changed.share(own)


def _edge_place(edges: EdgeValues, share: Values, number: int) -> float:
    """The distance at which a sharp edge would have the same sum of shares, px."""
    own = edges.edge == number
    distance, inside = edges.distance_px[own], share[own]
    sums = (inside[1:] + inside[:-1]) / 2 * np.diff(distance)
    return float(distance[-1] - sums.sum())


def bin_deviations(edges: EdgeValues, residual: Values | None = None) -> Values:
    """(N,) deviations of the mean values of the bins.

    Args:
        edges: the bins. Differences of neighbouring bins far from the edges give the noise of one pixel.
        residual: (N,) of a fit: the part above the noise (compression changes edges) is added.
    """
    far = np.abs(edges.distance_px) > 0.6 * np.abs(edges.distance_px).max()
    together = (edges.edge[1:] == edges.edge[:-1]) & (edges.distance_px[1:] * edges.distance_px[:-1] > 0)
    pair = far[1:] & far[:-1] & together
    scaled = np.diff(edges.value) / np.sqrt(1 / edges.pixels[1:] + 1 / edges.pixels[:-1])
    noise = max(float(np.sqrt(np.mean(scaled[pair] ** 2))), MIN_NOISE)
    variance = noise**2 / edges.pixels
    if residual is not None:
        variance = variance + max(float(np.mean(residual**2 - variance)), 0.0)
    return np.asarray(np.sqrt(variance))


def _encoded(light: Values, light_of_value: Values) -> tuple[Values, Values]:
    """Values of light and their derivative; between two values as a straight line would make residuals jump."""
    value = encode_light(light, light_of_value)
    grid = np.arange(256.0)
    slope = np.gradient(light_of_value, grid)
    return value, 1 / np.maximum(np.interp(value, grid, slope), 1e-3)
