"""The code of a pad: more black cells are white, so that every part of the pattern is unlike every other part.

A window is a hexagon of cells around a marker. The inks fix its orientation: three turns by 120 degrees about a
marker exchange them. Any two windows of the radius ``window_radius`` differ in so many black cells that a reader
accepts a window that is read without error: ``LEAD_BITS`` and ``LEAD_SHARE`` of its cells. The white cells are found by
a search in integers, which has the same result on every machine.

All codes of a number of layers and a share have equally many white cells, which keeps pads with
different codes far apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import DesignError
from cmpdesign.patterns.colors import BLACK, WHITE
from cmpdesign.patterns.graphs import MarkerGraph
from cmpdesign.patterns.numbering import Ints, axial_from_layer

MAX_CODE = 255  # a page of the documentation lists the number of codes of each number of layers
DEFAULT_SHARE, MIN_SHARE, MAX_SHARE = 0.12, 0.1, 0.4
# The layers up to which windows of a radius are told apart; the search succeeds for every code with the default share.
RADIUS_UP_TO_LAYERS = {6: 4, 10: 5, 16: 6, 24: 7}
MIN_LAYERS, MAX_LAYERS = 4, max(RADIUS_UP_TO_LAYERS)
# A reader accepts a place if the second best place explains this many cells less.
LEAD_BITS, LEAD_SHARE = 3, 0.1
# Any two pads of a size, at every turn, differ in this share of the black cells.
PAD_DISTANCE = 1 / 8
MAX_STEPS = 4000
# With so few cells, only these codes keep PAD_DISTANCE.
ROOM_OF_LAYERS = {4: 7, 5: 21, 6: 36}
# The searches of these codes, by layers, start from other numbers: with 0, two pads are nearer than PAD_DISTANCE, or
# the search fails. A test computes all pads of all layers.
SALTS = {
    7: {79: 1, 94: 1, 100: 1, 106: 1, 140: 1, 188: 1, 208: 1, 237: 1, 239: 1, 242: 1, 253: 1},
    10: {184: 1, 192: 1, 247: 1},
}


@dataclass(frozen=True)
class PadCode:
    """The code of a pad.

    Attributes:
        id: 1 to ``MAX_CODE``.
        share: the share of white cells among the cells that are black or white, before clipping.
    """

    id: int
    share: float


def window_radius(layers: int) -> int:
    """The radius of the smallest windows that are told apart, in layers around a marker."""
    return next(radius for most, radius in RADIUS_UP_TO_LAYERS.items() if layers <= most)


def window_distance(radius: int) -> int:
    """The smallest number of black cells in which any two windows of a radius differ."""
    return math.ceil(LEAD_BITS + LEAD_SHARE * black_cells(radius))


def black_cells(layers: int) -> int:
    """The number of black cells of a whole plain pattern and its white cell."""
    return 3 * layers**2


def white_count(layers: int, share: float) -> int:
    """The number of white cells of a whole pad."""
    return round(share * black_cells(layers))


@dataclass(frozen=True)
class CodeFigures:
    """Key figures of a coded pad before clipping.

    Attributes:
        id, share: the code.
        room: the codes of this number of layers are 1 to ``room``.
        white_cells, black_cells: numbers of white cells, and of black and white cells together.
        window_radius: in layers; every hexagon of this radius inside the pattern is unlike every other.
        window_cells: black and white cells of such a window.
        window_distance: the smallest number of cells in which two of these windows differ.
    """

    id: int
    share: float
    room: int
    white_cells: int
    black_cells: int
    window_radius: int
    window_cells: int
    window_distance: int

    def line(self) -> str:
        """One sentence."""
        return (
            f"{self.id} of 1 to {self.room}: {self.white_cells} of {self.black_cells} black cells are white; the "
            f"smallest window whose place the code shows is a hexagon of the radius {self.window_radius} "
            f"({self.window_cells} black cells); any two of these differ in {self.window_distance} cells or more"
        )


def code_figures(layers: int, code: PadCode) -> CodeFigures:
    """The key figures of a code of a number of layers. Raises as ``coded_graph``."""
    radius = window_radius(layers)
    content = white_cells(layers, code)[code_windows(layers, radius)].astype(np.float32)
    counts = content.sum(axis=1)
    # Two windows differ in the white cells of both, less twice the common ones.
    distances = counts[:, None] + counts - 2 * content @ content.T
    other = ~np.eye(len(content), dtype=np.bool_)
    return CodeFigures(
        id=code.id,
        share=code.share,
        room=code_room(layers),
        white_cells=white_count(layers, code.share),
        black_cells=black_cells(layers),
        window_radius=radius,
        window_cells=black_cells(radius),
        window_distance=int(distances[other].min()) if len(content) > 1 else black_cells(radius),
    )


def coded_graph(graph: MarkerGraph, code: PadCode) -> MarkerGraph:
    """The triangular graph with the white cells of a code.

    Args:
        graph: a whole triangular graph.
        code: the code.

    Raises:
        DesignError: the number of layers has no such code, or no code with this share.
    """
    layers = int(graph.layer[-1])
    _require_room(layers, code.id)
    cells = np.flatnonzero((graph.color == BLACK) | (graph.color == WHITE))
    is_white, radius = white_cells(layers, code), window_radius(layers)
    if not is_white.any():
        raise DesignError(
            f"code_share = {code.share:g} is too low for {layers} layers: {white_count(layers, code.share)} white "
            f"cells do not make all windows of the radius {radius} differ in {window_distance(radius)} cells; "
            f"make it {DEFAULT_SHARE:g} or higher"
        )
    color = graph.color.copy()
    color[cells] = np.where(is_white[_cell_numbers(graph, cells)], WHITE, BLACK)
    return replace(graph, color=color)


def _require_room(layers: int, code: int) -> None:
    if not MIN_LAYERS <= layers <= MAX_LAYERS:
        raise DesignError(
            f"code = {code} needs {MIN_LAYERS} to {MAX_LAYERS} layers, and the pattern has {layers}; change layers, or "
            "leave code out"
        )
    if code > code_room(layers):
        raise DesignError(
            f"code = {code}: {layers} layers have room for the codes 1 to {code_room(layers)}; choose one of these, or "
            "more layers"
        )


def code_room(layers: int) -> int:
    """The number of codes: the pads of any two differ, at every turn, in ``PAD_DISTANCE`` of the black cells."""
    return ROOM_OF_LAYERS.get(layers, MAX_CODE)


def down_cells(layers: int) -> Ints:
    """(C, 2) the axial (q, r) of the cells that can be black, in ascending order."""
    span = np.arange(-layers, layers + 1)
    q, r = (grid.ravel() for grid in np.meshgrid(span, span, indexing="ij"))
    cells = np.stack([q, r], axis=1)
    return cells[cell_rings(cells) <= layers]


def cell_rings(cells: Ints) -> NDArray[np.int32]:
    """(N,) the outermost layer of the corners of the down-cells (q, r)."""
    q, r = cells[:, 0], cells[:, 1]
    corner_q, corner_r = np.stack([q, q, q - 1]), np.stack([r, r + 1, r + 1])
    layer = np.maximum(np.maximum(np.abs(corner_q), np.abs(corner_r)), np.abs(corner_q + corner_r))
    return np.asarray(layer.max(axis=0), dtype=np.int32)


def code_windows(layers: int, radius: int) -> NDArray[np.int32]:
    """(W, K) the cells, as numbers of ``down_cells``, of every window of a radius inside the pattern.

    Columns correspond: windows are turned about their centres until their red cells have the same direction.
    """
    cells, number = down_cells(layers), np.full((2 * layers + 3, 2 * layers + 3), -1)
    number[cells[:, 0] + layers, cells[:, 1] + layers] = np.arange(len(cells))
    span = np.arange(radius - layers, layers - radius + 1)
    q, r = (grid.ravel() for grid in np.meshgrid(span, span, indexing="ij"))
    inside = np.abs(q + r) <= layers - radius
    centres = np.stack([q, r], axis=1)[inside]
    # The cells around a marker (q, r) follow each other as the cells around (0, 0), turned (q - r) mod 3 times.
    turned = [down_cells(radius)]
    for _ in range(2):
        turned.append(turn_down_cells(turned[-1]))
    places = centres[:, None] + np.stack(turned)[(centres[:, 0] - centres[:, 1]) % 3]
    return np.asarray(number[places[..., 0] + layers, places[..., 1] + layers], dtype=np.int32)


def turn_down_cells(cells: Ints) -> Ints:
    """(N, 2) the down-cells (q, r) turned by 120 degrees counter-clockwise about marker 0."""
    # The corners of the down-cell (q, r) add up to (3q - 1, 3r + 2); a turn takes (q, r) to (-q - r, q).
    return np.stack([-cells.sum(axis=1), cells[:, 0] - 1], axis=1)


def white_cells(layers: int, code: PadCode) -> NDArray[np.bool_]:
    """(C,) the white cells of ``down_cells``; none if the search fails."""
    salt = SALTS.get(layers, {}).get(code.id, 0)
    return searched_cells(layers, white_count(layers, code.share), code.id, salt)


@cache
def searched_cells(layers: int, whites: int, code: int, salt: int) -> NDArray[np.bool_]:
    """(C,) as ``white_cells``, of a search from another start for each ``salt``."""
    from cmpdesign._native import pad_code as native

    cells, radius = down_cells(layers), window_radius(layers)
    ring = cell_rings(cells)
    fixed = int(np.flatnonzero((cells == 0).all(axis=1))[0])
    # Ring k completes 3 k^2 cells. Without a number for every ring, the search would leave none for the rim.
    up_to_ring = np.maximum((2 * whites * np.arange(layers + 1) ** 2 + layers**2) // (2 * layers**2), 1)
    of_ring = np.diff(up_to_ring, prepend=1).astype(np.int32)
    found = native.white_cells(
        code_windows(layers, radius),
        ring,
        of_ring,
        fixed,
        window_distance(radius),
        MAX_STEPS,
        ((1000 * salt + whites) * (MAX_LAYERS + 1) + layers) * (MAX_CODE + 1) + code,
    )
    is_white = np.asarray(found, dtype=np.bool_)
    is_white.setflags(write=False)
    return is_white


def _cell_numbers(graph: MarkerGraph, cells: NDArray[np.int64]) -> Ints:
    """(N,) the numbers in ``down_cells`` of cells of the graph."""
    corner_q, corner_r = axial_from_layer(graph.layer, graph.index)
    q, r = (
        (corner_q[graph.corners[cells]].sum(axis=1) + 1) // 3,
        (corner_r[graph.corners[cells]].sum(axis=1) - 2) // 3,
    )
    places = down_cells(int(graph.layer[-1]))
    return np.asarray(np.searchsorted(places[:, 0] * len(places) + places[:, 1], q * len(places) + r))
