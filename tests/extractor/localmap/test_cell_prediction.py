"""Where a lattice may begin: what is closed to the white cell fits nowhere, and the outline leaves one way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from extractor import parse_layout
from extractor.layout.lattice import rotated_cells
from extractor.layout.lattice_tables import UNKNOWN_AXIAL, Lattice, lattice_of
from extractor.localmap.cell_prediction import (
    MAX_OUTSIDE_SHARE,
    build_axial_grid,
    predicted_places,
    update_excluded_misfits,
)
from extractor.numbering.outline_fit import align_to_outline
from extractor.numbering.white_search import _fill_placement
from tests.support.layouts import small_text

LAYERS = 7
TURN, SHIFT = st.integers(0, 2), st.tuples(st.integers(-9, 9), st.integers(-9, 9))


def lattice() -> Lattice:
    return lattice_of(parse_layout(small_text("honeycomb", LAYERS)))


@settings(deadline=None)
@given(turn=TURN, shift=SHIFT, kept=st.floats(0.3, 1.0), seed=st.integers(0, 1 << 16))
def test_where_too_much_would_lie_outside_nothing_is_looked_for(
    turn: int, shift: tuple[int, int], kept: float, seed: int
) -> None:
    """No place is closed at which the white cell would leave enough cells in the layout."""
    table = lattice()
    at = rotated_cells(table.axial, turn) + np.array(shift, np.int32)
    known = np.flatnonzero(np.random.default_rng(seed).random(len(at)) < kept)
    grid = build_axial_grid(at, known, np.ones(len(known)))
    update_excluded_misfits(grid, at, known, LAYERS)
    out, fitting = np.empty(len(at), np.int32), 0
    for q, r in np.ndindex(grid.excluded.shape):
        inside = _fill_placement(
            at, known, np.array([q + grid.low_q, r + grid.low_r]), table.cell_lookup, out
        )
        assert not (inside and grid.excluded[q, r])
        assert inside == 0 or len(known) - inside <= MAX_OUTSIDE_SHARE * len(known)
        fitting += inside > 0
    assert fitting >= 1 and np.count_nonzero(~grid.excluded) <= (
        40 * fitting if kept > 0.9 else grid.excluded.size
    )


def test_places_are_foreseen_by_the_cells_around_them() -> None:
    """In a regular pattern all cells foresee the same: the middles of the down-cells."""
    table = lattice()
    center, at = table.center_mm * (20.0, -20.0), table.axial
    known = np.arange(len(at))
    right, down = (center[np.flatnonzero((at == to).all(axis=1))[0]] for to in ((1, 0), (0, 1)))
    origin = center[np.flatnonzero((at == 0).all(axis=1))[0]]
    basis = np.broadcast_to(np.stack([right - origin, down - origin], axis=1), (len(at), 2, 2))
    seen = known, basis, np.full(len(at), 2.0), np.full(len(at), 300.0)
    grid = build_axial_grid(at, known, seen[3])
    for ring in range(4):
        places, means, votes = predicted_places(center, seen, grid, ring)
        middle = (places + [-2 / 3, 1 / 3]) @ basis[0].T + origin
        np.testing.assert_allclose(means[:, :2], middle, atol=1e-9)
        assert (means[:, 2] == 2.0).all() and (means[:, 3] == 300.0).all() and votes.min() >= 1
    assert predicted_places(center, seen, grid, 0)[2].max() == 3
    grid.excluded[:] = True
    assert len(predicted_places(center, seen, grid, 0)[0]) == 0


@pytest.mark.parametrize("missing", [0, 20])
@settings(deadline=None)
@given(turn=TURN, shift=SHIFT, seed=st.integers(0, 1 << 16))
def test_the_outline_leaves_one_way(missing: int, turn: int, shift: tuple[int, int], seed: int) -> None:
    """Whatever the turn and the shift, and though cells are missing or were not walked to."""
    table, rng = lattice(), np.random.default_rng(seed)
    move = np.array([shift[0], shift[1] + (shift[0] - shift[1]) % 3], np.int32)  # every ink onto itself
    inner = np.flatnonzero(np.abs(table.axial).sum(axis=1) < LAYERS)
    gone = rng.permutation(inner)[:missing]
    at = rotated_cells(table.axial, turn) + move
    at[gone[: missing // 2]] = UNKNOWN_AXIAL
    at = np.delete(at, gone[missing // 2 :], axis=0)
    found = align_to_outline(at.astype(np.int32), table)
    assert found is not None
    expected = np.arange(len(table.axial), dtype=np.int32)
    expected[gone[: missing // 2]] = -1
    np.testing.assert_array_equal(found, np.delete(expected, gone[missing // 2 :]))
    assert align_to_outline(at[: len(at) // 3].astype(np.int32), table) is None
