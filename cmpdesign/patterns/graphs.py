"""Graphs of patterns: markers, cells, colors and the rim, without positions.

A pattern embeds one of these graphs. ``TRIANGULAR_GRAPHS`` is the multicolor CMP, ``SQUARE_GRAPHS`` the former CMP.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK, RED, WHITE
from cmpdesign.patterns.numbering import Ints, id_from_axial, layer_from_id, marker_count

MAX_LAYERS = 200


@dataclass(frozen=True, eq=False)
class MarkerGraph:
    """The graph of a given number of layers.

    Attributes:
        layer, index: (M,) int64, by marker id. In square graphs they are row and column.
        corners: (C, 3) or (C, 4) int64, marker ids counter-clockwise from the front.
        color: (C,) uint8, an index into ``colors.COLORS``.
        reference_cell, reference_marker: the cell and the marker at which numbering starts.
    """

    layer: Ints
    index: Ints
    corners: Ints
    color: NDArray[np.uint8]
    reference_cell: int
    reference_marker: int


@dataclass(frozen=True)
class GraphFamily:
    """A family of graphs, one for every number of layers.

    Attributes:
        name: "triangular" or "square".
        make_graph: layers -> ``MarkerGraph``.
        rim: layers -> (layer, index) arrays of the outermost markers, counter-clockwise, each once.
        centre: layers -> (layer, index) arrays of the markers whose mean is the pattern's centre.
    """

    name: str
    make_graph: Callable[[int], MarkerGraph]
    rim: Callable[[int], tuple[Ints, Ints]]
    centre: Callable[[int], tuple[Ints, Ints]]


def _triangular_graph(layers: int) -> MarkerGraph:
    layer, index = layer_from_id(np.arange(marker_count(layers)))
    span = np.arange(-layers, layers + 1)
    q, r = (grid.ravel() for grid in np.meshgrid(span, span, indexing="ij"))
    up = np.stack([q, r, q + 1, r, q, r + 1], axis=-1)
    down = np.stack([q, r, q, r + 1, q - 1, r + 1], axis=-1)
    # Colors repeat along (q - r) mod 3, so that every inner marker touches one red, one green and one blue cell.
    up_color = RED + (q - r) % 3
    down_color = np.where((q == 0) & (r == 0), WHITE, BLACK)

    axial = np.concatenate([up, down]).reshape(-1, 3, 2)
    color = np.concatenate([up_color, down_color]).astype(np.uint8)
    corner_q, corner_r = axial[..., 0], axial[..., 1]
    corner_layer = np.maximum(np.maximum(np.abs(corner_q), np.abs(corner_r)), np.abs(corner_q + corner_r))
    within = (corner_layer <= layers).all(axis=1)
    corners, color = id_from_axial(corner_q[within], corner_r[within]), color[within]

    # Cells are sorted from the centre outward.
    order = np.lexsort(np.sort(corners, axis=1).T)
    corners, color = corners[order], color[order]
    return MarkerGraph(layer, index, corners, color, int(np.flatnonzero(color == WHITE)[0]), 0)


def _triangular_rim(layers: int) -> tuple[Ints, Ints]:
    index = np.arange(6 * layers)[::-1]
    return np.full_like(index, layers), index


def _triangular_centre(layers: int) -> tuple[Ints, Ints]:
    return np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)


def _square_graph(layers: int) -> MarkerGraph:
    side = 2 * layers + 2
    row, column = (grid.ravel() for grid in np.divmod(np.arange(side * side), side))
    i, j = (grid.ravel() for grid in np.divmod(np.arange((side - 1) ** 2), side - 1))
    top_left = i * side + j
    corners = np.stack([top_left, top_left + side, top_left + side + 1, top_left + 1], axis=-1)
    # Corner cells are white, so that every marker of the rim touches a white cell inside the black border.
    color = np.where((i + j) % 2 == 0, WHITE, BLACK).astype(np.uint8)
    reference = layers * (side - 1) + layers
    color[reference] = RED
    return MarkerGraph(row, column, corners, color, reference, int(top_left[reference]))


def _square_rim(layers: int) -> tuple[Ints, Ints]:
    last = 2 * layers + 1
    place = np.arange(last)
    zero, full = np.zeros_like(place), np.full_like(place, last)
    row = np.concatenate([place, full, last - place, zero])
    column = np.concatenate([zero, place, full, last - place])
    return row, column


def _square_centre(layers: int) -> tuple[Ints, Ints]:
    return np.array([layers, layers + 1]), np.array([layers, layers + 1])


TRIANGULAR_GRAPHS = GraphFamily("triangular", _triangular_graph, _triangular_rim, _triangular_centre)
SQUARE_GRAPHS = GraphFamily("square", _square_graph, _square_rim, _square_centre)
