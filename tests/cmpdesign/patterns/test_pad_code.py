"""Codes of pads: windows that are unlike each other, pads that are unlike each other, refusals, the same bytes."""

from __future__ import annotations

import hashlib
import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.report import design_report
from cmpdesign.patterns.colors import BLACK, RED, WHITE

TURN = np.exp(2j * np.pi / 3)


def design(layers: int, code: int, **fields: Any) -> Design:
    return Design(
        **{"pattern": "honeycomb", "layers": layers, "pitch_mm": 1.0, "code": code, "virtual_per_edge": 0}
        | fields
    )


def room_of(layers: int) -> int:
    figures = design_report(design(layers, 1), build_layout(design(layers, 1))).code
    assert figures is not None
    return figures.room


class Windows:
    """The hexagonal windows of a plain pattern, found by the places of its cells, and not by their lattice."""

    def __init__(self, layers: int, radius: int) -> None:
        plain = build_layout(design(layers, 0))
        place = plain.marker_xy_mm @ [1, 1j]
        centre = place[plain.cell_corners].mean(axis=1)
        cells = np.flatnonzero(plain.cell_color >= BLACK)
        red = np.flatnonzero(plain.cell_color == RED)
        self.cells = cells
        rows = []
        for marker in np.flatnonzero(plain.marker_layer <= layers - radius):
            inside = cells[is_in_hexagon(centre[cells] - place[marker], radius)]
            # The window is turned until its red cell at the centre has the direction 0.
            towards_red = centre[red[np.abs(centre[red] - place[marker]).argmin()]] - place[marker]
            turned = np.round((centre[inside] - place[marker]) / towards_red, 6) + 0.0
            rows.append(inside[np.lexsort([turned.imag, turned.real])])
        self.rows = np.array(rows)

    def distance(self, layout: Layout) -> int:
        """The smallest number of cells in which two windows of a layout differ."""
        content = (layout.cell_color == WHITE)[self.rows].astype(np.float32)
        counts = content.sum(axis=1)
        distance = counts[:, None] + counts - 2 * content @ content.T
        return int(distance[~np.eye(len(content), dtype=np.bool_)].min(initial=content.shape[1]))


def is_in_hexagon(offset: NDArray[np.complex128], radius: int) -> NDArray[np.bool_]:
    """Whether cells' centres lie in a hexagon with corners at the distance ``radius``, at 0, 60, ... degrees."""
    normals = np.exp(1j * np.radians(30 + 60 * np.arange(6)))
    return np.asarray((np.real(offset[:, None] * normals.conj()) < radius * np.sqrt(3) / 2).all(axis=1))


def turned_cells(layout: Layout) -> NDArray[np.int64]:
    """(C,) the cell that a turn by 120 degrees about marker 0 puts in the place of each cell."""
    centre = (layout.marker_xy_mm @ [1, 1j])[layout.cell_corners].mean(axis=1)
    return np.array([np.abs(centre * TURN - place).argmin() for place in centre])


def require_windows_unlike(layers: int, codes: Any) -> None:
    figures = design_report(design(layers, 1), build_layout(design(layers, 1))).code
    assert figures is not None
    windows = Windows(layers, figures.window_radius)
    assert windows.rows.shape[1] == figures.window_cells
    for code in codes:
        layout = build_layout(design(layers, code))
        stated = design_report(design(layers, code), layout).code
        assert stated is not None
        assert windows.distance(layout) == stated.window_distance >= 3 + 0.1 * figures.window_cells, code


def require_pads_unlike(layers: int, codes: Any) -> None:
    layouts = [build_layout(design(layers, code)) for code in codes]
    turned = turned_cells(layouts[0])
    white = np.array([layout.cell_color == WHITE for layout in layouts]).astype(np.float32)
    black = int((layouts[0].cell_color >= BLACK).sum())
    counts, turns = white.sum(axis=1), (white, white[:, turned], white[:, turned[turned]])
    for first, second in itertools.product(turns, turns):
        distance = counts[:, None] + counts - 2 * first @ second.T
        assert distance[~np.eye(len(layouts), dtype=np.bool_)].min() >= black / 8


@pytest.mark.parametrize(("layers", "codes"), [(4, [1, 7]), (7, [1, 79]), (10, [1, 184, 255]), (16, [5])])
def test_no_window_is_like_another(layers: int, codes: list[int]) -> None:
    require_windows_unlike(layers, codes)


@pytest.mark.parametrize("layers", [4, 5, 6])
def test_no_pad_is_like_another_at_any_turn(layers: int) -> None:
    require_pads_unlike(layers, range(1, room_of(layers) + 1))


@pytest.mark.slow
@pytest.mark.parametrize("layers", range(4, 25))
def test_every_window_and_every_pad_is_unlike_every_other(layers: int) -> None:
    """All shipped codes: every number of layers, every code, every window inside, every pair of pads."""
    codes = range(1, room_of(layers) + 1)
    require_windows_unlike(layers, codes)
    require_pads_unlike(layers, codes)


@pytest.mark.parametrize(
    ("layers", "code", "share", "digest"),
    [
        (10, 1, 0.12, "1b7d54b4c038d6cf"),
        (10, 184, 0.12, "cb175da738e7efd7"),
        (16, 200, 0.2, "11fbf74605f26414"),
    ],
)
def test_a_code_is_the_same_on_every_machine(layers: int, code: int, share: float, digest: str) -> None:
    colors = build_layout(design(layers, code, code_share=share)).cell_color
    assert hashlib.sha256(colors.tobytes()).hexdigest()[:16] == digest


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_only_black_cells_become_white(pattern: str) -> None:
    plain = build_layout(design(10, 0, pattern=pattern))
    coded = build_layout(design(10, 33, pattern=pattern))
    changed = plain.cell_color != coded.cell_color
    assert (plain.cell_color[changed] == BLACK).all() and (coded.cell_color[changed] == WHITE).all()
    assert (coded.cell_color == WHITE).sum() == 36 and coded.cell_color[coded.reference_cell] == WHITE
    assert coded.reference_cell == plain.reference_cell
    np.testing.assert_array_equal(plain.cell_corners, coded.cell_corners)
    np.testing.assert_array_equal(coded.cell_color, build_layout(design(10, 33)).cell_color)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"code": 256}, "code = 256 must be less than or equal to 255"),
        ({"code": -1}, "code = -1 must be greater than or equal to 0"),
        ({"code": 1.0}, "code = 1.0"),
        (
            {"code": 1, "pattern": "square"},
            "code = 1 is an option of triangular patterns, not of square; leave it out",
        ),
        ({"code": 1, "code_share": 0.05}, "code_share = 0.05 must be greater than or equal to 0.1"),
        ({"code": 1, "code_share": 0.41}, "code_share = 0.41 must be less than or equal to 0.4"),
        ({"code": 1, "code_share": 0.1}, "code_share = 0.1 is too low for 10 layers.*make it 0.12 or higher"),
        (
            {"code": 1, "layers": 3},
            "code = 1 needs 4 to 24 layers, and the pattern has 3; change layers, or leave code",
        ),
        ({"code": 1, "layers": 25}, "code = 1 needs 4 to 24 layers, and the pattern has 25"),
        (
            {"code": 37, "layers": 6},
            "code = 37: 6 layers have room for the codes 1 to 36; choose one of these, or more",
        ),
    ],
)
def test_a_code_that_cannot_be_made_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        build_layout(design(**{"layers": 10, "code": 1} | fields))
