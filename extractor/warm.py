"""The warm start: a frame's numbering predicted from the frame before, and proved by the image.

Nothing is believed because it was so a frame ago. Every cell must show its own ink inside and nothing of it beyond its
edges, and must hang together with the white cell (or with the whole rim of the pattern) over cells that do the same.
A triangle that is off by more than a seventh of an edge fails that, so where two of them share a corner the real cells
do, too; around a real corner red, green and blue turn clockwise, so a chain of such cells from the white one is
numbered as the search of a cold start would number it. Whatever falls short is left to the cold start. So the frame
before saves time and settles nothing, except while the white cell is hidden and the whole rim is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .placing import Places, agreement
from .reference import BLACK, WHITE, Reference
from .sampling import sample_dot, sample_patch

MIN_SHARE = 0.95  # of the cells in view that must agree with the image
MIN_PREDICTED = 0.8  # of the cells in view whose middles must still show their ink before anything is fitted
MIN_MIDDLE = 0.3  # of its ink a frame ago that a middle must show for that
WINDOW = 0.9  # of an edge, the radius around a cell's middle in which its ink is looked for
MIN_INK = 0.4  # of a cell's area that must be found there
MAX_SHIFT = 0.35  # of an edge, how far a cell may lie from where it was predicted
LARGE_SHIFT = 0.2  # of an edge; after larger ones the window is moved and the ink looked for again
MAX_SPREAD = 0.25  # of an edge, how far the shifts of cells that share a marker may lie from their mean
WHITE_RATIO = (
    0.75  # the white cell's brightness against an ink's, summed over the channels; black stays below
)
MIN_WHITE = 2  # of the three edges of a cell that must see it white, for it to be or to contest the reference
MIN_COSINE = 0.8  # between an ink and the same cell's ink a frame ago, black subtracted
STRENGTH = (0.4, 2.5)  # of an ink against the same cell's a frame ago
INNER = 0.5  # of the way from the middle to each corner, where the ink is looked at again
MIN_INNER = 0.4  # of the ink's strength that must be there
LEVEL_RADIUS = 0.15  # of the middle's distance to the corners, over which the ink is averaged

MIN_VOLUME = (
    0.05  # sine of an ink's direction to the plane of the two others, below which it cannot be unmixed
)
CELL_SHARE = (3**0.5 / 4) / (np.pi * WINDOW**2)  # of the window's area, a cell's

UNSEEN, WRONG, RIGHT = range(3)  # what the image says of a cell
NO_CELL, BLACK_CELL, WHITE_CELL = range(3)  # what the layout has beyond an edge


def _window(count: int = 89) -> NDArray[np.float64]:
    """(K, 3) weights of a cell's corners that spread points evenly, in no rows, over the window around its middle.

    A sunflower's seeds in an equilateral cell: rows would meet an edge all at once.
    """
    k = np.arange(count) + 0.5
    radius, angle = WINDOW * np.sqrt(k / count), np.pi * (3 - 5**0.5) * k
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    r = y / 0.75**0.5
    q = x - r / 2
    return np.column_stack([1 / 3 - q - r, 1 / 3 + q, 1 / 3 + r])


WINDOW_WEIGHTS = _window()


@dataclass(frozen=True, eq=False)
class Tables:
    """What the warm start needs of a triangular layout; C counts its inked cells.

    Attributes:
        corners: (C, 3) int32 marker ids, counter-clockwise from the front.
        ink: (C,) uint8, 1 red, 2 green, 3 blue.
        beyond: (C, 3) uint8, what lies beyond the edge from corner k to corner k + 1.
        nearest: (C, 3) int32, the nearest inked cell that is red, green, blue; the cell itself among them.
        cells_of_marker: (M, 3) int32, the inked cells around a marker, or -1.
        rim: (C,) bool, cells with a corner in the outermost layer.
        completion: (K, 4) int32: marker d from the markers a, b, c of the cell across the edge a-b.
        weights: (K, 3) float64: d = weights . (a, b, c), from the layout's positions.
    """

    corners: NDArray[np.int32]
    ink: NDArray[np.uint8]
    beyond: NDArray[np.uint8]
    nearest: NDArray[np.int32]
    cells_of_marker: NDArray[np.int32]
    rim: NDArray[np.bool_]
    completion: NDArray[np.int32]
    weights: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Proof:
    """What the image says of predicted cells.

    Attributes:
        verdict: (C,) uint8, ``UNSEEN`` (outside the image or not predicted), ``WRONG`` or ``RIGHT``.
        look: (2, C, 3) float64 BGR, each seen cell's ink minus the black around it, and this black.
        white, not_white: how many edges of inked cells see the white cell beyond them where it belongs, and do not.
        other_white: how many see something as bright where a black cell belongs.
    """

    verdict: NDArray[np.uint8]
    look: NDArray[np.float64]
    white: int
    not_white: int
    other_white: int


@dataclass(frozen=True, eq=False)
class WarmStart:
    """Markers before refinement, how their cells look, and whether the rim proved them as the white cell is hidden."""

    places: Places
    look: NDArray[np.float64]
    by_rim: bool


def tables_of(reference: Reference) -> Tables:
    """The tables of a triangular layout."""
    inked = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE)).astype(np.int32)
    corners = np.ascontiguousarray(reference.cell_corners[inked])
    ink = (reference.cell_color[inked] + 1).astype(np.uint8)
    around = np.full((len(reference.layer), 3), -1, np.int32)
    around[corners, (ink - 1)[:, None]] = np.arange(len(inked))[:, None]
    completion, weights, across = _completion(reference)
    kind = np.array([BLACK_CELL, WHITE_CELL, NO_CELL], np.uint8)
    color = np.append(np.where(reference.cell_color == WHITE, 1, 0), 2)
    return Tables(
        corners=corners,
        ink=ink,
        beyond=kind[color[across[inked]]],
        nearest=_nearest(reference.xy_mm[corners].mean(axis=1), ink),
        cells_of_marker=around,
        rim=(reference.layer[corners] == reference.layers).any(axis=1),
        completion=completion,
        weights=weights,
    )


def _completion(
    reference: Reference,
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
    """Rows (a, b, c, d) with their weights, and (cells, 3) the cell across each edge, -1 without one."""
    cells = reference.cell_corners.astype(np.int64)
    count = len(reference.layer)
    ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    apex = np.roll(cells, -2, axis=1).reshape(-1)
    key, opposite = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    order = np.argsort(key)
    place = order[np.minimum(np.searchsorted(key[order], opposite), len(key) - 1)]
    shared = key[place] == opposite
    across = np.where(shared, place // 3, -1).astype(np.int32).reshape(-1, 3)
    rows = np.column_stack([ends[shared], apex[shared], apex[place[shared]]]).astype(np.int32)
    a, b, c, d = np.moveaxis(reference.xy_mm[rows], 1, 0)
    along, up, want = b - a, c - a, d - a
    area = along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0]
    of_b = (want[:, 0] * up[:, 1] - want[:, 1] * up[:, 0]) / area
    of_c = (along[:, 0] * want[:, 1] - along[:, 1] * want[:, 0]) / area
    return rows, np.column_stack([1 - of_b - of_c, of_b, of_c]), across


def _nearest(center_mm: NDArray[np.float64], ink: NDArray[np.uint8]) -> NDArray[np.int32]:
    from scipy.spatial import cKDTree

    nearest = np.empty((len(ink), 3), np.int32)
    for color in range(3):
        members = np.flatnonzero(ink == color + 1)
        nearest[:, color] = members[cKDTree(center_mm[members]).query(center_mm)[1]]
    return nearest


def completed(tables: Tables, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """The markers (M, 2) with those that are lost beside known cells predicted from these."""
    lost = ~np.isfinite(xy_px[:, 0])
    rows = np.flatnonzero(lost[tables.completion[:, 3]] & ~lost[tables.completion[:, :3]].any(axis=1))
    if len(rows) == 0:
        return xy_px
    known = xy_px[tables.completion[rows, :3]]
    target = tables.completion[rows, 3]
    guess = (tables.weights[rows, :, None] * known).sum(axis=1)
    votes = np.bincount(target, minlength=len(xy_px))
    out = xy_px.copy()
    for axis in (0, 1):
        total = np.bincount(target, weights=guess[:, axis], minlength=len(xy_px))
        out[votes > 0, axis] = total[votes > 0] / votes[votes > 0]
    return out


@compiled
def _middles(image, xy, corners, ink, tint, nearest):  # type: ignore[no-untyped-def]
    """How many cells are in view, and how many of their middles are closer to their own ink than to the other two."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    color = np.zeros(3)
    seen, right = 0, 0
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        x, y = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        if not sample_patch(flat, height, width, x, y, 0.5, color):  # NaN is outside, too
            continue
        seen += 1
        best, best_score = 0, -np.inf
        for k in range(3):
            other = tint[nearest[i, k]]
            norm = np.sqrt(other[0] ** 2 + other[1] ** 2 + other[2] ** 2)
            low = min(color[0], color[1], color[2])
            score = other[0] * (color[0] - low) + other[1] * (color[1] - low) + other[2] * (color[2] - low)
            if score / norm > best_score:
                best, best_score = k + 1, score / norm
        own = tint[i]
        if best == ink[i] and best_score > MIN_MIDDLE * np.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2):
            right += 1
    return seen, right


@compiled
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _examine(image, xy, ink, beyond, nearest, before, compare):  # type: ignore[no-untyped-def]
    """Verdict and look of every cell with the corners ``xy`` (C, 3, 2); how often white is seen where it belongs."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = xy.shape[0]
    verdict = np.zeros(count, np.uint8)
    look = np.full((2, count, 3), np.nan)
    middle, black, other = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    white, not_white, other_white = 0, 0, 0
    for i in range(count):
        x, y = xy[i, :, 0].mean(), xy[i, :, 1].mean()
        size = np.hypot(xy[i, 0, 0] - x, xy[i, 0, 1] - y)
        radius = LEVEL_RADIUS * size
        if not sample_patch(flat, height, width, x, y, radius, middle):
            continue
        blacks, fits, outside = 0, True, False
        black[:] = 0.0
        for k in range(3):
            if beyond[i, k] == NO_CELL:
                continue
            mx = xy[i, k, 0] + xy[i, (k + 1) % 3, 0] - x
            my = xy[i, k, 1] + xy[i, (k + 1) % 3, 1] - y
            if not sample_patch(flat, height, width, mx, my, radius, other[k]):
                outside = True
                continue
            bright = other[k].sum() > WHITE_RATIO * middle.sum()
            if beyond[i, k] == WHITE_CELL:
                white += bright
                not_white += not bright
            else:
                other_white += bright
                fits = fits and not bright
                black += other[k]
                blacks += 1
        if outside or blacks == 0:
            continue
        own = look[0, i]
        for channel in range(3):
            own[channel] = middle[channel] - black[channel] / blacks
            look[1, i, channel] = black[channel] / blacks
        strength = _dot(own, own)
        for k in range(3):
            px, py = x + INNER * (xy[i, k, 0] - x), y + INNER * (xy[i, k, 1] - y)
            at = sample_dot(flat, height, width, px, py, own[0], own[1], own[2])
            fits = fits and at - _dot(own, black) / blacks > MIN_INNER * strength
            if beyond[i, k] == BLACK_CELL:
                fits = fits and _dot(other[k], own) - _dot(black, own) / blacks < MIN_INNER * strength
        if compare:
            ratio = _dot(own, before[i]) / max(_dot(before[i], before[i]), 1e-9)
            fits = fits and ratio > STRENGTH[0] and ratio < STRENGTH[1]
            best, best_cosine = 0, -1.0
            for k in range(3):
                hue = before[nearest[i, k]]
                cosine = _dot(own, hue) / np.sqrt(max(strength * _dot(hue, hue), 1e-9))
                if cosine > best_cosine:
                    best, best_cosine = k + 1, cosine
            fits = fits and best == ink[i] and best_cosine > MIN_COSINE
        verdict[i] = RIGHT if fits else WRONG
    return verdict, look, white, not_white, other_white


def examine(
    image: NDArray[np.uint8], corner_px: NDArray[np.float64], tables: Tables, look: NDArray[np.float64] | None
) -> Proof:
    """Compare cells with corners at (C, 3, 2) (NaN: not predicted) with the image, and their inks with ``look``."""
    before = np.zeros((len(tables.ink), 3)) if look is None else look[0]
    return Proof(
        *_examine(image, corner_px, tables.ink, tables.beyond, tables.nearest, before, look is not None)
    )


@compiled
def _unmixed(own, first, second, row):  # type: ignore[no-untyped-def]
    """Write the weights of the channels that give 1 for an ink, -1 for the two others, 0 for black; False without."""
    normal = np.empty(3)
    row[:] = 0.0
    for n in range(3):
        a, b, c = (own, first, second) if n == 0 else (first, second, own) if n == 1 else (second, own, first)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            normal[k] = b[i] * c[j] - b[j] * c[i]
        volume = _dot(normal, a)
        if not abs(volume) > MIN_VOLUME * np.sqrt(_dot(normal, normal) * _dot(a, a)):
            return False
        for k in range(3):
            row[k] += (1.0 if n == 0 else -1.0) * normal[k] / volume
    return True


@compiled
def _shifts(image, xy, corners, ink, nearest, look, window):  # type: ignore[no-untyped-def]
    """(C, 2) from each cell's predicted middle to the middle of its ink nearby, NaN where there is too little.

    The ink is unmixed from the two others, whose cells touch this one's corners, and from white, which shows all three.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    shift = np.full((corners.shape[0], 2), np.nan)
    row = np.zeros(3)
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        own = look[0, i]
        first = look[0, nearest[i, (ink[i] + 0) % 3]]
        second = look[0, nearest[i, (ink[i] + 1) % 3]]
        if not _unmixed(own, first, second, row):
            continue
        zero = _dot(row, look[1, i])
        total, sx, sy = 0.0, 0.0, 0.0
        for k in range(window.shape[0]):
            x = window[k, 0] * a[0] + window[k, 1] * b[0] + window[k, 2] * c[0]
            y = window[k, 0] * a[1] + window[k, 1] * b[1] + window[k, 2] * c[1]
            f = sample_dot(flat, height, width, x, y, row[0], row[1], row[2]) - zero
            if f > 0.2:  # NaN outside the image is not
                f = min(f, 1.0)
                total += f
                sx += f * x
                sy += f * y
        if total > MIN_INK * CELL_SHARE * window.shape[0]:
            shift[i, 0] = sx / total - (a[0] + b[0] + c[0]) / 3
            shift[i, 1] = sy / total - (a[1] + b[1] + c[1]) / 3
    return shift


@compiled
def _moved(xy, shift, corners):  # type: ignore[no-untyped-def]
    """The markers (M, 2) moved by their cells' mean shift, NaN where these disagree; the largest shift in edges."""
    count = xy.shape[0]
    total, members, edge = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    largest = 0.0
    for i in range(corners.shape[0]):
        if not np.isfinite(shift[i, 0]):
            continue
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        size = np.hypot(a[0] - b[0], a[1] - b[1]) + np.hypot(b[0] - c[0], b[1] - c[1])
        size = (size + np.hypot(c[0] - a[0], c[1] - a[1])) / 3
        far = np.hypot(shift[i, 0], shift[i, 1]) / size
        if far > MAX_SHIFT:
            shift[i] = np.nan
            continue
        largest = max(largest, far)
        for k in range(3):
            m = corners[i, k]
            total[m] += shift[i]
            edge[m] += size
            members[m] += 1.0
    moved = np.full((count, 2), np.nan)
    for m in range(count):
        if members[m] > 0.0:
            moved[m] = xy[m] + total[m] / members[m]
    for i in range(corners.shape[0]):
        for k in range(3):
            m = corners[i, k]
            if np.isfinite(shift[i, 0]) and np.isfinite(moved[m, 0]):
                dx, dy = shift[i, 0] - (moved[m, 0] - xy[m, 0]), shift[i, 1] - (moved[m, 1] - xy[m, 1])
                if np.hypot(dx, dy) > MAX_SPREAD * edge[m] / members[m]:
                    moved[m] = np.nan
    return moved, largest, edge / np.maximum(members, 1.0)


@compiled
def _connected(corners, right, first, cells_of_marker):  # type: ignore[no-untyped-def]
    """Which right cells hang together with the ``first`` ones over common markers."""
    reached = first & right
    queue = np.empty(right.shape[0], np.int64)
    head, tail = 0, 0
    for i in range(right.shape[0]):
        if reached[i]:
            queue[tail] = i
            tail += 1
    while head < tail:
        i = queue[head]
        head += 1
        for k in range(3):
            for near in range(3):
                j = cells_of_marker[corners[i, k], near]
                if j >= 0 and right[j] and not reached[j]:
                    reached[j] = True
                    queue[tail] = j
                    tail += 1
    return reached


def predict(
    image: NDArray[np.uint8], guesses: list[NDArray[np.float64]], tables: Tables, look: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """The guess (M, 2) under which the most cells show their ink in their middle; None when too few do."""
    best, best_share = None, MIN_PREDICTED
    for guess in guesses:
        seen, right = _middles(image, guess, tables.corners, tables.ink, look[0], tables.nearest)
        if right > best_share * seen:
            best, best_share = guess, right / seen
    return best


def prove(
    image: NDArray[np.uint8],
    predicted_px: NDArray[np.float64],
    known: NDArray[np.bool_],
    tables: Tables,
    look: NDArray[np.float64],
) -> WarmStart | None:
    """Move the predicted cells onto the image; None unless enough of them are proved to be what they should.

    Args:
        image: (H, W, 3) uint8 BGR.
        predicted_px: (M, 2), NaN where nothing is predicted.
        known: (M,) markers that the frame before had; cells of these in view are what must be found again.
        look: (2, C, 3) each cell's ink minus black and black in the frame before.
    """
    xy, edge_px = _aligned(image, predicted_px, tables, look)
    proof = examine(image, xy[tables.corners], tables, look)
    right = proof.verdict == RIGHT
    by_rim = proof.white == 0
    first = tables.rim if by_rim else (tables.beyond == WHITE_CELL).any(axis=1)
    if proof.other_white >= MIN_WHITE or (by_rim and not right[tables.rim].all()):
        return None
    if not by_rim and (proof.white < MIN_WHITE or proof.not_white > 0):
        return None
    proved = _connected(tables.corners, right, first, tables.cells_of_marker)
    expected = known[tables.corners].all(axis=1) & (proof.verdict != UNSEEN)
    if not proved.any() or (proved & expected).sum() < MIN_SHARE * expected.sum():
        return None
    cells = tables.corners[proved]
    kept = np.full_like(xy, np.nan)
    kept[cells] = xy[cells]
    now = np.where(proved[:, None], proof.look, look)
    there = np.bincount(cells.ravel(), minlength=len(xy))
    meeting = (tables.cells_of_marker >= 0).sum(axis=1)
    return WarmStart(Places(kept, edge_px, cells, *agreement(there, meeting)), now, by_rim)


def _aligned(
    image: NDArray[np.uint8], predicted_px: NDArray[np.float64], tables: Tables, look: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The markers (M, 2) where their cells' inks are, and the edges (M,) around them."""
    for _ in range(2):
        shift = _shifts(image, predicted_px, tables.corners, tables.ink, tables.nearest, look, WINDOW_WEIGHTS)
        predicted_px, largest, edge_px = _moved(predicted_px, shift, tables.corners)
        if largest < LARGE_SHIFT:
            break
    return predicted_px, edge_px
