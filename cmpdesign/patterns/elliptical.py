"""The elliptical pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints

# Of the speed along an ellipse: samples of half a turn, and terms of its series.
ARC_SAMPLES, ARC_TERMS = 512, 80


@register_pattern("elliptical", TRIANGULAR_GRAPHS, options=("aspect", "spacing"))
def elliptical_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """Layers are similar ellipses (the article, fig. 3b), b / a = aspect.

    ::

              . - * - .
          *               *        a: layers * pitch, to the right
        /    . - * - .     \\       b: aspect * a, upward
       *   *     0     *    *      |<->| pitch: from ellipse to ellipse, on the x axis
        \\    ' - * - '     /
          *               *        spacing "angle": equal steps of the parameter angle t
              ' - * - '            spacing "arc":   equal steps along the ellipse
    """
    turn = (120 - 60 * index / np.maximum(layer, 1)) / 360
    angle = 2 * np.pi * turn if shape.spacing == "angle" else _angle_from_arc(turn, shape.aspect)
    ellipse = np.stack([np.cos(angle), shape.aspect * np.sin(angle)], axis=-1)
    return np.asarray(layer[..., None] * ellipse)


def _angle_from_arc(turn: NDArray[np.float64], aspect: float) -> NDArray[np.float64]:
    """The parameter angle t in rad at which the arc from 0 to t is the share ``turn`` of the perimeter.

    The speed of (cos t, aspect sin t) is even and has the period pi. The terms of its cosine series are integrated one
    by one; they fall at least as 0.6^k for aspects from 1/4 to 4, so that the omitted terms are below 1e-17 of the arc.
    Newton's method converges because the derivative of the arc is never zero.
    """
    samples = np.pi * np.arange(ARC_SAMPLES) / ARC_SAMPLES
    cosines = np.fft.rfft(_speed(samples, aspect)).real / ARC_SAMPLES
    mean_speed, order = cosines[0], np.arange(1, ARC_TERMS + 1)
    sines = cosines[order] / order
    angle = 2 * np.pi * turn
    for _ in range(50):
        arc = mean_speed * angle + np.sin(2 * angle[..., None] * order) @ sines
        correction = (arc - 2 * np.pi * mean_speed * turn) / _speed(angle, aspect)
        # At most half a radian: the arc's derivative is nearly zero at the tips of a flat ellipse.
        angle = angle - np.clip(correction, -0.5, 0.5)
        if np.abs(correction).max(initial=0.0) < 1e-14:
            break
    return np.asarray(angle, dtype=np.float64)


def _speed(angle: NDArray[np.float64], aspect: float) -> NDArray[np.float64]:
    """The derivative of the arc by the parameter angle."""
    return np.hypot(np.sin(angle), aspect * np.cos(angle))
