"""The pad that a product makes: the outlines of its cells at the seen side, and the causes of their deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import DECIMALS, AsMade, Layout, equal_length_outlines
from cmpdesign.layout.side import seen_side

Points = NDArray[np.float64]
# Decimals in mm of places that were read in a picture: these digits are the same in every run on a machine.
READ_DECIMALS = 5
# A rounded corner moves a marker by at most this share of the lost length (read in pictures of all patterns): the
# corners of the cells around a marker lose the same length. A moved side moves its markers by the same distance.
CORNER_SHARE = 0.1


@dataclass(frozen=True)
class Cause:
    """A parameter that changes the made cells, and the largest distance by which it moves a marker, mm."""

    parameter: str
    effect_mm: float


@dataclass(frozen=True, eq=False)
class MadePad:
    """A pad as a product makes it.

    Attributes:
        nominal: layout of the design.
        layout: the same layout with the made cells (``as_made``).
        causes: what the made cells differ by.
    """

    nominal: Layout
    layout: Layout
    causes: tuple[Cause, ...] = ()

    @property
    def product(self) -> str:
        assert self.layout.as_made is not None
        return self.layout.as_made.product

    @property
    def main_cause(self) -> str:
        """The parameter with the largest effect; empty without parameters."""
        largest = max(self.causes, key=lambda cause: cause.effect_mm, default=Cause("", 0.0))
        return largest.parameter if largest.effect_mm > 0 else ""

    def figures(self) -> dict[str, Any]:
        """Side, areas in percent of the nominal cells, and the largest loss at a corner in mm."""
        assert self.layout.as_made is not None
        nominal = self.nominal.marker_xy_mm[self.nominal.cell_corners[self.nominal.colored_cells]]
        made = self.layout.colored_outlines_mm
        percent = 100 * _areas_mm2(made) / _areas_mm2(nominal)
        return {
            "side": self.layout.as_made.side,
            "area_percent": _rounded(100 * _areas_mm2(made).sum() / _areas_mm2(nominal).sum()),
            "area_worst_percent": _rounded(percent[np.abs(percent - 100).argmax()]),
            "corner_loss_mm": _rounded(_corner_losses_mm(nominal, made).max()),
            "causes_mm": {cause.parameter: _rounded(cause.effect_mm) for cause in self.causes},
        }

    def with_markers(self, xy_mm: Points) -> MadePad:
        """The pad with markers at the read places; (M, 2) mm, NaN: the marker is not read and has its nominal place."""
        places = np.where(np.isfinite(xy_mm), np.round(xy_mm, READ_DECIMALS), self.nominal.marker_xy_mm) + 0.0
        return replace(self, layout=replace(self.layout, marker_xy_mm=places))


def make_pad(
    layout: Layout,
    product: str,
    outlines_mm: Sequence[Points],
    causes: Sequence[Cause] = (),
    variance_mm2: float | None = None,
) -> MadePad:
    """Make the pad of a product.

    Args:
        layout: the nominal layout.
        product: name of the product.
        outlines_mm: (K, 2) outline of each cell that is not black, in the layout's order and frame.
        causes: parameters that change the outlines.
        variance_mm2: variance of the markers' places between pads, per axis; None where not known.
    """
    counter_clockwise = [ring if _signed_area_mm2(ring) >= 0 else ring[::-1] for ring in outlines_mm]
    outlines = np.round(equal_length_outlines(counter_clockwise), DECIMALS) + 0.0
    covariance = None
    if variance_mm2 is not None:
        covariance = np.broadcast_to(variance_mm2 * np.eye(2), (len(layout.marker_xy_mm), 2, 2)).copy()
    made = AsMade(layout.digest, product, seen_side(layout.mirrored), outlines, covariance)
    return MadePad(layout, replace(layout, as_made=made), tuple(causes))


def cut_by_later(outlines_mm: Sequence[Points]) -> list[Points]:
    """The remaining part of each cell when the cells are made one after the other, and a later cell replaces earlier
    cells.

    Args:
        outlines_mm: (K, 2) outlines in the order of making; an area that an outline encloses twice belongs to the cell.

    Returns:
        The outline of each cell's largest part.
    """
    import shapely

    cells = shapely.make_valid(
        np.array([shapely.Polygon(ring) for ring in outlines_mm]), method="structure", keep_collapsed=False
    )
    earlier, later = shapely.STRtree(cells).query(cells, predicate="intersects")
    found = list(outlines_mm)
    for cell in np.unique(earlier[later > earlier]).tolist():
        cutters = cells[later[(earlier == cell) & (later > cell)]]
        rest = shapely.difference(cells[cell], shapely.union_all(cutters))
        parts = [part for part in shapely.get_parts(rest) if part.geom_type == "Polygon"]
        if parts:
            largest = max(parts, key=lambda part: float(part.area))
            found[cell] = shapely.get_coordinates(largest.exterior)[:-1]
    return found


def _signed_area_mm2(ring: Points) -> float:
    x, y = ring.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def _areas_mm2(outlines: Points) -> Points:
    """(N,) areas of (N, K, 2) outlines."""
    x, y = outlines[..., 0], outlines[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2)


def _corner_losses_mm(nominal: Points, made: Points) -> Points:
    """(N,) largest distance from a nominal corner to the made cell; 0 where the corner lies inside."""
    import shapely

    cells = shapely.polygons(made)[:, None]
    distances: Points = shapely.distance(cells, shapely.points(nominal))
    return np.asarray(distances.max(axis=1))


def _rounded(value: float) -> float:
    """6 decimals, so that every computer writes the same figure."""
    return round(float(value), 6) + 0.0
