"""The disagreement of the gridlines that meet at markers, and the variance that it shows.

A marker has two unknowns and up to six gridlines. Where noise alone moves gridlines, the squared distances between each
gridline's own place and its place by the solved markers add up to the degrees of freedom. Halos, clipping,
displaced ink edges, dirt and compression increase these distances. The ratio, of the picture and of the
gridlines around each marker, multiplies the variance of the noise (the Birge ratio; Birge, Phys. Rev. 40, 207, 1932).
"""

from __future__ import annotations

from typing import NamedTuple


class DisagreementLimits(NamedTuple):
    """Limits of the variance that the disagreement shows.

    Attributes:
        tail_freedom: degrees of freedom of the t distribution by which gridlines count for their picture. Chosen;
            `python -m benchmarks.calibration` judges it.
        picture_freedom: degrees of freedom by which the picture's ratio counts beside that of the gridlines around.
            Chosen; `python -m benchmarks.calibration` judges it.
        rounds: of the picture's ratio. Chosen.
        min_freedom: degrees of freedom of a gridline, at least. Derived: it only keeps a division from failing.
        max_square: of a distance over its deviation, at most. Derived: it only keeps a division from failing.
        min_ratio: of variances, at least. Derived: it only keeps a division from failing.
        min_determinant: of a gridline's two ends, relative to the product of their sums; with less the two ends are not
            told apart, and the gridline does not count. Chosen.
        min_block_determinant: of a marker's block, relative to its squared trace; with less, all gridlines at the
            marker run in one direction. Derived: far above rounding.
    """

    tail_freedom: float = 6.0
    picture_freedom: float = 20.0
    rounds: int = 4
    min_freedom: float = 0.1
    max_square: float = 1e6
    min_ratio: float = 1e-3
    min_determinant: float = 1e-6
    min_block_determinant: float = 1e-9


LIMITS = DisagreementLimits()
