"""Every window of a code, read without an error, is registered by its bits; in no place by another code."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.pad_codes.parts import (
    NO_BRIGHT_PLACES,
    Pad,
    is_right,
    moved,
    pad_of,
    random_motion,
    seen_part,
)
from cmpdesign.patterns.pad_code import code_room, window_radius

DOWN_CORNERS = np.array([[0, 0], [0, 1], [-1, 1]])  # of a down-cell, from its axial place


class Window(NamedTuple):
    """A hexagon of cells around a marker: (K,) numbers of the colored cells at its down-cells, and (B,) of these."""

    cells: NDArray[np.intp]
    down: NDArray[np.intp]


class PlacedWindows(NamedTuple):
    """The windows of codes, and those that did not get the right place by their bits."""

    codes: int
    windows: int
    failed: int


def windows_of(pad: Pad, radius: int) -> list[Window]:
    """All windows of a radius inside the pad."""
    layers = pad.lattice.layers - radius
    span = np.arange(-layers, layers + 1)
    found = []
    for centre in [(q, r) for q in span for r in span if abs(q + r) <= layers]:
        corners = (pad.down - centre)[:, None] + DOWN_CORNERS
        inside = np.abs(corners).max(axis=(1, 2)) <= radius
        inside &= np.abs(corners.sum(axis=2)).max(axis=1) <= radius
        beside = np.unique(pad.beside[inside])
        found.append(Window(beside[beside < len(pad.lattice.axial)], np.flatnonzero(inside)))
    return found


@cache
def _windows(layers: int) -> list[Window]:
    """The windows of a number of layers, the same for all codes."""
    return windows_of(pad_of(layers, 1), window_radius(layers))


def is_placed(pad: Pad, window: Window, motion: NDArray[np.int64]) -> bool:
    """Whether a window that is read without an error, in a frame after a motion, gets its place by its bits."""
    places, down = pad.lattice.axial[window.cells], pad.down[window.down]
    whiteness = pad.is_white[window.down].astype(float)
    seen = seen_part(places, moved(places, motion, up=True), moved(down, motion, up=False), whiteness)
    placed = pad.registration.register(seen, NO_BRIGHT_PLACES)
    return placed.is_certain and placed.is_proved_by_bits and is_right(placed, places)


def placed_windows(layers: int, codes: int, seed: int) -> PlacedWindows:
    """All windows of the first codes of a number of layers, at most of those that there are."""
    rng, codes = np.random.default_rng(seed), min(codes, code_room(layers))
    failed = 0
    for code in range(1, codes + 1):
        pad = pad_of(layers, code)
        failed += sum(not is_placed(pad, window, random_motion(rng)) for window in _windows(layers))
    return PlacedWindows(codes, codes * len(_windows(layers)), failed)
