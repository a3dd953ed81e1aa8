"""Checks of a layout: its arrays alone, then its fields against each other.

Native loops follow the indices of a layout without checks of their own. A ``Reference`` is checked here once, when the
value is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.json_fields import MAX_INT, MAX_MM, fail, shown
from extractor.layout.lattice import NEIGHBOUR_STEPS, axial_coordinates

BLACK, WHITE = 3, 4
# The cross product of two sides of a cell: that of sides of a nanometre. Smaller ones have too few digits.
MIN_TURN_MM2 = 1e-12
# Axial corners of the cells (0, 0).
UP_CORNERS, DOWN_CORNERS = np.array([[0, 0], [1, 0], [0, 1]]), np.array([[0, 0], [0, 1], [-1, 1]])
MIN_OUTLINE = 3
MAX_CELL_HEIGHT_MM = 10.0
COLOR_COUNT = 5
MAX_CODE = 255
MAX_VIRTUAL_PER_EDGE = 1000
MAX_VIRTUAL_MARKERS = 4_000_000  # of a layout; a result holds 49 bytes for each virtual marker


Pattern = Any  # a ``Reference``, whose module imports this one


class _Column(NamedTuple):
    """The form of an array: its field, dtype, shapes that are allowed, and the smallest and largest value."""

    field: str
    dtype: type
    shapes: tuple[tuple[int, ...], ...]
    low: float
    high: float


def _check_arrays(reference: Pattern) -> None:
    """Check that every array can be indexed, and that every index in an array leads to an entry.

    Raises:
        LayoutError: the first array with another dtype or shape, or with a value out of range.
    """
    markers = _length(reference.layer, "layer")
    cells = _length(reference.cell_corners, "cell_corners")
    for column in _columns(markers, cells):
        _check_column(getattr(reference, column.field), column)
    for field, high in (("reference_cell", cells - 1), ("reference_marker", markers - 1)):
        _check_whole(getattr(reference, field), field, high)
    edges = len(reference.edges)
    _check_whole(reference.virtual_per_edge, "virtual_per_edge", MAX_VIRTUAL_PER_EDGE)
    if reference.virtual_per_edge * edges > MAX_VIRTUAL_MARKERS:
        fail(
            "virtual_per_edge",
            f"{reference.virtual_per_edge} on {edges} edges",
            f"at most {MAX_VIRTUAL_MARKERS} virtual markers, {MAX_VIRTUAL_MARKERS // edges} an edge",
        )
    if reference.as_made is not None:
        colored = int(np.count_nonzero(reference.cell_color != 3))
        _check_as_made(reference.as_made, markers, colored)


def _columns(markers: int, cells: int) -> Iterator[_Column]:
    yield _Column("layer", np.int32, ((markers,),), 0, MAX_INT)
    yield _Column("index", np.int32, ((markers,),), 0, MAX_INT)
    yield _Column("xy_mm", np.float64, ((markers, 2),), -MAX_MM, MAX_MM)
    yield _Column("cell_corners", np.int32, ((cells, 3), (cells, 4)), 0, markers - 1)
    yield _Column("cell_color", np.uint8, ((cells,),), 0, COLOR_COUNT - 1)
    yield _Column("edges", np.int32, ((-1, 2),), 0, markers - 1)
    yield _Column("outline_mm", np.float64, ((-1, 2),), -MAX_MM, MAX_MM)
    yield _Column("fiducials_mm", np.float64, ((-1, 2),), -MAX_MM, MAX_MM)


def _check_as_made(made: Any, markers: int, colored: int) -> None:
    if made.covariance_mm2 is not None:
        shape = ((markers, 2, 2),)
        _check_form(made.covariance_mm2, _Column("as_made.covariance_mm2", np.float64, shape, 0, 0))
    if not abs(made.cell_height_mm) <= MAX_CELL_HEIGHT_MM:
        limit = f"{MAX_CELL_HEIGHT_MM:g}"
        fail("as_made.cell_height_mm", f"{made.cell_height_mm:g}", f"a number from -{limit} to {limit} mm")
    if made.outlines_mm is None:
        return
    if len(made.outlines_mm) != colored:
        fail(
            "as_made.outlines",
            f"a list of {len(made.outlines_mm)}",
            f"{colored} outlines, one for each cell that is not black",
        )
    for number, outline in enumerate(made.outlines_mm):
        field = f"as_made.outlines[{number}]"
        _check_column(outline, _Column(field, np.float64, ((-1, 2),), -MAX_MM, MAX_MM))
        if len(outline) < MIN_OUTLINE:
            fail(field, f"a list of {len(outline)}", f"at least {MIN_OUTLINE} points")


def _length(array: Any, field: str) -> int:
    if not isinstance(array, np.ndarray) or not array.ndim or not len(array):
        fail(field, f"a {type(array).__name__} without entries", "an array of one entry or more")
    return len(array)


def _check_form(array: Any, column: _Column) -> None:
    if not isinstance(array, np.ndarray) or array.dtype != column.dtype:
        found = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
        fail(column.field, f"of {found}", f"an array of {np.dtype(column.dtype)}")
    if not any(_fits(array.shape, shape) for shape in column.shapes):
        wanted = " or ".join(str(shape).replace("-1", "N") for shape in column.shapes)
        fail(column.field, f"of the shape {array.shape}", f"the shape {wanted}")
    if not array.flags.c_contiguous:
        fail(column.field, "not contiguous", "an array in C order, as of numpy.ascontiguousarray")


def _check_column(array: Any, column: _Column) -> None:
    _check_form(array, column)
    wrong = ~((array >= column.low) & (array <= column.high))  # NaN compares with nothing
    if wrong.any():
        place = tuple(int(i) for i in np.argwhere(wrong)[0])
        at = "".join(f"[{i}]" for i in place)
        fail(f"{column.field}{at}", f"{array[place]:g}", f"a number from {column.low:g} to {column.high:g}")


def _fits(found: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    return len(found) == len(wanted) and all(w in (-1, f) for f, w in zip(found, wanted, strict=True))


def _check_whole(value: object, field: str, high: int) -> None:
    if type(value) is not int or not 0 <= value <= high:
        fail(field, repr(value)[:40], f"a whole number from 0 to {high}")


def check_consistency(reference: Pattern) -> None:
    """Check that every array can be indexed, that every index leads to an entry, and that no field contradicts another.

    Raises:
        LayoutError: the first array of another dtype or shape, the first value out of range, or contradiction.
    """
    _check_arrays(reference)
    triangular = reference.cell_corners.shape[1] == 3
    if triangular:
        _check_layers(reference)
    else:
        _check_rows(reference)
    _check_cells(reference)
    _check_edges(reference)
    _check_reference_cell(reference, triangular)
    if triangular:
        _check_colors(reference)
        _check_lattice(reference)
    else:
        _check_grid(reference)
    if len(reference.outline_mm) < 3 or polygon_area(reference.outline_mm[None])[0] <= 0:
        fail(
            "outline", f"a polygon of {len(reference.outline_mm)} points", "three or more, counter-clockwise"
        )


def polygon_area(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) float64 signed areas of (N, K, 2) polygons, positive when counter-clockwise with y up."""
    x, y = xy[..., 0], xy[..., 1]
    doubled = x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1)
    return np.asarray(0.5 * doubled.sum(axis=-1), dtype=np.float64)


def _check_layers(reference: Pattern) -> None:
    """Check the layers: layer k holds 6k markers (layer 0 one), so marker i of layer k has the id 3k(k-1) + 1 + i."""
    count = len(reference.layer)
    layers = round((np.sqrt(12 * count - 3) - 3) / 6)
    if 3 * layers * (layers + 1) + 1 != count:
        fail("markers.layer", f"a list of {count}", "3n(n+1) + 1 markers for n layers: 7, 19, 37, ...")
    sizes = np.maximum(6 * np.arange(layers + 1), 1)
    layer = np.repeat(np.arange(layers + 1), sizes)
    index = np.arange(count) - (np.cumsum(sizes) - sizes)[layer]
    _check_numbering(reference, layer, index)


def _check_rows(reference: Pattern) -> None:
    """Check the rows of a square pattern: ids run row by row, and all rows have the same length."""
    count = len(reference.layer)
    columns = int(reference.index.max()) + 1
    if count % columns:
        fail("markers.index", f"at most {columns - 1} in a list of {count}", "rows of equal length")
    _check_numbering(reference, np.arange(count) // columns, np.arange(count) % columns)


def _check_numbering(reference: Pattern, layer: NDArray[np.int_], index: NDArray[np.int_]) -> None:
    for field, found, expected in (("layer", reference.layer, layer), ("index", reference.index, index)):
        wrong = np.flatnonzero(found != expected)
        if len(wrong):
            first = int(wrong[0])
            fail(
                f"markers.{field}[{first}]",
                str(found[first]),
                f"{expected[first]}: marker {first}'s by the numbering",
            )


def _check_cells(reference: Pattern) -> None:
    """Check that cells are counter-clockwise and listed once: every corner turns left, a repeated corner does not."""
    corners = reference.cell_corners
    xy = reference.xy_mm[corners]
    incoming, outgoing = xy - np.roll(xy, 1, axis=1), np.roll(xy, -1, axis=1) - xy
    turn = incoming[..., 0] * outgoing[..., 1] - incoming[..., 1] * outgoing[..., 0]
    wrong = np.flatnonzero((turn < MIN_TURN_MM2).any(axis=1))
    if len(wrong):
        first = int(wrong[0])
        fail(f"cells.corners[{first}]", str(corners[first].tolist()), "different markers, counter-clockwise")
    ordered = np.sort(corners, axis=1)[:, :3].astype(np.int64)  # three corners identify a cell in any pattern
    keys = (ordered[:, 0] * len(reference.layer) + ordered[:, 1]) * len(reference.layer) + ordered[:, 2]
    order = np.argsort(keys, kind="stable")
    repeated = np.flatnonzero(np.diff(keys[order]) == 0)
    if len(repeated):
        first = int(order[repeated[0] + 1])
        fail(
            f"cells.corners[{first}]", str(corners[first].tolist()), "a cell that is not in the list already"
        )


def _check_edges(reference: Pattern) -> None:
    """Check that edges go from the smaller to the larger id, ascend, and contain every side of a cell."""
    edges = reference.edges.astype(np.int64)
    count = len(reference.layer)
    wrong = np.flatnonzero(edges[:, 0] >= edges[:, 1])
    if len(wrong):
        first = int(wrong[0])
        fail(f"edges[{first}]", str(edges[first].tolist()), "the smaller id first")
    keys = edges[:, 0] * count + edges[:, 1]
    wrong = np.flatnonzero(np.diff(keys) <= 0)
    if len(wrong):
        first = int(wrong[0]) + 1
        fail(f"edges[{first}]", str(edges[first].tolist()), "edges in ascending order, each once")
    corners = reference.cell_corners.astype(np.int64)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    sides = ends[:, 0] * count + ends[:, 1]
    rank = np.minimum(np.searchsorted(keys, sides), len(keys) - 1)
    missing = np.flatnonzero(keys[rank] != sides)
    if len(missing):
        first = int(missing[0])
        fail("edges", f"without {ends[first].tolist()}", f"every side of cell {first // corners.shape[1]}")


def _check_reference_cell(reference: Pattern, triangular: bool) -> None:
    cell, marker = reference.reference_cell, reference.reference_marker
    if marker not in reference.cell_corners[cell]:
        fail("reference.marker", str(marker), f"a corner of the reference cell {cell}")
    if not triangular:
        if reference.code is not None:
            fail("code", shown(reference.code), "no code of a pattern without triangles")
        return
    white = np.flatnonzero(reference.cell_color == WHITE)
    if reference.code is not None:
        _check_code(reference, white)
    elif white.tolist() != [cell]:
        fail("reference.cell", str(cell), f"the only white cell; white are {white[:5].tolist()}")
    if marker != 0:
        fail("reference.marker", str(marker), "0, where the numbering of layers starts")


def _check_code(reference: Pattern, white: NDArray[np.int_]) -> None:
    """Check a code, and that its white cells are several, with the reference cell, and none in an ink's place."""
    _check_whole(reference.code.id, "code.id", MAX_CODE)
    share = reference.code.share
    if type(share) not in (int, float) or not 0 < share < 1:
        fail("code.share", shown(share), "a number between 0 and 1")
    if reference.reference_cell not in white or len(white) < 2:
        fail(
            "reference.cell",
            str(reference.reference_cell),
            f"one of several white cells of a code; white are {white[:5].tolist()}",
        )
    axial = axial_coordinates(reference.layer, reference.index)
    # The corners of an up-cell (q, r), which has an ink, add up to (3q + 1, 3r + 1).
    wrong = white[(axial[reference.cell_corners[white]].sum(axis=1) % 3 == 1).all(axis=1)]
    if len(wrong):
        fail(
            f"cells.color[{wrong[0]}]",
            "white",
            "the ink of its place; a code has white cells instead of black ones",
        )


def _check_colors(reference: Pattern) -> None:
    """Check that a marker touches at most one red, one green and one blue cell, clockwise in this order."""
    count = len(reference.layer)
    cell_of = np.full((count, 3), -1)
    for color, name in enumerate(("red", "green", "blue")):
        cells = np.flatnonzero(reference.cell_color == color)
        corners = reference.cell_corners[cells]
        repeated = np.flatnonzero(np.bincount(corners.ravel(), minlength=count) > 1)
        if len(repeated):
            fail("cells.color", f"{name} twice around marker {repeated[0]}", "at most one cell of a color")
        cell_of[corners, color] = cells[:, None]
    inner = np.flatnonzero((cell_of >= 0).all(axis=1))
    centres = reference.xy_mm[reference.cell_corners].mean(axis=1)[cell_of[inner]]
    wrong = inner[polygon_area(centres) >= 0]
    if len(wrong):
        fail("cells.color", f"counter-clockwise around marker {wrong[0]}", "red, green, blue clockwise")


def _check_lattice(reference: Pattern) -> None:
    """Check that cells and edges are those of the triangular lattice, so that no marker has more than six edges.

    The corners of the up-cell (q, r) add up to (3q + 1, 3r + 1), those of the down-cell (q, r) to (3q - 1, 3r + 2).
    """
    axial = axial_coordinates(reference.layer, reference.index)
    corners = axial[reference.cell_corners]
    total = corners.sum(axis=1)
    up = (total % 3 == 1).all(axis=1)
    base = (total - np.where(up[:, None], (1, 1), (-1, 2))) // 3
    steps = np.where(up[:, None, None], UP_CORNERS, DOWN_CORNERS)
    # The corners are different markers, so they are the cell's if each is one of the three.
    expected = (base[:, None] + steps)[:, :, None] == corners[:, None]
    right = expected.all(axis=3).any(axis=1).all(axis=1)
    _require_cells(reference, right, "three markers that are neighbours by their layer and index")
    step = axial[reference.edges[:, 1]] - axial[reference.edges[:, 0]]
    _require_neighbours(reference, (step[:, None] == NEIGHBOUR_STEPS).all(axis=2).any(axis=1))


def _check_grid(reference: Pattern) -> None:
    """Check that cells and edges are those of the square grid."""
    place = np.stack([reference.layer, reference.index], axis=1)
    corners = place[reference.cell_corners]
    # Four different markers within one row and one column of each other are a cell's.
    right = (np.ptp(corners, axis=1) == 1).all(axis=1)
    _require_cells(reference, right, "four markers that are neighbours by their row and column")
    step = place[reference.edges[:, 1]] - place[reference.edges[:, 0]]
    _require_neighbours(reference, np.abs(step).sum(axis=1) == 1)


def _require_cells(reference: Pattern, right: NDArray[np.bool_], expected: str) -> None:
    wrong = np.flatnonzero(~right)
    if len(wrong):
        first = int(wrong[0])
        fail(f"cells.corners[{first}]", str(reference.cell_corners[first].tolist()), expected)


def _require_neighbours(reference: Pattern, neighbours: NDArray[np.bool_]) -> None:
    wrong = np.flatnonzero(~neighbours)
    if len(wrong):
        first = int(wrong[0])
        fail(f"edges[{first}]", str(reference.edges[first].tolist()), "two neighbouring markers")
