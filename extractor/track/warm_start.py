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

from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers, corner_agreement
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled, vectorized
from extractor.numeric.dense_systems import dot3
from extractor.track.image_check import CONFIRMED, UNSEEN, check_cells
from extractor.track.warm_tables import WarmTables

MIN_VERIFIED_SHARE = 0.95  # of the cells in view that must agree with the image
MIN_PREDICTED = 0.8  # of the cells in view whose middles must still show their ink before anything is fitted
MIN_CENTER_STRENGTH = 0.3  # of its ink a frame ago that a middle must show for that
SEARCH_RADIUS = 0.9  # of an edge, the radius around a cell's middle in which its ink is looked for
MIN_ROWS = 8  # of pixels at least are looked at there
MIN_PIXEL_INK = 0.2  # of an ink, for a pixel to count as it
MIN_INK_SHARE = 0.4  # of a cell's area that must be found there
MAX_SHIFT = 0.35  # of an edge, how far a cell may lie from where it was predicted
LARGE_SHIFT = 0.2  # of an edge; after larger ones the window is moved and the ink looked for again
MAX_SPREAD = 0.25  # of an edge, how far the shifts of cells that share a marker may lie from their mean
MIN_WHITE_EDGES = (
    2  # of the three edges of a cell that must see it white, for it to be or to contest the reference
)
MIN_VOLUME = (
    0.05  # sine of an ink's direction to the plane of the two others, below which it cannot be unmixed
)
CELL_AREA_RATIO = 3**0.5 / 4  # of a square on its edge, an equilateral cell's area


@dataclass(frozen=True, eq=False)
class WarmStart:
    """Markers before refinement, how their cells look, and whether the rim proved them as the white cell is hidden."""

    places: InitialMarkers
    cell_levels: NDArray[np.float64]
    by_rim: bool


@compiled
def _count_matching_centers(image, xy, corners, ink, tint, nearest):  # type: ignore[no-untyped-def]
    """How many cells are in view, and how many of their middles are closer to their own ink than to the other two."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    color = np.zeros(3)
    seen, right = 0, 0
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        x, y = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        if not fill_patch_mean(flat, height, width, x, y, 0.5, color):  # NaN is outside, too
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
        if best == ink[i] and best_score > MIN_CENTER_STRENGTH * np.sqrt(
            own[0] ** 2 + own[1] ** 2 + own[2] ** 2
        ):
            right += 1
    return seen, right


@compiled
def _fill_unmixing_weights(own, first, second, row):  # type: ignore[no-untyped-def]
    """Write the weights of the channels that give 1 for an ink, -1 for the two others, 0 for black; False without."""
    normal = np.empty(3)
    row[:] = 0.0
    for n in range(3):
        a, b, c = (own, first, second) if n == 0 else (first, second, own) if n == 1 else (second, own, first)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            normal[k] = b[i] * c[j] - b[j] * c[i]
        volume = dot3(normal, a)
        if not abs(volume) > MIN_VOLUME * np.sqrt(dot3(normal, normal) * dot3(a, a)):
            return False
        for k in range(3):
            row[k] += (1.0 if n == 0 else -1.0) * normal[k] / volume
    return True


@compiled
def _measure_shifts(image, xy, corners, ink, nearest, look):  # type: ignore[no-untyped-def]
    """(C, 2) from each cell's predicted middle to the middle of its ink nearby, NaN where there is too little.

    The ink is unmixed from the two others, whose cells touch this one's corners, and from white, which shows all three.
    The window is what a disc in an equilateral cell becomes as the cell is sheared to its corners.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    shift = np.full((corners.shape[0], 2), np.nan)
    row, sums = np.zeros(3), np.zeros(3)
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        first = look[0, nearest[i, (ink[i] + 0) % 3]]
        second = look[0, nearest[i, (ink[i] + 1) % 3]]
        if not _fill_unmixing_weights(look[0, i], first, second, row):
            continue
        zero = dot3(row, look[1, i])
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        # axes of the ellipse: a unit along and across the edge a-b of the equilateral cell
        ux, uy = b[0] - a[0], b[1] - a[1]
        vx, vy = (c[0] - a[0] - 0.5 * ux) / 0.75**0.5, (c[1] - a[1] - 0.5 * uy) / 0.75**0.5
        area = ux * vy - uy * vx
        if not abs(area) > 1.0:
            continue
        high, lean = uy * uy + vy * vy, ux * uy + vx * vy
        top = SEARCH_RADIUS * np.sqrt(high)
        sums[:] = 0.0
        every = max(int(2.0 * top / MIN_ROWS), 1)
        for y in range(max(int(np.ceil(cy - top)), 0), min(int(np.floor(cy + top)), height - 1) + 1, every):
            off = (y - cy) / high
            half = abs(area) * np.sqrt(max(SEARCH_RADIUS * SEARCH_RADIUS / high - off * off, 0.0))
            start = max(int(np.ceil(cx + lean * off - half)), 0)
            end = min(int(np.floor(cx + lean * off + half)), width - 1)
            if start <= end:
                line = flat[3 * (y * width + start) : 3 * (y * width + end + 1)]
                _add_ink_moments(line, start - cx, y - cy, row[0], row[1], row[2], zero, sums)
        if every * sums[0] > MIN_INK_SHARE * CELL_AREA_RATIO * abs(area):
            shift[i, 0], shift[i, 1] = sums[1] / sums[0], sums[2] / sums[0]
    return shift


@vectorized
def _add_ink_moments(line, x, y, red, green, blue, zero, sums):  # type: ignore[no-untyped-def]
    """Add the ink of a row of pixels, the first at (x, y), and its moments."""
    total, moment = 0.0, 0.0
    for k in range(np.uint64(line.shape[0] // 3)):
        at = np.uint64(3) * k
        f = red * line[at] + green * line[at + np.uint64(1)] + blue * line[at + np.uint64(2)] - zero
        f = min(f, 1.0) * (f > MIN_PIXEL_INK)
        total += f
        moment += f * k
    sums[0] += total
    sums[1] += moment + total * x
    sums[2] += total * y


@compiled
def _update_shifts_and_move_markers(xy, shift, corners):  # type: ignore[no-untyped-def]
    """The markers (M, 2) moved by their cells' mean shift, NaN where these disagree; the largest shift in edges."""
    count = xy.shape[0]
    total, members, edge = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    largest = 0.0
    for i in range(corners.shape[0]):
        if not np.isfinite(shift[i, 0]):
            continue
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        size = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) + np.sqrt(
            (b[0] - c[0]) ** 2 + (b[1] - c[1]) ** 2
        )
        size = (size + np.sqrt((c[0] - a[0]) ** 2 + (c[1] - a[1]) ** 2)) / 3
        far = np.sqrt(shift[i, 0] ** 2 + shift[i, 1] ** 2) / size
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
                if dx * dx + dy * dy > (MAX_SPREAD * edge[m] / members[m]) ** 2:
                    moved[m] = np.nan
    return moved, largest, edge / np.maximum(members, 1.0)


@compiled
def _connected_cells(verdict, first, known, corners, cells_of_marker):  # type: ignore[no-untyped-def]
    """Which right cells hang together with the ``first`` ones over common markers, and whether they are nearly all of
    those in view whose markers were ``known``."""
    count = corners.shape[0]
    reached = first & (verdict == CONFIRMED)
    queue = np.empty(count, np.int64)
    head, tail = 0, 0
    for i in range(count):
        if reached[i]:
            queue[tail] = i
            tail += 1
    while head < tail:
        i = queue[head]
        head += 1
        for k in range(3):
            for near in range(3):
                j = cells_of_marker[corners[i, k], near]
                if j >= 0 and verdict[j] == CONFIRMED and not reached[j]:
                    reached[j] = True
                    queue[tail] = j
                    tail += 1
    expected, met = 0, 0
    for i in range(count):
        if verdict[i] != UNSEEN and known[corners[i, 0]] and known[corners[i, 1]] and known[corners[i, 2]]:
            expected += 1
            met += reached[i]
    return reached, tail > 0 and met >= MIN_VERIFIED_SHARE * expected


@compiled
def _verified_markers(xy, proved, corners):  # type: ignore[no-untyped-def]
    """(M, 2) the corners of proved cells, the others NaN; how many proved cells, and how many at all, meet there."""
    kept = np.full(xy.shape, np.nan)
    there, meeting = np.zeros(xy.shape[0], np.int64), np.zeros(xy.shape[0], np.int64)
    for i in range(corners.shape[0]):
        for k in range(3):
            m = corners[i, k]
            meeting[m] += 1
            if proved[i]:
                there[m] += 1
                kept[m] = xy[m]
    return kept, there, meeting


def select_prediction(
    image: NDArray[np.uint8],
    guesses: list[NDArray[np.float64]],
    tables: WarmTables,
    look: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """The guess (M, 2) under which the most cells show their ink in their middle; None when too few do."""
    best, best_share = None, MIN_PREDICTED
    for guess in guesses:
        seen, right = _count_matching_centers(
            image, guess, tables.corners, tables.ink, look[0], tables.nearest
        )
        if right > best_share * seen:
            best, best_share = guess, right / seen
            if right == seen:
                break
    return best


def verify_prediction(
    view: PyramidLevel,
    predicted_px: NDArray[np.float64],
    known: NDArray[np.bool_],
    tables: WarmTables,
    look: NDArray[np.float64],
) -> WarmStart | None:
    """Move the predicted cells onto the image; None unless enough of them are proved to be what they should.

    Args:
        view: the image at the scale at which it is looked at.
        predicted_px: (M, 2) in the view, NaN where nothing is predicted.
        known: (M,) markers that the frame before had; cells of these in view are what must be found again.
        look: (2, C, 3) each cell's ink minus black and black in the frame before.
    """
    xy, edge_px = _align_to_inks(view.image, predicted_px, tables, look)
    proof = check_cells(view.image, xy[tables.corners], tables, look)
    by_rim = proof.white == 0
    if proof.white_elsewhere_count >= MIN_WHITE_EDGES:
        return None
    if by_rim and (proof.verdict[tables.rim] != CONFIRMED).any():
        return None
    if not by_rim and (proof.white < MIN_WHITE_EDGES or proof.white_missing_count > 0):
        return None
    proved, enough = _connected_cells(
        proof.verdict, tables.rim if by_rim else tables.white, known, tables.corners, tables.cells_of_marker
    )
    if not enough:
        return None
    kept, there, meeting = _verified_markers(xy, proved, tables.corners)
    now = np.where(proved[:, None], proof.cell_levels, look)
    size = view.to_full_scale(kept), edge_px * view.scale
    return WarmStart(
        InitialMarkers(*size, tables.corners[proved], *corner_agreement(there, meeting)), now, by_rim
    )


def _align_to_inks(
    image: NDArray[np.uint8], predicted_px: NDArray[np.float64], tables: WarmTables, look: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The markers (M, 2) where their cells' inks are, and the edges (M,) around them."""
    for _ in range(2):
        shift = _measure_shifts(image, predicted_px, tables.corners, tables.ink, tables.nearest, look)
        predicted_px, largest, edge_px = _update_shifts_and_move_markers(predicted_px, shift, tables.corners)
        if largest < LARGE_SHIFT:
            break
    return predicted_px, edge_px
