"""Parts of coded pads that are cropped and damaged, registered by their cells and bits: right and wrong motions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, count, islice

import numpy as np
from numpy.typing import NDArray

from cmpdesign import Design, build_layout
from extractor import Reference
from extractor._native.numbering import BRIGHT
from extractor.layout.lattice_tables import Lattice, cells_at, lattice_of
from extractor.numbering.ink_fields import InkFields, Palette
from extractor.numbering.lattice_walk import WalkedCells
from extractor.numbering.registration import PlacedPart, Registration, SeenPart
from extractor.numbering.witnesses import BrightPlaces

CODES = 16
NAMING_LEAD = 20.0  # log odds of the right naming; the inks are seen
MIN_BITS = 30
PARTS_AT_ONCE = 200  # of one pad
NO_COLORS = np.zeros((0, 3))
GROUPS = {"30 to 59 known bits": (MIN_BITS, 60), "60 to 119": (60, 120), "120 and more": (120, 10**6)}
NO_BRIGHT_PLACES = BrightPlaces(0, 0)
STEPS_BESIDE = np.array([[0, 0], [-1, 0], [-1, 1]])  # from a down-cell to the up-cells that share its sides
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
        """(..., D) the down-cells that share a side with cells of a part (..., U)."""
        padded = np.concatenate([part, np.zeros((*part.shape[:-1], 1), np.bool_)], axis=-1)
        return np.asarray(padded[..., self.beside].any(axis=-1))


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


def chosen_parts(place: NDArray[np.float64], count: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(B, U) the cells of random crops: ellipses, half planes and strips; then holes of blobs."""
    step = place - place[rng.integers(len(place), size=count)][:, None]
    angle = rng.uniform(0, np.pi, (count, 1))
    along = step[..., 0] * np.cos(angle) + step[..., 1] * np.sin(angle)
    across = step[..., 1] * np.cos(angle) - step[..., 0] * np.sin(angle)
    size = np.exp(rng.uniform(np.log(2.0), np.log(20.0), (count, 1)))
    ellipse = (along / size) ** 2 + (across / (size * rng.uniform(0.4, 1.0, (count, 1)))) ** 2 < 1
    kind = rng.integers(3, size=(count, 1))
    part = np.choose(kind, [ellipse, along > -size, np.abs(across) < 0.3 * size])
    holes = rng.integers(3, size=count)
    for n in range(2):
        hole = place[rng.integers(len(place), size=count)][:, None]
        beyond = np.hypot(*np.moveaxis(place - hole, -1, 0)) > rng.uniform(0.5, 3.0, (count, 1))
        part &= beyond | (holes <= n)[:, None]
    return np.asarray(part, dtype=np.bool_)


def abused_whiteness(
    white: NDArray[np.bool_], place: NDArray[np.float64], near: NDArray[np.bool_], rng: np.random.Generator
) -> NDArray[np.float64]:
    """(B, D) whiteness with noise, misread bits, glare that shows cells white, and dirt.

    Args:
        white: (D,) of the pad.
        place: (D, 2) the places, in edges.
        near: (B, D) the places of each part, to which blobs belong.
    """
    count = len(near)
    misread = rng.random(near.shape) < rng.choice([0.0, 0.02, 0.05, 0.1, 0.15], (count, 1))
    noise = rng.standard_normal(near.shape, np.float32) * rng.uniform(0.02, 0.3, (count, 1))
    whiteness = (white ^ misread) + noise
    blobs = rng.integers(3, size=count)
    for n in range(2):
        middle = place[(rng.random(near.shape, np.float32) * near).argmax(axis=1)][:, None]
        within = np.hypot(*np.moveaxis(place - middle, -1, 0)) < rng.uniform(0.5, 4.0, (count, 1))
        light = rng.choice([0.0, 0.9, 1.2, np.nan], (count, 1))
        whiteness = np.where(within & (blobs > n)[:, None], light, whiteness)
    return np.asarray(whiteness)


def moved(axial: NDArray[np.int32], motion: NDArray[np.integer], up: bool) -> NDArray[np.int32]:
    """The up-cells or down-cells (N, 2) after turns by 120 degrees about marker 0, and a shift."""
    for _ in range(int(motion[0])):
        turned = -axial.sum(axis=1)
        axial = np.stack([turned - 1, axial[:, 0]] if up else [turned, axial[:, 0] - 1], axis=1)
    return np.ascontiguousarray(axial + motion[1:], dtype=np.int32)


def seen_part(
    places: NDArray[np.int32],
    axial: NDArray[np.int32],
    down: NDArray[np.int32],
    whiteness: NDArray[np.float64],
) -> SeenPart:
    """A part in a frame of its own: cells (P, 2) in the layout and in the frame, down-cells (D, 2) in the frame, and
    the whiteness (D,) of these."""
    # the class k of the frame is the class k + shift of the layout
    shift = (places[0] - axial[0]) @ [1, -1] % 3
    naming = np.where(np.arange(3) == shift, 0.0, -NAMING_LEAD)
    fields = InkFields(NO_COLORS, NO_COLORS, down, whiteness, whiteness > BRIGHT, 1.0)
    zeros = np.zeros((len(axial), 8))
    cells = WalkedCells(
        centre_px=zeros[:, :2],
        corner_px=zeros[:, 2:].reshape(-1, 3, 2),
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


def judged(pads: list[Pad], rng: np.random.Generator) -> Iterator[tuple[str, str]]:
    """Groups and verdicts of parts of one pad; a third of them is registered with another pad."""
    code = int(rng.integers(len(pads)))
    pad, motion = pads[code], random_motion(rng)
    axial, down = moved(pad.lattice.axial, motion, up=True), moved(pad.down, motion, up=False)
    parts = chosen_parts(pad.place, PARTS_AT_ONCE, rng)
    near = pad.down_cells_of(parts)
    whiteness = abused_whiteness(pad.is_white, pad.down_place, near, rng)
    bits = (np.isfinite(whiteness) & near).sum(axis=1)
    read_as = np.where(rng.random(PARTS_AT_ONCE) < 2 / 3, 0, rng.integers(1, len(pads), PARTS_AT_ONCE))
    for number in np.flatnonzero(bits >= MIN_BITS):
        part, places = parts[number], pad.lattice.axial[parts[number]]
        seen = seen_part(places, axial[part], down[near[number]], whiteness[number, near[number]])
        other = int(read_as[number])
        placed = pads[(code + other) % len(pads)].registration.register(seen, NO_BRIGHT_PLACES)
        group = next(name for name, (low, high) in GROUPS.items() if low <= bits[number] < high)
        right = other == 0 and placed.is_certain and is_right(placed, places)
        verdict = "right" if right else "wrong" if placed.is_certain else "refused"
        yield group + (", other pad" if other else ""), verdict


def measured(layers: int, parts: int, seed: int) -> dict[str, Counter[str]]:
    """Verdicts by group."""
    pads, rng = [pad_of(layers, code) for code in range(1, CODES + 1)], np.random.default_rng(seed)
    counts: dict[str, Counter[str]] = {}
    every = chain.from_iterable(judged(pads, rng) for _ in count())
    for group, verdict in islice(every, parts):
        counts.setdefault(group, Counter())[verdict] += 1
    return counts
