"""How well each picture agrees with all others about the unknowns that they have in common.

Errors of neighbouring points are not independent. They share gridlines, so that smooth combinations of many points are
known better than independent errors would let them be; blur, light or a moving sheet move them together. Only smooth
combinations tell about a lens. So errors are measured where they count: by the pictures' own answers.

With its information S_v and its gradient g_v at the common solution, picture v alone would answer S_v^-1 g_v farther
on, and all others -(S - S_v)^-1 g_v. In units of S_v^-1/2, the difference is (1 + H) u of covariance 1 + H, for
u = S_v^-1/2 g_v and H = S_v^1/2 (S - S_v)^-1 S_v^1/2; its squares are u' (1 + H) u. Their ratio to their number is that
of Birge (Phys. Rev. 40, 207, 1932). What the picture's own answer leaves of its squares is the scatter of its points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DETERMINED = 1e-9  # share of the largest information, from which a picture says something about a combination


class Agreement(NamedTuple):
    """Errors of V pictures, in deviations that follow from their scales; 1 is right for independent errors.

    Attributes:
        difference: (V,) RMS difference of each picture's answer from that of all others.
        scatter: (V,) RMS of its points around its own answer.
    """

    difference: Array
    scatter: Array

    @property
    def contradiction(self) -> Array:
        """(V,) the difference over the scatter, over that of a usual picture."""
        share = self.difference / self.scatter
        return np.asarray(share / np.median(share))


def agreement(reduced: Array, gradients: Array, chi2: Array, freedom: Array, prior: Array) -> Agreement:
    """The errors of V pictures by their information (V, G, G) and gradients (V, G).

    Args:
        chi2: (V,) weighted squares.
        freedom: (V,) numbers of each picture less its pose's 6.
        prior: (G,) information of the usual values.
    """
    total = reduced.sum(axis=0) + np.diag(prior)
    root = np.sqrt(total.diagonal())
    total = total / root / root[:, None]
    difference, scatter = np.zeros(len(reduced)), np.zeros(len(reduced))
    for v, (part, gradient) in enumerate(zip(reduced / root / root[:, None], gradients / root, strict=True)):
        information, axes = np.linalg.eigh(part)
        known = information > DETERMINED * information[-1]
        half = axes[:, known] * np.sqrt(information[known])
        answer = (axes[:, known].T @ gradient) / np.sqrt(information[known])
        carried, count = half @ answer, int(known.sum())
        squares = float(answer @ answer)
        apart = squares + float(carried @ np.linalg.solve(total - part, carried))
        difference[v] = np.sqrt(apart / count)
        scatter[v] = np.sqrt(max(chi2[v] - squares, 0.1 * chi2[v]) / max(freedom[v] - count, 1.0))
    return Agreement(difference, scatter)
