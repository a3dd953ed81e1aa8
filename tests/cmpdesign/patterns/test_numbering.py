"""Numbering, derived a second time by walking around the rings."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cmpdesign.patterns.numbering import (
    axial_from_layer,
    id_from_axial,
    id_from_layer,
    layer_from_axial,
    layer_from_id,
    marker_count,
)

# Clockwise steps along the six sides of a ring, from the corner at 120 degrees: right, lower right, ...
WALK = [(1, 0), (1, -1), (0, -1), (-1, 0), (-1, 1), (0, 1)]


def walked(layers: int) -> list[tuple[int, int, int, int]]:
    """(q, r, layer, index) of every marker in the order of ids."""
    found = [(0, 0, 0, 0)]
    for layer in range(1, layers + 1):
        q, r = -layer, layer
        index = 0
        for dq, dr in WALK:
            for _ in range(layer):
                found.append((q, r, layer, index))
                q, r, index = q + dq, r + dr, index + 1
    return found


def test_numbering_is_the_clockwise_walk() -> None:
    q, r, layer, index = np.array(walked(12)).T
    ids = np.arange(marker_count(12))
    assert len(ids) == len(q)
    np.testing.assert_array_equal(id_from_axial(q, r), ids)
    np.testing.assert_array_equal(id_from_layer(layer, index), ids)
    np.testing.assert_array_equal(layer_from_id(ids), (layer, index))
    np.testing.assert_array_equal(layer_from_axial(q, r), (layer, index))
    np.testing.assert_array_equal(axial_from_layer(layer, index), (q, r))


def test_index_0_lies_at_120_degrees_and_runs_clockwise() -> None:
    q, r = axial_from_layer(np.full(6, 4), 4 * np.arange(6))
    angle = np.degrees(np.arctan2(r * np.sqrt(3) / 2, q + r / 2))
    np.testing.assert_allclose(angle % 360, [120, 60, 0, 300, 240, 180], atol=1e-12)


@given(st.integers(0, 10**12))
def test_ids_come_back_however_large(number: int) -> None:
    layer, index = layer_from_id(np.array([number]))
    assert 0 <= index[0] < max(6 * layer[0], 1)
    assert id_from_layer(layer, index)[0] == number
    assert id_from_axial(*axial_from_layer(layer, index))[0] == number
