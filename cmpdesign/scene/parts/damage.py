"""Damage: missing cells, dirt and scratches on the pattern, glare in the camera, bleeding inks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene.errors import STRICT, SceneError

RGB = tuple[float, float, float]
Points = NDArray[np.float64]
DISC_POINTS = 48  # sides of a blob
GLARE_LIMIT = 100  # 8-bit units; glare hides markers where it adds this or more


@dataclass(frozen=True)
class Blob:
    """A disc of dirt on the pattern, in mm of the layout frame; it moves with the surface."""

    __pydantic_config__: ClassVar = STRICT

    centre_mm: tuple[float, float]
    radius_mm: float
    rgb: RGB = (90.0, 80.0, 70.0)

    def polygon(self) -> Points:
        """(K, 2) mm, counter-clockwise."""
        angle = 2 * np.pi * np.arange(DISC_POINTS) / DISC_POINTS
        return np.asarray(self.centre_mm) + self.radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def covers(self, xy_mm: Points) -> NDArray[np.bool_]:
        """(...) bool: which of the points (..., 2) mm the disc covers."""
        return np.asarray(np.linalg.norm(xy_mm - np.asarray(self.centre_mm), axis=-1) <= self.radius_mm)


class _ScratchAxis(NamedTuple):
    """(2,) each: start and end in mm, and the unit direction."""

    start: Points
    end: Points
    direction: Points


@dataclass(frozen=True)
class Scratch:
    """A straight band on the pattern, from one point to another, in mm of the layout frame."""

    __pydantic_config__: ClassVar = STRICT

    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    width_mm: float
    rgb: RGB = (150.0, 150.0, 150.0)

    def __post_init__(self) -> None:
        if self.start_mm == self.end_mm:
            raise SceneError(f"a scratch starts and ends at {self.start_mm} mm; give it a length")

    def _axis(self) -> _ScratchAxis:
        start, end = np.asarray(self.start_mm), np.asarray(self.end_mm)
        return _ScratchAxis(start, end, (end - start) / np.linalg.norm(end - start))

    def polygon(self) -> Points:
        """(4, 2) mm, counter-clockwise."""
        start, end, direction = self._axis()
        side = 0.5 * self.width_mm * np.array([-direction[1], direction[0]])
        return np.stack([start - side, end - side, end + side, start + side])

    def covers(self, xy_mm: Points) -> NDArray[np.bool_]:
        """(...) bool: which of the points (..., 2) mm the band covers."""
        start, end, direction = self._axis()
        offset = xy_mm - start
        along = offset @ direction
        across = np.abs(offset @ np.array([-direction[1], direction[0]]))
        return np.asarray(
            (along >= 0) & (along <= np.linalg.norm(end - start)) & (across <= 0.5 * self.width_mm)
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
        """(height, width) float32 that is added to every channel, for an image of (width, height) px."""
        x = np.exp(-0.5 * ((np.arange(size[0]) - self.centre_px[0]) / self.sigma_px) ** 2)
        y = np.exp(-0.5 * ((np.arange(size[1]) - self.centre_px[1]) / self.sigma_px) ** 2)
        return np.asarray(self.strength * np.outer(y, x), dtype=np.float32)

    def covers(self, xy_px: Points) -> NDArray[np.bool_]:
        """(...) bool: at which of the points (..., 2) px the glare adds ``GLARE_LIMIT`` or more."""
        distance = np.linalg.norm(xy_px - np.asarray(self.centre_px), axis=-1)
        return np.asarray(self.strength * np.exp(-0.5 * (distance / self.sigma_px) ** 2) >= GLARE_LIMIT)


@dataclass(frozen=True)
class Damage:
    """All damage of a sample.

    Attributes:
        missing_cells: numbers of cells drawn in black.
        missing_share: share (0 to 1) of the other colored cells that are missing, except for the reference cell.
        blobs, scratches, glare: see the classes.
        bleed_mm: every side of a colored cell moves outward by a random distance from 0 to this.
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
    """(C,) bool: the missing cells.

    Raises:
        SceneError: the layout has no cell of this number.
    """
    cells = len(layout.cell_color)
    missing = np.zeros(cells, dtype=np.bool_)
    for cell in damage.missing_cells:
        if not 0 <= cell < cells:
            raise SceneError(f"missing cell {cell}: the layout's cells are 0 to {cells - 1}")
        missing[cell] = True
    candidates = np.flatnonzero(
        (layout.cell_color != BLACK) & ~missing & (np.arange(cells) != layout.reference_cell)
    )
    missing[rng.permutation(candidates)[: round(damage.missing_share * len(candidates))]] = True
    return missing


def bleed_polygons(polygons_mm: Points, bleed_mm: float, rng: np.random.Generator) -> Points:
    """Counter-clockwise polygons (K, n, 2) mm with every side moved outward by a random distance up to ``bleed_mm``."""
    along = np.roll(polygons_mm, -1, axis=1) - polygons_mm
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    outward = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    offset = rng.uniform(0, bleed_mm, outward.shape[:2])
    # A new corner is the intersection of two moved sides: n . (p - corner) = offset for both.
    previous, previous_offset = np.roll(outward, 1, axis=1), np.roll(offset, 1, axis=1)
    normals = np.stack([previous, outward], axis=-2)
    offsets = np.stack([previous_offset, offset], axis=-1)
    return np.asarray(polygons_mm + np.linalg.solve(normals, offsets[..., None])[..., 0])
