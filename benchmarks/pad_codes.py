"""Places of parts of coded pads by their code alone, of parts that are cropped and damaged: right and wrong ones.

python -m benchmarks.pad_codes [--layers 10] [--parts 100000] [--seed 5]
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from cmpdesign import Design, build_layout
from extractor import Reference
from extractor.layout.code_board import CodeBoard, code_board
from extractor.numbering.pad_code import UNKNOWN, code_bits, code_place

CODES = 16
LEAST_CELLS = 30
GROUPS = {"30 to 59 known cells": (LEAST_CELLS, 60), "60 to 119": (60, 120), "120 and more": (120, 10**6)}


class Pads:
    """Pads of one number of layers with several codes."""

    def __init__(self, layers: int) -> None:
        self.boards: list[CodeBoard] = []
        for code in range(1, CODES + 1):
            design = Design(pattern="honeycomb", layers=layers, pitch_mm=1.0, code=code, virtual_per_edge=0)
            reference = build_layout(design).reference()
            assert isinstance(reference, Reference)
            self.boards.append(code_board(reference))
        board = self.boards[0]
        rows = np.arange(len(board.cells), dtype=np.uint64)
        is_cell = (board.cells[:, None] >> rows) & np.uint64(1)
        r, q = np.nonzero(is_cell)
        self.axial = np.stack([q, r], axis=1).astype(np.int32) - board.origin
        self.white = [
            ((b.white[r] >> q.astype(np.uint64)) & np.uint64(1)).astype(np.float64) for b in self.boards
        ]
        self.places = self.axial @ np.array([[1.0, 0.0], [0.5, np.sqrt(3) / 2]])


def chosen_part(places: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.bool_]:
    """(C,) the cells of a random crop: an ellipse, a half plane, or a strip; then holes of blobs."""
    centre = places[rng.integers(len(places))]
    angle = rng.uniform(0, np.pi)
    along = (places - centre) @ [np.cos(angle), np.sin(angle)]
    across = (places - centre) @ [-np.sin(angle), np.cos(angle)]
    size, kind = np.exp(rng.uniform(np.log(2.0), np.log(20.0))), rng.integers(3)
    if kind == 0:
        part = (along / size) ** 2 + (across / (size * rng.uniform(0.4, 1.0))) ** 2 < 1
    else:
        part = along > -size if kind == 1 else np.abs(across) < 0.3 * size
    for _ in range(rng.integers(3)):
        hole = places[rng.integers(len(places))]
        part &= np.hypot(*(places - hole).T) > rng.uniform(0.5, 3.0)
    return np.asarray(part, dtype=np.bool_)


def abused_contrast(
    white: NDArray[np.float64], places: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """(D,) contrasts with noise, misread cells, glare that shows cells white or brighter, and dirt."""
    misread = rng.random(len(white)) < rng.choice([0.0, 0.02, 0.05, 0.1, 0.15])
    contrast = np.where(misread, 1.0 - white, white) + rng.normal(0.0, rng.uniform(0.02, 0.3), len(white))
    for _ in range(rng.integers(3)):
        blob = np.hypot(*(places - places[rng.integers(len(places))]).T) < rng.uniform(0.5, 4.0)
        contrast[blob] = rng.choice([0.0, 0.9, 1.2, 2.5, np.nan])
    return contrast


def moved(axial: NDArray[np.int32], turns: int, dq: int, dr: int) -> NDArray[np.int32]:
    """The down-cells (N, 2) after turns by 120 degrees about marker 0, and a shift."""
    for _ in range(turns):
        axial = np.stack([-axial.sum(axis=1), axial[:, 0] - 1], axis=1)
    return np.ascontiguousarray(axial + np.array([dq, dr]), dtype=np.int32)


def ink_motion(rng: np.random.Generator) -> tuple[int, int, int]:
    """A random motion that keeps the inks."""
    turns, dq, dr = (int(v) for v in rng.integers((0, -40, -40), (3, 41, 41)))
    # A turn takes the up-cell (0, 0) to (-1, 0), and two turns take it to (0, -1).
    return turns, dq + (-(dq - dr) + (0, 1, -1)[turns]) % 3, dr


def judged(pads: Pads, rng: np.random.Generator) -> tuple[str, str, float]:
    """One part: its group, the verdict, and the milliseconds; a third of the parts is of another pad."""
    code, board = (int(v) for v in rng.integers(CODES, size=2))
    is_own = rng.random() < 2 / 3
    board = code if is_own else board if board != code else (board + 1) % CODES
    part = chosen_part(pads.places, rng)
    bit = (
        code_bits(abused_contrast(pads.white[code][part], pads.places[part], rng))
        if part.any()
        else np.zeros(0, np.int8)
    )
    known = int((bit != UNKNOWN).sum())
    group = next((name for name, (low, high) in GROUPS.items() if low <= known < high), "")
    if not group:
        return "", "", 0.0
    motion = ink_motion(rng)
    axial = moved(pads.axial[part], *motion)
    start = time.perf_counter()
    place = code_place(axial, bit, pads.boards[board])
    spent_ms = 1e3 * (time.perf_counter() - start)
    if place is None or not place.is_certain:
        return group + (", other pad" if not is_own else ""), "refused", spent_ms
    back = moved(axial, place.turns, place.dq, place.dr)
    is_right = is_own and np.array_equal(back, pads.axial[part])
    return group + (", other pad" if not is_own else ""), "right" if is_right else "wrong", spent_ms


def main() -> None:
    parser = argparse.ArgumentParser(description="Places of parts of coded pads by their code alone.")
    parser.add_argument("--layers", type=int, default=10)
    parser.add_argument("--parts", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    pads, rng = Pads(options.layers), np.random.default_rng(options.seed)
    counts: dict[str, Counter[str]] = {}
    times: list[float] = []
    while len(times) < options.parts:
        group, verdict, spent_ms = judged(pads, rng)
        if group:
            counts.setdefault(group, Counter())[verdict] += 1
            times.append(spent_ms)
    print(
        f"{options.layers} layers, {options.parts} parts, seed {options.seed}; median {np.median(times):.2f} ms a part"
    )
    for group in sorted(counts):
        found = counts[group]
        print(
            f"{group:35} {found.total():8} right {found['right'] / found.total():7.2%}  wrong {found['wrong']}"
        )


if __name__ == "__main__":
    main()
