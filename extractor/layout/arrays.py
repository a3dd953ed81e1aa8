"""Checks of a layout's arrays before any code follows an index in them: dtypes, shapes, ranges, finite lengths.

Native loops have no checks of their own. A ``Reference`` is checked once, when the value is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from extractor.layout.json_fields import MAX_INT, MAX_MM, fail

if TYPE_CHECKING:
    from extractor.layout.reference import AsMade, Reference

MIN_OUTLINE = 3
COLOR_COUNT = 5
MAX_VIRTUAL_PER_EDGE = 1000
MAX_VIRTUAL_MARKERS = 4_000_000  # of a layout; a result holds 49 bytes for each virtual marker


class _Column(NamedTuple):
    """The form of an array: its field, dtype, shapes that are allowed, and the smallest and largest value."""

    field: str
    dtype: type
    shapes: tuple[tuple[int, ...], ...]
    low: float
    high: float


def check_arrays(reference: Reference) -> None:
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


def _check_as_made(made: AsMade, markers: int, colored: int) -> None:
    if made.covariance_mm2 is not None:
        shape = ((markers, 2, 2),)
        _check_form(made.covariance_mm2, _Column("as_made.covariance_mm2", np.float64, shape, 0, 0))
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
