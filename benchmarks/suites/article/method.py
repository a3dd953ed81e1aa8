"""The article's whole method: regions by AGA, triangles fitted to contours, merged corners, SSA."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.article.corners import Triangles, fit_plain_triangles
from benchmarks.suites.article.graph import connect_corners
from benchmarks.suites.article.numbering import Numbering, make_lattice_tables, number_triangles
from benchmarks.suites.article.regions import grow_from_hues
from extractor import Reference
from extractor.pipeline import ImageReader


class ArticleReading(NamedTuple):
    """The triangles of an image and their numbers; None without a white cell."""

    triangles: Triangles
    numbering: Numbering | None


class ArticleReader:
    """Reads images of one triangular layout."""

    def __init__(self, reference: Reference) -> None:
        self._lattice, self._palette = make_lattice_tables(reference), dict(reference.palette)
        self._reader = ImageReader(reference)

    def read(self, image: NDArray[np.uint8]) -> ArticleReading:
        """Read an image (H, W, 3) BGR."""
        pyramid = self._reader.pyramid(image)
        assert pyramid is not None
        triangles = fit_plain_triangles(grow_from_hues(pyramid.level(1), self._palette))
        numbering = number_triangles(image, triangles, connect_corners(triangles), self._lattice)
        return ArticleReading(triangles, numbering)
