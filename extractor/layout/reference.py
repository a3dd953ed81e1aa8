"""The layout that an image is compared with: an independent reader of ``layout.json``, version 1.

The file is the only bridge from the generator. Nothing in it is believed: every field is checked, then the
fields against each other, then the digest of the geometry. ``layout.schema.json`` describes the format.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as with_default
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

COLORS = ("red", "green", "blue", "black", "white")
RED, GREEN, BLUE, BLACK, WHITE = range(5)


@dataclass(frozen=True, eq=False)
class Reference:
    """A pattern as the layout file describes it, in read-only arrays.

    Layout frame: mm, origin at marker 0, x right, y up, seen from the front.

    Attributes:
        pattern: the pattern's name.
        parameters: the design's parameters.
        layer, index: (M,) int32; a marker's place in the arrays is its id. Square: row and column.
        xy_mm: (M, 2) float64.
        cell_corners: (C, 3) int32, in a square pattern (C, 4): marker ids counter-clockwise from the front.
        cell_color: (C,) uint8: red 0, green 1, blue 2, black 3, white 4.
        edges: (E, 2) int32, each from its smaller to its larger marker id, in ascending order.
        virtual_per_edge: virtual markers on every edge.
        reference_cell, reference_marker: the cell that fixes the numbering, and its corner where it starts.
        palette: color name -> "#rrggbb".
        border_mm: width of the black border.
        outline_mm: (K, 2) float64, the ground's closed outline, counter-clockwise.
        digest: SHA-256 (hex) of the geometry.
        fiducials_mm: (F, 2) float64, centres of the marks around the pattern; empty where there are none.
        fiducial_diameter_mm: their diameter.
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

    def __post_init__(self) -> None:
        for name in ("layer", "index", "xy_mm", "cell_corners", "cell_color", "edges", "outline_mm"):
            getattr(self, name).setflags(write=False)
        self.fiducials_mm.setflags(write=False)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "palette", MappingProxyType(dict(self.palette)))

    @property
    def mirrored(self) -> bool:
        """True when the camera is meant to look at the pattern's back."""
        return bool(self.parameters.get("mirrored", False))

    @property
    def layers(self) -> int:
        """The outermost layer's number (in a square pattern: the last row's)."""
        return int(self.layer[-1])

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """(M,) True for markers that touch a colored or white cell; no other can be seen on black."""
        present = np.zeros(len(self.layer), dtype=np.bool_)
        present[self.cell_corners[self.cell_color != BLACK]] = True
        present.setflags(write=False)
        return present
