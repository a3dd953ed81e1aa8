"""Kinds of damage: cells missing, dirt, scratches, glare, the white cell hidden."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.stress.frames import RGB, PatternFrame
from benchmarks.suites.stress.kinds import ConditionKind, group_kinds
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, RED
from cmpdesign.scene import Blob, Glare, Press, Scratch
from cmpdesign.scene.standard import INKS

Cells = NDArray[np.intp]
CLUSTER = 6  # neighbouring cells that are missing together
DIRT = (90.0, 80.0, 70.0)


def without_cells(frame: PatternFrame, cells: Cells) -> PatternFrame:
    """The frame with these cells missing."""
    return frame.damaged(missing_cells=tuple(int(cell) for cell in cells))


def droppable_cells(layout: Layout) -> Cells:
    """Numbers of the colored cells without the reference cell."""
    colored = layout.cell_color != BLACK
    colored[layout.reference_cell] = False
    return np.flatnonzero(colored)


def cell_centres_mm(layout: Layout) -> NDArray[np.float64]:
    """(C, 2) centres of all cells."""
    return np.asarray(layout.marker_xy_mm[layout.cell_corners].mean(axis=1))


def cell_rings(layout: Layout) -> NDArray[np.int32]:
    """(C,) int32: the layer at each cell's outer side, from 1."""
    return np.asarray(layout.marker_layer[layout.cell_corners].max(axis=1))


def missing_cell_clusters(frame: PatternFrame, share: float) -> PatternFrame:
    """Groups of neighbouring cells are missing, up to a share."""
    droppable, centre = droppable_cells(frame.layout), cell_centres_mm(frame.layout)
    missing: set[int] = set()
    order, turn = frame.rng.permuted(droppable), 0
    while len(missing) < share * len(droppable):
        middle = centre[order[turn]]
        distance = np.linalg.norm(centre[droppable] - middle, axis=1)
        missing.update(int(cell) for cell in droppable[np.argsort(distance)[:CLUSTER]])
        turn = max(turn + 1, len(missing))  # a group may be missing already
    return without_cells(frame, np.array(sorted(missing)))


def missing_hole(frame: PatternFrame, share: float) -> PatternFrame:
    """A share of the cells is missing around one position."""
    droppable, centre = droppable_cells(frame.layout), cell_centres_mm(frame.layout)
    middle = frame.rng.uniform(-4, 4, 2)
    distance = np.linalg.norm(centre[droppable] - middle, axis=1)
    return without_cells(frame, droppable[np.argsort(distance)[: round(share * len(droppable))]])


def layer_missing(frame: PatternFrame, layer: float) -> PatternFrame:
    """The cells inside one layer are missing."""
    droppable = droppable_cells(frame.layout)
    return without_cells(frame, droppable[cell_rings(frame.layout)[droppable] == layer])


def outer_layers_missing(frame: PatternFrame, count: float) -> PatternFrame:
    """The cells of the outermost layers are missing."""
    droppable = droppable_cells(frame.layout)
    layer = cell_rings(frame.layout)[droppable]
    return without_cells(frame, droppable[layer > layer.max() - count])


def sector_missing(frame: PatternFrame, degrees: float) -> PatternFrame:
    """The cells of a sector are missing."""
    droppable = droppable_cells(frame.layout)
    x, y = cell_centres_mm(frame.layout)[droppable].T
    angle_deg = (np.degrees(np.arctan2(y, x)) - frame.rng.uniform(0, 360)) % 360
    return without_cells(frame, droppable[(angle_deg < degrees) & (np.hypot(x, y) > 1.2)])


def white_neighbours_missing(frame: PatternFrame, count: float) -> PatternFrame:
    """Some colored cells around the white cell are missing."""
    corners = frame.layout.cell_corners
    white = corners[frame.layout.reference_cell]
    droppable = droppable_cells(frame.layout)
    touching = droppable[np.isin(corners[droppable], white).any(axis=1)]
    return without_cells(frame, frame.rng.permuted(touching)[: int(count)])


def one_ink_missing(frame: PatternFrame, share: float) -> PatternFrame:
    """A share of the red cells is missing."""
    red = np.flatnonzero(frame.layout.cell_color == RED)
    return without_cells(frame, frame.rng.permuted(red)[: round(share * len(red))])


def sample_places(frame: PatternFrame, count: int, least_mm: float = 2.0) -> NDArray[np.float64]:
    """(count, 2) mm: random positions on the pattern, at least ``least_mm`` from the centre."""
    rng, reach = frame.rng, 0.42 * min(frame.layout.size_mm)
    angle, radius = rng.uniform(0, 2 * np.pi, count), rng.uniform(least_mm, reach, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def with_blobs(frame: PatternFrame, count: int, radius_mm: float, rgb: RGB = DIRT) -> PatternFrame:
    """Blobs at random positions."""
    spots = tuple(Blob((x, y), radius_mm, rgb) for x, y in sample_places(frame, count, 1.5 + radius_mm))
    return frame.damaged(blobs=spots)


def band(frame: PatternFrame, turn_rad: float, offset_mm: float, width_mm: float, rgb: RGB) -> Scratch:
    """A straight band across the whole pattern, at a distance from the centre."""
    along = np.array([np.cos(turn_rad), np.sin(turn_rad)])
    middle, reach = offset_mm * np.array([-along[1], along[0]]), max(frame.layout.size_mm)
    (ax, ay), (bx, by) = (middle - reach * along).tolist(), (middle + reach * along).tolist()
    return Scratch((ax, ay), (bx, by), width_mm, rgb)


def with_scratches(
    frame: PatternFrame, count: int, width_mm: float, rgb: RGB = (150.0, 150.0, 150.0), aside: float = 2.5
) -> PatternFrame:
    """Bands across the whole pattern, at least ``aside`` mm from the centre."""
    rng, bands = frame.rng, []
    for turn in rng.uniform(0, 2 * np.pi) + np.pi * np.arange(count) / count * 2:
        offset_mm = aside + 0.5 * width_mm + rng.uniform(0, 4) * (aside > 0)
        bands.append(band(frame, turn, offset_mm, width_mm, rgb))
    return frame.damaged(scratches=tuple(bands))


def with_glare(frame: PatternFrame, count: int, sigma_px: float, least_px: float) -> PatternFrame:
    """Reflections at least ``least_px`` from the image's centre."""
    rng = frame.rng
    angle, radius = rng.uniform(0, 2 * np.pi, count), rng.uniform(least_px, least_px + 80, count)
    x, y = 319.5 + radius * np.cos(angle), 239.5 + radius * np.sin(angle)
    spots = tuple(Glare((px, py), sigma_px) for px, py in zip(x, y, strict=True))
    return frame.damaged(glare=spots)


def white_covered(frame: PatternFrame, rgb: RGB, radius_mm: float) -> PatternFrame:
    """A blob covers the white cell."""
    x, y = cell_centres_mm(frame.layout)[frame.layout.reference_cell]
    return frame.damaged(blobs=(Blob((x, y), radius_mm, rgb),))


def white_in_ink(frame: PatternFrame, ink: str) -> PatternFrame:
    """The white cell is printed in another ink."""
    return frame.with_parts(inks={**INKS, "white": INKS[ink]})


def white_missing(frame: PatternFrame) -> PatternFrame:
    """The white cell is missing."""
    return without_cells(frame, np.array([frame.layout.reference_cell]))


def white_elsewhere(frame: PatternFrame, radius_mm: float) -> PatternFrame:
    """The white cell is missing, and a white blob on a black cell is a wrong candidate of the reference."""
    black = np.flatnonzero((frame.layout.cell_color == BLACK) & (cell_rings(frame.layout) <= 4))
    x, y = cell_centres_mm(frame.layout)[frame.rng.choice(black)]
    drop = Blob((x, y), radius_mm, INKS["white"])
    return frame.damaged(missing_cells=(frame.layout.reference_cell,), blobs=(drop,))


def with_bulge(frame: PatternFrame) -> PatternFrame:
    """A pressed surface."""
    return frame.with_surface(Press(4, 1.2))


def white_glared(frame: PatternFrame, sigma_px: float) -> PatternFrame:
    """A reflection on the white cell, near the image's centre."""
    return frame.damaged(glare=(Glare((319.5, 239.5), sigma_px),))


PRINTED = ("red", "green", "blue")

MISSING_KINDS = group_kinds(
    "missing",
    ConditionKind(
        "cells missing", "1", (0.01, 0.02, 0.05, 0.1, 0.2), lambda f, s: f.damaged(missing_share=s)
    ),
    ConditionKind("clusters missing", "1", (0.01, 0.02, 0.05, 0.1, 0.2), missing_cell_clusters),
    ConditionKind("one hole", "1", (0.05, 0.1, 0.2, 0.3), missing_hole),
    ConditionKind("a layer missing", "layer", (2, 3, 5, 8, 11), layer_missing),
    ConditionKind("outer layers missing", "layers", (1, 2, 4), outer_layers_missing),
    ConditionKind("a sector missing", "deg", (20, 45, 90, 180), sector_missing),
    ConditionKind("cells around the white one missing", "cells", (1, 2, 3, 6), white_neighbours_missing),
    ConditionKind("one ink missing", "1", (0.1, 0.25, 0.5), one_ink_missing),
    ConditionKind(
        "missing, bulged", "1", (0.02, 0.05, 0.1), lambda f, s: with_bulge(f.damaged(missing_share=s))
    ),
    ConditionKind(
        "missing, tilted",
        "1",
        (0.02, 0.05, 0.1),
        lambda f, s: f.damaged(missing_share=s).with_camera(tilt_deg=40),
    ),
)

DIRT_KINDS = group_kinds(
    "dirt",
    ConditionKind("one blob", "pitch", (0.5, 1, 2, 3), lambda f, s: with_blobs(f, 1, s)),
    ConditionKind("many blobs", "", (4, 8, 16), lambda f, s: with_blobs(f, int(s), 0.6)),
    ConditionKind("red blobs", "", (2, 4, 8), lambda f, s: with_blobs(f, int(s), 0.7, INKS["red"])),
    ConditionKind("white blobs", "", (1, 3, 8), lambda f, s: with_blobs(f, int(s), 0.45, INKS["white"])),
    ConditionKind("black blobs", "", (2, 4, 8), lambda f, s: with_blobs(f, int(s), 0.8, INKS["black"])),
    ConditionKind("a scratch", "pitch", (0.1, 0.3, 0.6, 1, 1.5), lambda f, s: with_scratches(f, 1, s)),
    ConditionKind(
        "a black scratch", "pitch", (0.3, 0.6, 1), lambda f, s: with_scratches(f, 1, s, INKS["black"])
    ),
    ConditionKind(
        "a white scratch", "pitch", (0.1, 0.3, 0.6), lambda f, s: with_scratches(f, 1, s, INKS["white"])
    ),
    ConditionKind("scratches", "", (2, 3, 5), lambda f, s: with_scratches(f, int(s), 0.3)),
    ConditionKind(
        "a scratch beside the white cell",
        "pitch",
        (0.2, 0.5, 1),
        lambda f, s: with_scratches(f, 1, s, aside=0.9),
    ),
    ConditionKind("glare", "px", (10, 20, 40, 60), lambda f, s: with_glare(f, 1, s, 1.6 * s + 30)),
    ConditionKind("many glares", "", (2, 4, 8), lambda f, s: with_glare(f, int(s), 12, 60)),
    ConditionKind("bleeding inks", "pitch", (0.02, 0.05, 0.1), lambda f, s: f.damaged(bleed_mm=s)),
)

NO_WHITE_KINDS = group_kinds(
    "no white",
    ConditionKind("white cell missing", "", (0,), lambda f, s: white_missing(f), False, 3),
    ConditionKind(
        "white cell in another ink", "", (0, 1, 2), lambda f, s: white_in_ink(f, PRINTED[int(s)]), False
    ),
    ConditionKind(
        "white cell under dirt", "pitch", (0.3, 0.6, 1.2), lambda f, s: white_covered(f, DIRT, s), False
    ),
    ConditionKind("white cell in glare", "px", (8, 16, 32), white_glared, False),
    ConditionKind("white cell missing, white blob", "pitch", (0.3, 0.45, 0.6), white_elsewhere, False, 3),
)
