"""Damage: cells that fell out, dirt and scratches on the pattern, glare on the camera, inks that bled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene.errors import STRICT, SceneError

RGB = tuple[float, float, float]
Points = NDArray[np.float64]
DISC_POINTS = 48  # sides of a blob


@dataclass(frozen=True)
class Blob:
    """A disc of dirt on the pattern, in mm of the layout; it moves with the surface."""

    __pydantic_config__: ClassVar = STRICT

    centre_mm: tuple[float, float]
    radius_mm: float
    rgb: RGB = (90.0, 80.0, 70.0)

    def polygon(self) -> Points:
        """(K, 2) mm."""
        angle = 2 * np.pi * np.arange(DISC_POINTS) / DISC_POINTS
        return np.asarray(self.centre_mm) + self.radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def covers(self, xy_mm: Points) -> NDArray[np.bool_]:
        """Which of the points (..., 2) lie under it."""
        return np.asarray(np.linalg.norm(xy_mm - np.asarray(self.centre_mm), axis=-1) <= self.radius_mm)


@dataclass(frozen=True)
class Scratch:
    """A straight band on the pattern, from one point to another, in mm of the layout."""

    __pydantic_config__: ClassVar = STRICT

    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    width_mm: float
    rgb: RGB = (150.0, 150.0, 150.0)

    def __post_init__(self) -> None:
        if self.start_mm == self.end_mm:
            raise SceneError(f"a scratch starts and ends at {self.start_mm} mm; give it a length")

    def _frame(self) -> tuple[Points, Points, Points]:
        start, end = np.asarray(self.start_mm), np.asarray(self.end_mm)
        along = (end - start) / np.linalg.norm(end - start)
        return start, end, along

    def polygon(self) -> Points:
        """(4, 2) mm."""
        start, end, along = self._frame()
        side = 0.5 * self.width_mm * np.array([-along[1], along[0]])
        return np.stack([start - side, end - side, end + side, start + side])

    def covers(self, xy_mm: Points) -> NDArray[np.bool_]:
        """Which of the points (..., 2) lie under it."""
        start, end, along = self._frame()
        offset = xy_mm - start
        length = offset @ along
        aside = np.abs(offset @ np.array([-along[1], along[0]]))
        return np.asarray(
            (length >= 0) & (length <= np.linalg.norm(end - start)) & (aside <= 0.5 * self.width_mm)
        )


@dataclass(frozen=True)
class Glare:
    """A reflection fixed to the camera: a Gaussian spot adding ``strength`` (8-bit units) at its centre."""

    __pydantic_config__: ClassVar = STRICT

    centre_px: tuple[float, float]
    sigma_px: float
    strength: float = 300.0

    def __post_init__(self) -> None:
        if not self.sigma_px > 0:
            raise SceneError(f"a glare's sigma_px is {self.sigma_px:g}; it must be above 0 px")

    def plane(self, size: tuple[int, int]) -> NDArray[np.float32]:
        """(height, width) float32, added to every channel."""
        x = np.exp(-0.5 * ((np.arange(size[0]) - self.centre_px[0]) / self.sigma_px) ** 2)
        y = np.exp(-0.5 * ((np.arange(size[1]) - self.centre_px[1]) / self.sigma_px) ** 2)
        return np.asarray(self.strength * np.outer(y, x), dtype=np.float32)

    def covers(self, xy_px: Points) -> NDArray[np.bool_]:
        """Which of the points (..., 2) px are washed out: it adds 100 or more there."""
        distance = np.linalg.norm(xy_px - np.asarray(self.centre_px), axis=-1)
        return np.asarray(self.strength * np.exp(-0.5 * (distance / self.sigma_px) ** 2) >= 100)


@dataclass(frozen=True)
class Damage:
    """All that is wrong with a sample.

    Attributes:
        missing_cells: numbers of cells drawn in black.
        missing_share: share (0 to 1) of the other colored cells that fell out; the reference cell stays.
        blobs, scratches, glare: see there.
        bleed_mm: every ink's side runs outward, by a random distance from 0 to this.
    """

    __pydantic_config__: ClassVar = STRICT

    missing_cells: tuple[int, ...] = ()
    missing_share: float = 0.0
    blobs: tuple[Blob, ...] = ()
    scratches: tuple[Scratch, ...] = ()
    glare: tuple[Glare, ...] = ()
    bleed_mm: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.missing_share <= 1:
            raise SceneError(f"missing_share is {self.missing_share:g}; it must lie between 0 and 1")
        if not self.bleed_mm >= 0:
            raise SceneError(f"bleed_mm is {self.bleed_mm:g}; it must be 0 mm or more")


def sample_missing_cells(damage: Damage, layout: Layout, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(C,) bool: the cells that fell out.

    Raises:
        SceneError: a cell number that the layout does not have.
    """
    cells = len(layout.cell_color)
    gone = np.zeros(cells, dtype=np.bool_)
    for cell in damage.missing_cells:
        if not 0 <= cell < cells:
            raise SceneError(f"missing cell {cell}: the layout's cells are 0 to {cells - 1}")
        gone[cell] = True
    free = np.flatnonzero((layout.cell_color != BLACK) & ~gone & (np.arange(cells) != layout.reference_cell))
    gone[rng.permutation(free)[: round(damage.missing_share * len(free))]] = True
    return gone


def bleed_polygons(polygons_mm: Points, bleed_mm: float, rng: np.random.Generator) -> Points:
    """Counter-clockwise polygons (K, n, 2), every side moved outward by a random distance to ``bleed_mm``."""
    along = np.roll(polygons_mm, -1, axis=1) - polygons_mm
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    outward = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    offset = rng.uniform(0, bleed_mm, outward.shape[:2])
    # A corner is where the two moved sides meet: n . (p - corner) = offset for both.
    before, before_offset = np.roll(outward, 1, axis=1), np.roll(offset, 1, axis=1)
    normals = np.stack([before, outward], axis=-2)
    offsets = np.stack([before_offset, offset], axis=-1)
    return np.asarray(polygons_mm + np.linalg.solve(normals, offsets[..., None])[..., 0])
