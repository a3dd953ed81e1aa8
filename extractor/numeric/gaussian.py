"""The normal distribution and the coverage of a pixel by a blurred wedge, as the compiled loops compute them.

Lengths are in units of the blur. For a pixel at the distance h inside one side of a wedge and k inside the other, the
coverage is N(h) N(k) and a correlation; see ``native/numeric/gaussian.hpp``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native

CORNER_TERMS = 9  # of a corner; as in native/numeric/gaussian.hpp


def normal_cdf(z: float) -> float:
    """The normal distribution of z, abs(z) <= 3.3, in single precision."""
    return native.normal_cdf(z)


def fill_corner_terms(r: float, out: NDArray[np.float32]) -> None:
    """Write the terms (``CORNER_TERMS``,) of a corner for ``wedge_correlation``.

    ``r`` is the cosine between the directions of its sides.
    """
    native.fill_corner_terms(r, out)


def wedge_correlation(squares: float, product: float, corner: Sequence[float]) -> float:
    """The coverage by a wedge minus the product N(h) N(k) of its sides, in single precision.

    Args:
        squares: h^2 + k^2; product: h k.
        corner: the terms of ``fill_corner_terms``.
    """
    return native.wedge_correlation(squares, product, corner)
