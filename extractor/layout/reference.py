"""The reader's value of a layout: a pattern as ``layout.json`` describes it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as with_default
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.frozen_record import FrozenRecord
from extractor.layout.consistency import check_consistency

COLORS = ("red", "green", "blue", "black", "white")
RED, GREEN, BLUE, BLACK, WHITE = range(5)
ARRAY_FIELDS = (
    "layer", "index", "xy_mm", "cell_corners", "cell_color", "edges", "outline_mm", "fiducials_mm",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class AsMade(FrozenRecord):
    """The differences of a made pad from its nominal layout. The layout's markers are at the places as made.

    Attributes:
        of: digest of the nominal layout.
        product: product that made the pad: "laser", "mold", "print"; "measured" for a layout from pictures of the pad.
        side: side of the measurement or of the outlines: "front" or "back".
        outlines_mm: one (K, 2) float64 outline for each cell that is not black; None: triangles between the markers.
        covariance_mm2: (M, 2, 2) float64, of the places of the layout's markers, NaN for a marker that was not
            measured and stays at its nominal place; None: unknown.
        cell_height_mm: height of the cells over the black, which holds the markers, towards the camera; negative:
            recessed cells; 0: flat.
    """

    of: str
    product: str
    side: str
    outlines_mm: tuple[NDArray[np.float64], ...] | None = None
    covariance_mm2: NDArray[np.float64] | None = None
    cell_height_mm: float = 0.0

    def __post_init__(self) -> None:
        if self.covariance_mm2 is not None:
            self.covariance_mm2.setflags(write=False)


@dataclass(frozen=True)
class PadCode:
    """The code of a pad: which black cells of the plain pattern are white.

    Attributes:
        id: 1 to 255.
        share: the share of white cells among the cells that are black or white, before clipping.
    """

    id: int
    share: float


@dataclass(frozen=True, eq=False)
class Reference(FrozenRecord):
    """A pattern as the layout file describes it, in read-only arrays and mappings.

    Layout frame: mm, origin at marker 0, x right, y up, seen from the front. A ``Reference`` is checked when the value
    is made, also by ``dataclasses.replace``: all code that takes one, native code included, relies on this check.

    Attributes:
        pattern: the pattern's name.
        parameters: the design's parameters.
        layer, index: (M,) int32, of the markers by id. In a square pattern: row and column.
        xy_mm: (M, 2) float64, the markers by id.
        cell_corners: (C, 3) int32, in a square pattern (C, 4): marker ids counter-clockwise from the front.
        cell_color: (C,) uint8: red 0, green 1, blue 2, black 3, white 4.
        edges: (E, 2) int32, each from its smaller to its larger marker id, in ascending order.
        virtual_per_edge: virtual markers on every edge.
        reference_cell, reference_marker: the cell that fixes the numbering, and the corner of it where the numbering
            starts.
        palette: color name -> "#rrggbb".
        border_mm: width of the black border.
        outline_mm: (K, 2) float64, the closed outline of the black ground, counter-clockwise.
        digest: SHA-256 (hex) of the geometry.
        fiducials_mm: (F, 2) float64, centres of the marks around the pattern; empty without marks.
        fiducial_diameter_mm: diameter of these marks.
        code: the pad's code; None: the reference cell alone is white.
        as_made: differences of a made pad from its design; None for a pad as designed.

    Raises:
        LayoutError: an array of another dtype or shape, an index out of range, or fields that contradict each other.
    """

    pattern: str
    parameters: Mapping[str, Any]
    layer: NDArray[np.int32]
    index: NDArray[np.int32]
    xy_mm: NDArray[np.float64]
    cell_corners: NDArray[np.int32]
    cell_color: NDArray[np.uint8]
    edges: NDArray[np.int32]
    virtual_per_edge: int
    reference_cell: int
    reference_marker: int
    palette: Mapping[str, str]
    border_mm: float
    outline_mm: NDArray[np.float64]
    digest: str
    fiducials_mm: NDArray[np.float64] = with_default(default_factory=lambda: np.empty((0, 2)))
    fiducial_diameter_mm: float = 0.0
    code: PadCode | None = None
    as_made: AsMade | None = None

    def __repr__(self) -> str:
        made = "" if self.as_made is None else f", as made ({self.as_made.product})"
        return f"<Reference {self.pattern}: {self.layers} layers, {len(self.layer)} markers{made}>"

    def __post_init__(self) -> None:
        check_consistency(self)
        for name in ARRAY_FIELDS:
            getattr(self, name).setflags(write=False)
        self._freeze_mappings("parameters", "palette")

    @property
    def mirrored(self) -> bool:
        """Whether the camera sees the pattern's back, by the design."""
        return bool(self.parameters.get("mirrored", False))

    @property
    def layers(self) -> int:
        """The number of the outermost layer (in a square pattern: of the last row)."""
        return int(self.layer[-1])

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """(M,) bool, the markers that touch a colored or white cell; the others are invisible on black."""
        present = np.zeros(len(self.layer), dtype=np.bool_)
        present[self.cell_corners[self.cell_color != BLACK]] = True
        present.setflags(write=False)
        return present

    def geometry_digest(self) -> str:
        """SHA-256 (hex) of layer, index, corners, color, edges as little-endian int32, then x, y as float64."""
        digest = hashlib.sha256()
        for column in (self.layer, self.index, self.cell_corners, self.cell_color, self.edges):
            digest.update(column.astype("<i4").tobytes())
        for axis in (0, 1):
            digest.update(self.xy_mm[:, axis].astype("<f8").tobytes())
        return digest.hexdigest()
