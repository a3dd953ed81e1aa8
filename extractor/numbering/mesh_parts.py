"""The connected components of the cell mesh, and the faces that are markers: the start of the numbering."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells


class MarkerTurnLimits(NamedTuple):
    """Limits of the samples that distinguish markers from black cells.

    Attributes:
        max_sampled_faces: faces that are sampled to find the orientation of the markers. Chosen.
        min_sampled_faces: of each orientation; with fewer the orientation of the markers is unknown. Chosen.
        sample_radius: of a color sample, relative to the distance from a face's middle to its nearest cell. Chosen.
    """

    max_sampled_faces: int = 80
    min_sampled_faces: int = 4
    sample_radius: float = 0.12


LIMITS = MarkerTurnLimits()


def largest_components(mesh: CellMesh, count: int) -> list[NDArray[np.intp]]:
    """The faces of each of the ``count`` largest connected components of the mesh, the largest first."""
    faces, begin = native.faces_by_component(mesh.neighbours, mesh.orientation)
    return [faces[begin[i] : begin[i + 1]] for i in range(min(count, len(begin) - 1))]


def marker_turns(image: NDArray[np.uint8], cells: Cells, mesh: CellMesh) -> list[int]:
    """The possible orientations of the faces that are markers, +1 or -1, the likelier orientation first.

    Markers are brighter than black cells.
    """
    front = native.marker_turn_by_brightness(image, cells.center_px, mesh.faces, mesh.orientation, LIMITS)
    return [front] if front != 0 else [1, -1]
