"""The extractor's numbering against a walk around the rings, and its tables against the layout's cells.

Inside: the walk around the rings goes 60 layers far, and no image shows so many.
"""

from __future__ import annotations

import numpy as np
import pytest

from extractor import parse_layout
from extractor.layout.lattice import axial_coordinates, layer_of, marker_id
from extractor.layout.lattice_tables import cells_at, lattice_of
from tests.support.layouts import small_layout, small_text

# Turn right: the six steps of the lattice clockwise, y up; a ring starts at 120 degrees and first runs to the right.
STEPS = [(1, 0), (1, -1), (0, -1), (-1, 0), (-1, 1), (0, 1)]


def walked(layers: int) -> list[tuple[int, int, int, int]]:
    """(q, r, layer, index) in the order of the ids, by walking every ring clockwise."""
    places = [(0, 0, 0, 0)]
    for layer in range(1, layers + 1):
        q, r, index = -layer, layer, 0
        for dq, dr in STEPS:
            for _ in range(layer):
                places.append((q, r, layer, index))
                q, r, index = q + dq, r + dr, index + 1
        assert (q, r) == (-layer, layer)
    return places


def test_ids_are_the_walks_order() -> None:
    places = walked(40)
    assert len({place[:2] for place in places}) == len(places) == 3 * 40 * 41 + 1
    for number, (q, r, layer, _) in enumerate(places):
        assert marker_id(q, r) == number
        assert layer_of(q, r) == layer


def test_axial_is_the_way_back() -> None:
    places = np.array(walked(60), np.int32)
    np.testing.assert_array_equal(axial_coordinates(places[:, 2], places[:, 3]), places[:, :2])


def test_the_lattice_is_where_a_honeycomb_is() -> None:
    """Positions of a honeycomb of pitch 1.5 mm: (q + r / 2, r sqrt(3) / 2) pitches."""
    layout = small_layout("honeycomb", 6)
    q, r = axial_coordinates(layout.marker_layer, layout.marker_index).T
    expected = 1.5 * np.stack([q + r / 2, r * np.sqrt(3) / 2], axis=1)
    np.testing.assert_allclose(layout.marker_xy_mm, expected, atol=1e-8)


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
@pytest.mark.parametrize("layers", [1, 2, 7])
def test_every_colored_cell_stands_at_its_lower_left_marker(pattern: str, layers: int) -> None:
    """Up-cell (q, r) has the markers (q, r), (q+1, r), (q, r+1) and the color (q - r) mod 3."""
    layout = small_layout(pattern, layers)
    lattice = lattice_of(parse_layout(small_text(pattern, layers)))
    assert lattice.layers == layers
    ids = {place[:2]: number for number, place in enumerate(walked(layers))}
    places, expected = [], []
    for q, r in ids:
        corners = [ids.get(place, -1) for place in ((q, r), (q + 1, r), (q, r + 1))]
        if -1 not in corners:
            places.append((q, r))
            expected.append(corners)
    cell = cells_at(np.array(places, np.int32), lattice)
    assert sorted(cell.tolist()) == list(range(int((layout.cell_color < 3).sum())))
    np.testing.assert_array_equal(lattice.corner_ids[cell], expected)
    np.testing.assert_array_equal(lattice.axial[cell], places)
    np.testing.assert_array_equal(lattice.ink[cell], [(q - r) % 3 + 1 for q, r in places])
    colored = {
        tuple(sorted(row)): color
        for row, color in zip(layout.cell_corners.tolist(), layout.cell_color, strict=True)
    }
    for corners, ink in zip(lattice.corner_ids.tolist(), lattice.ink, strict=True):
        assert colored[tuple(sorted(corners))] == ink - 1


def test_outside_the_layout_there_is_no_cell() -> None:
    lattice = lattice_of(parse_layout(small_text("honeycomb", 2)))
    outside = np.array([(2, 0), (0, 2), (-3, 0), (3, -1), (50, -70), (1, 1)], np.int32)
    assert (cells_at(outside, lattice) == -1).all()
