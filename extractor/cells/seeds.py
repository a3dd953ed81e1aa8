"""Stage 3: the pixel domains of the inks, one seed for each, and the domains' moments."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.image.ink_segmentation import Segmentation

NO_DOMAIN_LIMIT = 1 << 62


class DomainLimits(NamedTuple):
    """Limits of the domains.

    Attributes:
        min_domain_px: px^2; smaller domains are ignored. Chosen.
        min_cluttered_px: px^2, of a domain in a cluttered image: a cell with edges of 5 px. Derived.
        min_solidity: area of a domain in a cluttered image, relative to the root of the determinant of its pixels'
            covariance: a triangle has 10.4, an ellipse 12.6, ragged shapes have less. Measured: rule "clutter".
        safe_area_px: px^2, of a domain for safe recognition: a cell with edges of 7 px. Derived: 0.43 times 7 squared.
        max_small_share: of the domains, that may be smaller. Chosen.
    """

    min_domain_px: int = 4
    min_cluttered_px: int = 12
    min_solidity: float = 8.0
    safe_area_px: int = 20
    max_small_share: float = 1 / 6


LIMITS = DomainLimits()


class SeedPoints(NamedTuple):
    """The seeds of N domains.

    Attributes:
        xy: (N, 2) int32, the pixel of the domain nearest to its center.
        center: (N, 2) float64, the domain's geometric center, px.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
    """

    xy: NDArray[np.int32]
    center: NDArray[np.float64]
    ink: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Seeds:
    """Stage 3: one seed per domain, computed at its first use.

    Attributes:
        area_px: (N,) int64, the domain's area, px^2.
        runs: (R, 4) int32, the domains' horizontal runs: y, first x, last x, ink.
        domain: (R,) int32, the domain of each run.
        cluttered: there were more domains than in any pattern; only domains that may be cells are kept.
        has_large_domains: only few domains are too small for safe recognition.
    """

    area_px: NDArray[np.int64]
    runs: NDArray[np.int32]
    domain: NDArray[np.int32]
    cluttered: bool
    has_large_domains: bool

    @property
    def xy(self) -> NDArray[np.int32]:
        """(N, 2) int32, x and y of the seed."""
        return self.points.xy

    @property
    def center(self) -> NDArray[np.float64]:
        """(N, 2) float64, the domain's geometric center, px."""
        return self.points.center

    @property
    def ink(self) -> NDArray[np.uint8]:
        """(N,) uint8, 1 red, 2 green, 3 blue."""
        return self.points.ink

    @cached_property
    def points(self) -> SeedPoints:
        """The seeds."""
        return SeedPoints(*native.seed_points(self.runs, self.domain, self.area_px))


def find_seeds(segmentation: Segmentation, max_domains: int = NO_DOMAIN_LIMIT) -> Seeds:
    """Stage 3: one seed per domain; domains of fewer than ``DomainLimits.min_domain_px`` pixels are ignored.

    The seed is the domain's pixel nearest to its geometric center.

    Args:
        segmentation: the ink of every pixel.
        max_domains: above this number of domains, small and ragged domains are ignored, too: an image of noise has many
            times more domains than any pattern.
    """
    return Seeds(*native.find_domains(segmentation.label, max_domains, LIMITS))


def domain_moments(seeds: Seeds) -> NDArray[np.float64]:
    """(N, 10) float64, the moments of domains about their seeds, as ``Regions.moments`` of grown regions."""
    return np.asarray(native.domain_moments(seeds.runs, seeds.domain, seeds.xy))
