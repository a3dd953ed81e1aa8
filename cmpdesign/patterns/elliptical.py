"""The elliptical pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints


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

    For (cos t, aspect sin t), the arc from the top down to t is E(pi/2 - t | 1 - aspect^2), Legendre's
    incomplete integral of the second kind (DLMF 19.30.2). Newton's method applies because the derivative of the
    arc never vanishes.
    """
    from scipy.special import ellipe, ellipeinc

    m = 1 - aspect**2
    quarter_arc = ellipe(m)
    target_arc = 4 * quarter_arc * turn
    angle = 2 * np.pi * turn
    for _ in range(50):
        arc = quarter_arc - ellipeinc(np.pi / 2 - angle, m)
        correction = (arc - target_arc) / np.hypot(np.sin(angle), aspect * np.cos(angle))
        # At most half a radian: the arc's derivative is nearly zero at the tips of a flat ellipse.
        angle = angle - np.clip(correction, -0.5, 0.5)
        if np.abs(correction).max(initial=0.0) < 1e-14:
            break
    return np.asarray(angle, dtype=np.float64)
