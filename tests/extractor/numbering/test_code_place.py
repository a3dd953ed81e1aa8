"""The witness of a pad's code. Inside: no command reads by the code alone, and its rules are those of a wrong id."""

from __future__ import annotations

from functools import cache
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.patterns.pad_code import LEAD_BITS, LEAD_SHARE
from extractor import Reference, parse_layout
from extractor.layout.code_board import CodeBoard, code_board
from extractor.numbering.pad_code import LIMITS, code_bits, code_place

BLACK, WHITE = 3, 4
LAYERS = 10


@cache
def reference(code: int, layers: int = LAYERS) -> Reference:
    design = Design(pattern="honeycomb", layers=layers, pitch_mm=1.0, code=code, virtual_per_edge=0)
    return parse_layout(layout_to_json(build_layout(design)))


@cache
def board(code: int) -> CodeBoard:
    return code_board(reference(code))


@cache
def down_cells(code: int) -> tuple[NDArray[np.int32], NDArray[np.int8], NDArray[np.complex128]]:
    """The axial places of the down-cells by their geometry, their bits, and their centers in units of the pitch."""
    layout = reference(code)
    cells = np.flatnonzero(layout.cell_color >= BLACK)
    centre = (layout.xy_mm @ [1, 1j])[layout.cell_corners[cells]].mean(axis=1)
    # The lower corner of a down-cell is the marker (q, r).
    lower = centre - 1j / np.sqrt(3)
    r = np.round(lower.imag / (np.sqrt(3) / 2)).astype(int)
    q = np.round(lower.real - r / 2).astype(int)
    return (
        np.stack([q, r], axis=1).astype(np.int32),
        (layout.cell_color[cells] == WHITE).astype(np.int8),
        centre,
    )


def moved(centre: NDArray[np.complex128], turns: int, dq: int, dr: int) -> NDArray[np.int32]:
    """The axial places of cells that are turned about marker 0 and shifted, by their geometry."""
    place = centre * np.exp(2j * np.pi / 3 * turns) + dq + dr * (0.5 + 0.5j * np.sqrt(3))
    lower = place - 1j / np.sqrt(3)
    r = np.round(lower.imag / (np.sqrt(3) / 2)).astype(int)
    return np.stack([np.round(lower.real - r / 2).astype(int), r], axis=1).astype(np.int32)


def window(code: int, radius: float, about: complex) -> NDArray[np.bool_]:
    return np.asarray(np.abs(down_cells(code)[2] - about) < radius)


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2), st.integers(-30, 30), st.integers(-30, 30))
def test_a_whole_pad_is_placed_wherever_its_frame_lies(turns: int, dq: int, dr: int) -> None:
    axial, bit, centre = down_cells(7)
    place = code_place(moved(centre, turns, dq, dr), bit, board(7), are_inks_known=False)
    assert place is not None and place.is_certain and (place.wrong, place.bits) == (0, len(bit))
    back = moved(
        centre * np.exp(2j * np.pi / 3 * turns) + dq + dr * (0.5 + 0.5j * np.sqrt(3)),
        place.turns,
        place.dq,
        place.dr,
    )
    np.testing.assert_array_equal(back, axial)


@given(
    st.integers(1, 5),
    st.floats(-4.0, 4.0),
    st.floats(-4.0, 4.0),
    st.integers(0, 3),
    st.randoms(use_true_random=False),
)
def test_a_window_is_placed_or_refused_but_never_misplaced(
    code: int, x: float, y: float, misread: int, random: Random
) -> None:
    axial, bit, _ = down_cells(code)
    part = window(code, 5.2, complex(x, y))
    read = bit[part].copy()
    for i in random.sample(range(len(read)), misread):
        read[i] = 1 - read[i]
    place = code_place(axial[part], read, board(code))
    assert place is not None
    if place.is_certain:
        assert (place.turns, place.dq, place.dr) == (0, 0, 0)
        assert place.wrong == misread


def test_a_pad_of_another_code_is_refused() -> None:
    for code in range(1, 6):
        for other in range(6, 11):
            axial, bit, _ = down_cells(other)
            place = code_place(axial, bit, board(code))
            assert place is not None and not place.is_certain
            assert place.wrong > LIMITS.max_misfit * place.bits


def test_few_bits_prove_nothing() -> None:
    """Cells of glare are unknown; with fewer known cells than the floor, no place is certain."""
    axial, bit, _ = down_cells(3)
    contrast = bit.astype(np.float64)
    contrast[LIMITS.least_bits - 1 :] = 3.0
    place = code_place(axial, code_bits(contrast), board(3))
    assert place is not None and place.bits == LIMITS.least_bits - 1 and not place.is_certain


@pytest.mark.parametrize(
    ("contrast", "bit"),
    [(0.0, 0), (-0.2, 0), (0.3, 0), (0.45, -1), (0.6, 1), (1.1, 1), (1.6, -1), (np.nan, -1), (np.inf, -1)],
)
def test_a_cell_between_black_and_white_is_unknown(contrast: float, bit: int) -> None:
    assert code_bits(np.array([contrast])).tolist() == [bit]


def test_a_part_that_is_larger_than_the_pad_has_no_place() -> None:
    span = np.arange(-40, 41)
    q, r = (axis.ravel() for axis in np.meshgrid(span, span))
    axial = np.stack([q, r], axis=1).astype(np.int32)
    assert code_place(axial, np.zeros(len(axial), np.int8), board(3)) is None


def test_the_board_has_the_layout_s_cells() -> None:
    axial, bit, _ = down_cells(5)
    found = board(5)
    place = axial + found.origin
    for rows, expected in ((found.white, bit), (found.cells, np.ones_like(bit))):
        assert [(int(rows[r]) >> int(q)) & 1 for q, r in place] == expected.tolist()
        assert sum(int(row).bit_count() for row in rows) == expected.sum()


def test_a_board_of_too_many_layers_is_refused() -> None:
    layout = parse_layout(
        layout_to_json(build_layout(Design(pattern="honeycomb", layers=31, pitch_mm=1.0, virtual_per_edge=0)))
    )
    with pytest.raises(ValueError, match="31 layers are more than 30"):
        code_board(layout)


def test_codes_are_made_for_the_lead_that_reading_asks_for() -> None:
    assert (LIMITS.lead_bits, LIMITS.lead_share) == (LEAD_BITS, LEAD_SHARE)
