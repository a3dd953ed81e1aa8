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
        tail_freedom: degrees of freedom of the t distribution by which gridlines count for their picture.
        picture_freedom: degrees of freedom by which the picture's ratio counts beside that of the gridlines around.
        rounds: of the picture's ratio.
        min_freedom: degrees of freedom of a gridline, at least.
        max_square: of a distance over its deviation, at most.
        min_ratio: of variances, at least.
        min_determinant: of a gridline's two ends, relative to the product of their sums; below this value the two ends
            are not distinguished, and the gridline does not count.
        min_block_determinant: squared gray levels per px^2, squared; the least determinant of a marker's block by which
            is divided.
    """

    tail_freedom: float = 6.0
    picture_freedom: float = 20.0
    rounds: int = 4
    min_freedom: float = 0.1
    max_square: float = 1e6
    min_ratio: float = 1e-3
    min_determinant: float = 1e-6
    min_block_determinant: float = 1e-12


LIMITS = DisagreementLimits()
