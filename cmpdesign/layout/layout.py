"""The layout: every marker, cell and edge of a pattern, in frozen arrays, independent of file formats."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK
from cmpdesign.patterns.pad_code import PadCode

# Coordinates are rounded to a picometre, so that every machine writes the same digits.
DECIMALS = 9


@dataclass(frozen=True, eq=False)
class AsMade:
    """The differences of a made pad from its nominal layout. The layout's markers are at the places as made.

    Attributes:
        of: digest of the nominal layout.
        product: product that made the pad: "laser", "mold", "print"; "measured" for a layout from pictures of the pad.
        side: side of the measurement or of the outlines: "front" or "back".
        outlines_mm: (N, K, 2) float64, layout frame: outline of every cell that is not black, in the layout's order,
            counter-clockwise from the front; shorter outlines repeat their last point. None: triangles between the
            markers.
        covariance_mm2: (M, 2, 2) float64, of the places of the layout's markers, NaN for a marker that was not
            measured and stays at its nominal place; None: unknown.
        cell_height_mm: height of the cells over the black, which holds the markers, towards the camera; negative:
            recessed cells; 0: flat.
    """

    of: str
    product: str
    side: Literal["front", "back"]
    outlines_mm: NDArray[np.float64] | None = None
    covariance_mm2: NDArray[np.float64] | None = None
    cell_height_mm: float = 0.0

    def __post_init__(self) -> None:
        for column in (self.outlines_mm, self.covariance_mm2):
            if column is not None:
                column.setflags(write=False)


@dataclass(frozen=True, eq=False)
class Layout:
    """A pattern's geometry in the layout frame (mm, origin at marker 0, x right, y up, seen from the front).

    Attributes:
        pattern: the registered pattern's name.
        parameters: the design's parameters, resolved; ``mirrored``: the camera sees the pattern's back.
        marker_layer, marker_index: (M,) int32; a marker's position in the arrays is its id.
        marker_xy_mm: (M, 2) float64, rounded to 1e-9 mm.
        cell_corners: (C, 3) int32 (square: (C, 4)), marker ids counter-clockwise from the front.
        cell_color: (C,) uint8, an index into ``COLORS``.
        edges: (E, 2) int32, each from its smaller to its larger marker id, in ascending order.
        virtual_per_edge: virtual markers on every edge.
        reference_cell, reference_marker: the reference cell and the marker at which numbering starts.
        palette: color name -> "#rrggbb".
        border_mm: width of the black border around the pattern.
        outline_mm: (K, 2) float64, the ground's closed outline (border included), counter-clockwise, the
            first point not repeated.
        fiducials_mm: (F, 2) float64, centres of the marks around the pattern; none by default.
        fiducial_diameter_mm: the marks' diameter.
        code: the pad's code; None: the reference cell alone is white.
        as_made: differences of a made pad from the design; None: as designed.
    """

    pattern: str
    parameters: Mapping[str, Any]
    marker_layer: NDArray[np.int32]
    marker_index: NDArray[np.int32]
    marker_xy_mm: NDArray[np.float64]
    cell_corners: NDArray[np.int32]
    cell_color: NDArray[np.uint8]
    edges: NDArray[np.int32]
    virtual_per_edge: int
    reference_cell: int
    reference_marker: int
    palette: Mapping[str, str]
    border_mm: float
    outline_mm: NDArray[np.float64]
    fiducials_mm: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    fiducial_diameter_mm: float = 0.0
    code: PadCode | None = None
    as_made: AsMade | None = None

    def __post_init__(self) -> None:
        columns: tuple[NDArray[Any], ...] = (
            self.marker_layer,
            self.marker_index,
            self.marker_xy_mm,
            self.cell_corners,
            self.cell_color,
            self.edges,
            self.outline_mm,
        )
        for column in columns:
            column.setflags(write=False)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "palette", MappingProxyType(dict(self.palette)))

    def __repr__(self) -> str:
        made = "" if self.as_made is None else f", as made ({self.as_made.product})"
        width, height = self.size_mm
        return (
            f"<Layout {self.pattern}: {self.parameters['layers']} layers, {len(self.marker_xy_mm)} markers, "
            f"{width:.4g} x {height:.4g} mm{made}>"
        )

    @property
    def mirrored(self) -> bool:
        """True when the camera sees the pattern's back."""
        return bool(self.parameters.get("mirrored", False))

    @cached_property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the outline, border included."""
        width, height = np.ptp(self.outline_mm, axis=0)
        return float(width), float(height)

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """(M,) bool: the marker touches a colored or white cell. Other markers cannot be seen."""
        present = np.zeros(len(self.marker_xy_mm), dtype=np.bool_)
        present[self.cell_corners[self.cell_color != BLACK]] = True
        present.setflags(write=False)
        return present

    @cached_property
    def colored_cells(self) -> NDArray[np.int64]:
        """(N,) numbers of the cells that are not black."""
        return np.flatnonzero(self.cell_color != BLACK)

    @cached_property
    def colored_outlines_mm(self) -> NDArray[np.float64]:
        """(N, K, 2) outlines of the ``colored_cells``: as made where known, else the cells' corners."""
        if self.as_made is not None and self.as_made.outlines_mm is not None:
            return self.as_made.outlines_mm
        outlines: NDArray[np.float64] = self.marker_xy_mm[self.cell_corners[self.colored_cells]]
        return outlines

    @property
    def cell_height_mm(self) -> float:
        """Height of the cells over the black, towards the camera; negative: recessed; 0 for a flat pad."""
        return 0.0 if self.as_made is None else self.as_made.cell_height_mm

    @cached_property
    def virtual_xy_mm(self) -> NDArray[np.float64]:
        """(E, m, 2) float64 mm: virtual marker j of m lies at the fraction (j + 1) / (m + 1) from the smaller id."""
        start, end = self.marker_xy_mm[self.edges[:, 0]], self.marker_xy_mm[self.edges[:, 1]]
        share = (np.arange(self.virtual_per_edge) + 1) / (self.virtual_per_edge + 1)
        points = start[:, None] + share[:, None] * (end - start)[:, None]
        points.setflags(write=False)
        return points

    @cached_property
    def digest(self) -> str:
        """SHA-256 (hex) of the geometry: int32 layer, index, corners, color, edges, then float64 x, y.

        All arrays are little-endian and in C order.
        """
        digest = hashlib.sha256()
        for column, dtype in (
            (self.marker_layer, "<i4"),
            (self.marker_index, "<i4"),
            (self.cell_corners, "<i4"),
            (self.cell_color, "<i4"),
            (self.edges, "<i4"),
            (self.marker_xy_mm[:, 0], "<f8"),
            (self.marker_xy_mm[:, 1], "<f8"),
        ):
            digest.update(np.ascontiguousarray(column, dtype=dtype).tobytes())
        return digest.hexdigest()


def equal_length_outlines(outlines: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(N, K, 2) outlines of one array; shorter outlines repeat their last point."""
    longest = max(map(len, outlines))
    return np.stack([np.concatenate([o, np.repeat(o[-1:], longest - len(o), axis=0)]) for o in outlines])
