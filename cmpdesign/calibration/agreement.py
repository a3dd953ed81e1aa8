"""How well each picture agrees with all others about the unknowns that they have in common.

Errors of neighbouring points are not independent. They share gridlines, so that smooth combinations of many points are
known better than independent errors would let them be; blur, light or a moving sheet move them together. Only smooth
combinations tell about a lens. So errors are measured where they count: by the pictures' own answers.

With its information S_v and its gradient g_v at the common solution, picture v alone would answer S_v^-1 g_v farther
on, and all others -(S - S_v)^-1 g_v. In units of S_v^-1/2, the difference is (1 + H) u of covariance 1 + H, for
u = S_v^-1/2 g_v and H = S_v^1/2 (S - S_v)^-1 S_v^1/2; its squares are u' (1 + H) u. Their ratio to their number is that
of Birge (Phys. Rev. 40, 207, 1932).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DETERMINED = 1e-9  # share of the largest information, from which a picture says something about a combination


def disagreements(reduced: Array, gradients: Array, prior: Array) -> Array:
    """(V,) RMS difference of each picture's answer from that of all others, in deviations; 1 is right.

    Args:
        reduced: (V, G, G) each picture's information.
        gradients: (V, G).
        prior: (G,) information of the usual values.
    """
    total = reduced.sum(axis=0) + np.diag(prior)
    root = np.sqrt(total.diagonal())
    out = np.zeros(len(reduced))
    for v, (part, gradient) in enumerate(zip(reduced / root / root[:, None], gradients / root, strict=True)):
        information, axes = np.linalg.eigh(part)
        known = information > DETERMINED * information[-1]
        half = axes[:, known] * np.sqrt(information[known])
        difference = half.T @ (axes[:, known] @ (axes[:, known].T @ gradient / information[known]))
        others = total / root / root[:, None] - part
        squares = difference @ difference + (half @ difference) @ np.linalg.solve(others, half @ difference)
        out[v] = np.sqrt(squares / known.sum())
    return out
