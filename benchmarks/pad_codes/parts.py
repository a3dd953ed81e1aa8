"""Parts of coded pads that are cropped and damaged, registered by their cells and bits: right and wrong motions.

python -m benchmarks.pad_codes [--layers 10] [--parts 100000] [--seed 5]
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign import Design, build_layout
from extractor import Reference
from extractor.layout.lattice_tables import Lattice, cells_at, lattice_of
from extractor.numbering.code_bits import STEPS_BESIDE
from extractor.numbering.ink_fields import LIMITS, InkFields, Palette
from extractor.numbering.lattice_walk import WalkedCells
from extractor.numbering.registration import PlacedPart, Registration, SeenPart
from extractor.numbering.witnesses import BrightPlaces

CODES = 16
NAMING_LEAD = 20.0  # log odds of the right naming; the inks are seen
LEAST_BITS = 30
GROUPS = {"30 to 59 known bits": (LEAST_BITS, 60), "60 to 119": (60, 120), "120 and more": (120, 10**6)}
NO_BRIGHT_PLACES = BrightPlaces(0, 0)
LATTICE_STEPS = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])


@dataclass(frozen=True, eq=False)
class Pad:
    """A coded pad.

    Attributes:
        lattice: its lattice, with U cells.
        registration: registers parts with the pad.
        place: (U, 2), the cells' places, in edges.
        down: (D, 2), its down-cells.
        down_place: (D, 2), their places, in edges.
        beside: (D, 3), the cells at their sides, U for none.
        is_white: (D,), which of them are white.
    """

    lattice: Lattice
    registration: Registration
    place: NDArray[np.float64]
    down: NDArray[np.int32]
    down_place: NDArray[np.float64]
    beside: NDArray[np.int32]
    is_white: NDArray[np.bool_]

    def down_cells_of(self, part: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(D,) the down-cells that share a side with cells of a part (U,)."""
        return np.asarray(np.append(part, False)[self.beside].any(axis=1))


def pad_of(layers: int, code: int) -> Pad:
    design = Design(pattern="honeycomb", layers=layers, pitch_mm=1.0, code=code, virtual_per_edge=0)
    reference = build_layout(design).reference()
    assert isinstance(reference, Reference)
    lattice = lattice_of(reference)
    registration = Registration([lattice], Palette(dict(reference.palette)), False)
    down = np.unique((lattice.axial[:, None] - STEPS_BESIDE).reshape(-1, 2), axis=0).astype(np.int32)
    is_white = (down[:, None] == lattice.white_axial).all(axis=2).any(axis=1)
    beside = cells_at((down[:, None] + STEPS_BESIDE).reshape(-1, 2), lattice).reshape(-1, 3)
    return Pad(
        lattice=lattice,
        registration=registration,
        place=lattice.axial @ LATTICE_STEPS,
        down=down,
        down_place=down @ LATTICE_STEPS,
        beside=np.where(beside < 0, len(lattice.axial), beside),
        is_white=is_white,
    )


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


def abused_whiteness(
    white: NDArray[np.bool_], places: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """(D,) whiteness with noise, misread bits, glare that shows cells white, and dirt."""
    misread = rng.random(len(white)) < rng.choice([0.0, 0.02, 0.05, 0.1, 0.15])
    whiteness = (white ^ misread) + rng.normal(0.0, rng.uniform(0.02, 0.3), len(white))
    for _ in range(rng.integers(3) if len(white) else 0):
        blob = np.hypot(*(places - places[rng.integers(len(places))]).T) < rng.uniform(0.5, 4.0)
        whiteness[blob] = rng.choice([0.0, 0.9, 1.2, np.nan])
    return whiteness


def moved(axial: NDArray[np.int32], motion: NDArray[np.integer], up: bool) -> NDArray[np.int32]:
    """The up-cells or down-cells (N, 2) after turns by 120 degrees about marker 0, and a shift."""
    for _ in range(int(motion[0])):
        turned = -axial.sum(axis=1)
        axial = np.stack([turned - 1, axial[:, 0]] if up else [turned, axial[:, 0] - 1], axis=1)
    return np.ascontiguousarray(axial + motion[1:], dtype=np.int32)


def seen_part(
    places: NDArray[np.int32],
    down: NDArray[np.int32],
    whiteness: NDArray[np.float64],
    motion: NDArray[np.integer],
) -> SeenPart:
    """A part in a frame of its own: cells (P, 2), down-cells (D, 2), and the whiteness (D,) of these."""
    axial = moved(places, motion, up=True)
    # the class k of the frame is the class k + shift of the layout
    shift = (places[0] - axial[0]) @ [1, -1] % 3
    naming = np.where(np.arange(3) == shift, 0.0, -NAMING_LEAD)
    frame = moved(down, motion, up=False)
    fields = InkFields(np.zeros((3, 3)), np.zeros((0, 3)), frame, whiteness, whiteness > LIMITS.bright, 1.0)
    cells = WalkedCells(
        center_px=np.zeros((len(axial), 2)),
        corner_px=np.zeros((len(axial), 3, 2)),
        axial=axial,
        first=np.zeros(len(axial), np.int8),
        part=np.zeros(len(axial), np.int32),
    )
    return SeenPart(0, cells, fields, False, naming)


def is_right(placed: PlacedPart, places: NDArray[np.int32]) -> bool:
    """Whether the best motion carries the part's cells to the places (P, 2)."""
    return np.array_equal(moved(placed.seen.cells.axial, placed.motions.motion[0], up=True), places)


def random_motion(rng: np.random.Generator) -> NDArray[np.int64]:
    return rng.integers((0, -40, -40), (3, 41, 41))


def judged(pads: list[Pad], rng: np.random.Generator) -> tuple[str, str, float]:
    """One part: its group, the verdict, and the milliseconds; a third of the parts is of another pad."""
    code = int(rng.integers(len(pads)))
    other = (code + int(rng.integers(1, len(pads)))) % len(pads)
    is_own = rng.random() < 2 / 3
    pad = pads[code]
    part = chosen_part(pad.place, rng)
    places, near = pad.lattice.axial[part], pad.down_cells_of(part)
    whiteness = abused_whiteness(pad.is_white[near], pad.down_place[near], rng)
    bits = int(np.isfinite(whiteness).sum())
    group = next((name for name, (low, high) in GROUPS.items() if low <= bits < high), "")
    if not group:
        return "", "", 0.0
    seen = seen_part(places, pad.down[near], whiteness, random_motion(rng))
    group += "" if is_own else ", other pad"
    start = time.perf_counter()
    placed = pads[code if is_own else other].registration.register(seen, NO_BRIGHT_PLACES)
    spent_ms = 1e3 * (time.perf_counter() - start)
    if not placed.is_certain:
        return group, "refused", spent_ms
    return group, "right" if is_own and is_right(placed, places) else "wrong", spent_ms


def measured(layers: int, parts: int, seed: int) -> tuple[dict[str, Counter[str]], float]:
    """Verdicts by group, and the median milliseconds of a part."""
    pads, rng = [pad_of(layers, code) for code in range(1, CODES + 1)], np.random.default_rng(seed)
    counts: dict[str, Counter[str]] = {}
    times: list[float] = []
    while len(times) < parts:
        group, verdict, spent_ms = judged(pads, rng)
        if group:
            counts.setdefault(group, Counter())[verdict] += 1
            times.append(spent_ms)
    return counts, float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--layers", type=int, default=10)
    parser.add_argument("--parts", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    counts, median_ms = measured(options.layers, options.parts, options.seed)
    print(
        f"{options.layers} layers, {options.parts} parts, seed {options.seed}; median {median_ms:.2f} ms a part"
    )
    for group in sorted(counts):
        found = counts[group]
        print(
            f"{group:35} {found.total():8} right {found['right'] / found.total():7.2%}  wrong {found['wrong']}"
        )
