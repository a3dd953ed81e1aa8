"""Whether a bright place is the white cell: it is white all over, nowhere beyond, and lies between its own inks.

Where it must be, and how large, the numbered cells say, by a quadratic map of the layout to the image. A scratch across
a black cell, where two scratches cross, a drop or a reflection do not look so, nor does the white cell a step aside.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.bilinear_batch import (
    BATCH_POINTS,
    COLOR,
    RADIUS,
    X,
    Y,
    allocate_sample_buffers,
    fill_patch_means,
)
from extractor.numeric.bilinear_batch import INSIDE as INSIDE_IMAGE
from extractor.numeric.compilation import compiled
from extractor.numeric.dense_systems import dot3, update_to_cholesky_solution

MAX_FIT_CELLS = 16  # numbered cells, the nearest, that say where it is
MIN_FIT_CELLS = 3
RIDGE = 0.02  # holds the map's curvature where the witnesses lie on one side
MAX_PREDICTED_DEVIATION = 0.15  # of the map there, in edges
MAX_CENTROID_DISTANCE = (
    0.3  # in edges, of the white's centroid from where the map puts it; the next black cell is at 1
)
# The shape, from 0 for the paler one of ink and black to 1 for the middle.
MIN_INSIDE, MIN_CORNER, MAX_OUTSIDE = 0.5, 0.25, 0.5
MIN_INK_COSINE = 0.9  # cosine between a color and an ink, both above black
MIN_INK_STRENGTH = 0.3  # of an ink's strength above black: black, where its cell is missing
TERMS = 6  # 1, x, y, xx, xy, yy
# The corners of a down-cell from its middle, in axial steps: below, right above and left above.
CORNERS = np.array([[1, -2], [1, 1], [-2, 1]]) / 3
OPPOSITE_INKS = np.array([2, 3, 1])  # of the cells opposite to them
# In its corners; inside towards its corners and sides; around it beyond its corners and three places of each side.
INSIDE_POINTS = np.concatenate([0.85 * CORNERS, 0.5 * CORNERS, -0.33 * CORNERS])
SIDE_POINTS = [
    one + share * (two - one) for one, two in CORNERS[[[0, 1], [1, 2], [2, 0]]] for share in (0.25, 0.5, 0.75)
]
OUTSIDE_POINTS = np.concatenate(
    [1.7 * CORNERS, np.array(SIDE_POINTS) - 0.25 * CORNERS[[2, 2, 2, 0, 0, 0, 1, 1, 1]]]
)
GRID, GRID_REACH = 4, 0.8  # places over which the centroid is taken
GRID_STEPS = np.arange(-GRID, GRID + 1)
CENTROID_POINTS = (
    GRID_REACH / GRID * np.array([[a, b] for a in GRID_STEPS for b in GRID_STEPS if abs(a + b) <= GRID])
)


@compiled
def locate_white_cell(image, center_px, cell, white_mm, to_mm, center_mm, inks, black):  # type: ignore[no-untyped-def]
    """(2,) px the middle of the white cell, where these numbers put it; NaN where it is not.

    Args:
        cell: (N,) the layout's cell of each cell of the image, or -1.
        white_mm: (2,) the middle of the white cell. to_mm: (2, 2) mm per axial step there.
        inks: (4, 3) the colors of red, green and blue from row 1 on. black: (3,) the color between them.
    """
    where, slope = _fit_layout_map(center_px, cell, white_mm, to_mm, center_mm)
    if np.isnan(where[0]):
        return where
    axial = np.empty((2, 2))
    for row in range(2):
        for column in range(2):
            axial[row, column] = slope[row, 0] * to_mm[0, column] + slope[row, 1] * to_mm[1, column]
    return _verified_center(image, where, axial, inks, black)


@compiled
def _nearest_numbered_cells(cell, white_mm, center_mm):  # type: ignore[no-untyped-def]
    """The numbered cells whose places in the layout are the nearest to the white one, and their squared distances."""
    near, square, found = np.empty(MAX_FIT_CELLS, np.int64), np.empty(MAX_FIT_CELLS), 0
    for i in range(cell.shape[0]):
        if cell[i] < 0:
            continue
        x, y = center_mm[cell[i], 0] - white_mm[0], center_mm[cell[i], 1] - white_mm[1]
        apart, k = x * x + y * y, min(found, MAX_FIT_CELLS - 1)
        if found == MAX_FIT_CELLS and apart >= square[k]:
            continue
        while k > 0 and square[k - 1] > apart:
            near[k], square[k] = near[k - 1], square[k - 1]
            k -= 1
        near[k], square[k] = i, apart
        found = min(found + 1, MAX_FIT_CELLS)
    return near[:found], square[:found]


@compiled
def _fit_layout_map(center_px, cell, white_mm, to_mm, center_mm):  # type: ignore[no-untyped-def]
    """Where the map of the layout to the image through the cells nearest to the white one puts that, (2,) px, NaN where
    that is doubtful; and (2, 2) px per mm there."""
    near, squares = _nearest_numbered_cells(cell, white_mm, center_mm)
    nowhere = np.full(2, np.nan), np.full((2, 2), np.nan)
    count = near.shape[0]
    if count < MIN_FIT_CELLS:
        return nowhere
    scale = np.sqrt(squares.mean())
    rows, weight = np.empty((count, TERMS)), np.empty(count)
    normal, right = np.zeros((TERMS, TERMS)), np.zeros((3, TERMS))
    right[2, 0] = 1.0
    about_x, about_y = center_px[near[0], 0], center_px[near[0], 1]
    for k in range(count):
        i, u = near[k], cell[near[k]]
        x, y = (center_mm[u, 0] - white_mm[0]) / scale, (center_mm[u, 1] - white_mm[1]) / scale
        rows[k, 0], rows[k, 1], rows[k, 2] = 1.0, x, y
        rows[k, 3], rows[k, 4], rows[k, 5] = x * x, x * y, y * y
        weight[k] = 1.0 / (0.3 + x * x + y * y)
        for a in range(TERMS):
            moment = weight[k] * rows[k, a]
            right[0, a] += moment * (center_px[i, 0] - about_x)
            right[1, a] += moment * (center_px[i, 1] - about_y)
            for b in range(a + 1):
                normal[a, b] += moment * rows[k, b]
    total = weight.sum()
    for a in range(3, TERMS):
        normal[a, a] += RIDGE * total
    update_to_cholesky_solution(normal, right, TERMS)
    if not normal[2, 2] ** 2 > 1e-4 * total:
        return nowhere
    left = 0.0
    for k in range(count):
        u, v = center_px[near[k], 0] - about_x, center_px[near[k], 1] - about_y
        for a in range(TERMS):
            u -= rows[k, a] * right[0, a]
            v -= rows[k, a] * right[1, a]
        left += weight[k] * (u * u + v * v)
    slope = right[:2, 1:3] / scale
    determinant = (slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]) * (
        to_mm[0, 0] * to_mm[1, 1] - to_mm[0, 1] * to_mm[1, 0]
    )
    edge2 = abs(determinant) * 2.0 / np.sqrt(3.0)
    if not left / (2.0 * total) * (1.0 + right[2, 0] * total / count) < MAX_PREDICTED_DEVIATION**2 * edge2:
        return nowhere
    return np.array([about_x + right[0, 0], about_y + right[1, 0]]), slope


@compiled
def _whiteness(color, strongest):  # type: ignore[no-untyped-def]
    """The weakest channel of a color, against the strongest of all inks."""
    return min(color[0] / strongest[0], color[1] / strongest[1], color[2] / strongest[2])


@compiled
def _verified_center(image, where, slope, inks, black):  # type: ignore[no-untyped-def]
    """(2,) px the centroid of the white cell expected here, (2, 2) px per axial step; NaN where there is none."""
    strongest, nowhere = np.ones(3), np.full(2, np.nan)
    for channel in range(3):
        strongest[channel] = max(inks[:, channel].max(), 1.0)
    ground = _whiteness(black, strongest)  # of black, or of the palest ink
    for c in range(1, 4):
        ground = max(ground, _whiteness(inks[c], strongest))
    # the centroid tells where it is better than the map does, unless something white stands beside it
    if _is_white_triangle(image, where, slope, ground, strongest) and _is_between_inks(
        image, where, slope, inks, black
    ):
        return where.copy()
    u, v = _white_centroid(image, where, slope, ground, strongest)
    if not u * u + u * v + v * v <= MAX_CENTROID_DISTANCE**2:
        return nowhere
    middle = where + slope @ np.array([u, v])
    if _is_white_triangle(image, middle, slope, ground, strongest) and _is_between_inks(
        image, middle, slope, inks, black
    ):
        return middle
    return nowhere


@compiled
def _image_point(middle, slope, u, v):  # type: ignore[no-untyped-def]
    """The place in the image this axial way from the middle."""
    return middle[0] + slope[0, 0] * u + slope[0, 1] * v, middle[1] + slope[1, 0] * u + slope[1, 1] * v


@compiled
def _sample_radius(slope):  # type: ignore[no-untyped-def]
    """Over which a color is taken, px."""
    return 0.1 * np.sqrt(abs(slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]))


@compiled
def _fill_mean_color(image, middle, slope, u, v, out):  # type: ignore[no-untyped-def]
    """Write the mean color around this axial way from the middle; False outside the image."""
    px, py = _image_point(middle, slope, u, v)
    return fill_patch_mean(
        image.reshape(-1), image.shape[0], image.shape[1], px, py, _sample_radius(slope), out
    )


@compiled
def _white_centroid(image, where, slope, ground, strongest):  # type: ignore[no-untyped-def]
    """The axial way to the centroid of what is whiter than the ground; NaN where nothing is."""
    room, radius = allocate_sample_buffers(), _sample_radius(slope)
    patches = room.patches
    for n in range(CENTROID_POINTS.shape[0]):
        patches[X + n], patches[Y + n] = _image_point(
            where, slope, CENTROID_POINTS[n, 0], CENTROID_POINTS[n, 1]
        )
        patches[RADIUS + n] = radius
    fill_patch_means(image.reshape(-1), image.shape[0], image.shape[1], CENTROID_POINTS.shape[0], room)
    total, q, r, own = 0.0, 0.0, 0.0, np.empty(3)
    for n in range(CENTROID_POINTS.shape[0]):
        if patches[INSIDE_IMAGE + n] > 0.0:
            for channel in range(3):
                own[channel] = patches[COLOR + channel * BATCH_POINTS + n]
            weight = max(_whiteness(own, strongest) - ground, 0.0)
            total, q, r = (
                total + weight,
                q + weight * CENTROID_POINTS[n, 0],
                r + weight * CENTROID_POINTS[n, 1],
            )
    return (q / total, r / total) if total > 0.0 else (np.nan, np.nan)


@compiled
def _is_white_triangle(image, middle, slope, ground, strongest):  # type: ignore[no-untyped-def]
    """Whether it is white all over the cell and nowhere around it; outside the image nothing is."""
    own = np.empty(3)
    if not _fill_mean_color(image, middle, slope, 0.0, 0.0, own):
        return False
    reach = max(_whiteness(own, strongest) - ground, 1e-3)
    for n in range(INSIDE_POINTS.shape[0]):
        if not _fill_mean_color(image, middle, slope, INSIDE_POINTS[n, 0], INSIDE_POINTS[n, 1], own):
            return False
        least = MIN_CORNER if n < CORNERS.shape[0] else MIN_INSIDE
        if _whiteness(own, strongest) - ground < least * reach:
            return False
    for n in range(OUTSIDE_POINTS.shape[0]):
        seen = _fill_mean_color(image, middle, slope, OUTSIDE_POINTS[n, 0], OUTSIDE_POINTS[n, 1], own)
        if seen and _whiteness(own, strongest) - ground > MAX_OUTSIDE * reach:
            return False
    return True


@compiled
def _is_between_inks(image, middle, slope, inks, black):  # type: ignore[no-untyped-def]
    """Whether the three cells beside it show their inks, or black where one is missing."""
    own = np.empty(3)
    for k in range(3):
        if not _fill_mean_color(image, middle, slope, -CORNERS[k, 0], -CORNERS[k, 1], own):
            continue
        ink = inks[OPPOSITE_INKS[k]] - black
        own -= black
        strength, size = dot3(ink, ink), np.sqrt(dot3(own, own))
        if size > MIN_INK_STRENGTH * np.sqrt(strength) and dot3(own, ink) < MIN_INK_COSINE * size * np.sqrt(
            strength
        ):
            return False
    return True
