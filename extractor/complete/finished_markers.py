"""What follows refinement, in one native call: repair, jumps of the image along its rows, and the image's quality."""

from __future__ import annotations

from typing import NamedTuple

from extractor._native import complete as native
from extractor.complete.image_quality import CellFigures, SampledCells
from extractor.complete.repair import RepairedMarkers
from extractor.complete.row_breaks import StripJumps
from extractor.image.pyramid import PyramidLevel
from extractor.layout.lattice_tables import Lattice
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import RefinedMarkers


class FinishedMarkers(NamedTuple):
    """The markers after repair, and the figures of their image.

    Attributes:
        repaired: the markers, in the plane of the black.
        jumps: of the refined markers before inconsistent ones were dropped: a break makes them inconsistent.
        cells: the figures at the middles of the sampled cells.
        noise: standard deviation of one channel's noise, gray levels of 255.
        edge_px: median distance of neighbouring markers, px; NaN without any.
        are_all_measured: every marker of the layout is.
    """

    repaired: RepairedMarkers
    jumps: StripJumps
    cells: CellFigures
    noise: float
    edge_px: float
    are_all_measured: bool


def finish_markers(
    view: PyramidLevel,
    refined: RefinedMarkers,
    places: InitialMarkers,
    lattice: Lattice,
    topology: Topology,
    cells: SampledCells,
) -> FinishedMarkers:
    """Drop inconsistent markers, repair lost markers that the others predict, combine uncertain markers with
    predictions, and measure the image. No marker is reported outside the image.

    Args:
        view: the image at full scale.
        refined: the markers after refinement.
        places: the markers before refinement.
        cells: at which the quality is measured.
    """
    return native.finish_markers(view, refined, places, lattice.ring_tables, topology, cells)
