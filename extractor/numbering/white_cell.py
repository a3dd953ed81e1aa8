"""Decides whether a bright place is the white cell: white inside, not white outside, and between the right inks.

The numbered cells predict place and size by a quadratic map from the layout to the image. A scratch across a black
cell, a crossing of two scratches, a drop or a reflection fail the test, and so does the white cell one step aside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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

MAX_FIT_CELLS = 16  # numbered cells nearest to the white cell, for its prediction
MIN_FIT_CELLS = 3
RIDGE = 0.02  # regularises the map's curvature where all these cells lie on one side
MAX_PREDICTED_DEVIATION = 0.15  # of the prediction, in edges
MAX_CENTROID_DISTANCE = 0.3  # in edges, from prediction to centroid of the white; the next black cell is at 1
# Limits of whiteness, scaled from 0 for the palest of inks and black to 1 for the middle of the cell.
MIN_INSIDE, MIN_CORNER, MAX_OUTSIDE = 0.5, 0.25, 0.5
MIN_INK_COSINE = 0.9  # between a color and an ink, both minus black
MIN_INK_STRENGTH = 0.3  # of an ink's strength above black; weaker colors count as black, a missing cell
TERMS = 6  # 1, x, y, xx, xy, yy
# The corners of a down-cell relative to its center, in axial steps: below, upper right and upper left.
CORNERS = np.array([[1, -2], [1, 1], [-2, 1]]) / 3
OPPOSITE_INKS = np.array([2, 3, 1])  # of the cells opposite to the corners
# Points in the corners and towards corners and sides; outside points beyond the corners and beyond three points of each
# side.
INSIDE_POINTS = np.concatenate([0.85 * CORNERS, 0.5 * CORNERS, -0.33 * CORNERS])
SIDE_POINTS = [
    one + share * (two - one) for one, two in CORNERS[[[0, 1], [1, 2], [2, 0]]] for share in (0.25, 0.5, 0.75)
]
OUTSIDE_POINTS = np.concatenate(
    [1.7 * CORNERS, np.array(SIDE_POINTS) - 0.25 * CORNERS[[2, 2, 2, 0, 0, 0, 1, 1, 1]]]
)
GRID, GRID_REACH = 4, 0.8  # half width in points and in axial steps of the grid for the centroid
GRID_STEPS = np.arange(-GRID, GRID + 1)
CENTROID_POINTS = (
    GRID_REACH / GRID * np.array([[a, b] for a in GRID_STEPS for b in GRID_STEPS if abs(a + b) <= GRID])
)


class WhiteCellLayout(NamedTuple):
    """The layout as needed for the search of the white cell.

    Attributes:
        layers: number of layers.
        cell_lookup: (S, S) int32, as ``Lattice.cell_lookup``.
        white_mm: (2,) float64, the center of the white cell.
        axial_mm: (2, 2) float64, mm per axial step there.
        center_mm: (U, 2) float64, the centers of the colored cells.
    """

    layers: int
    cell_lookup: NDArray[np.int32]
    white_mm: NDArray[np.float64]
    axial_mm: NDArray[np.float64]
    center_mm: NDArray[np.float64]


@compiled
def locate_white_cell(image, center_px, cell, layout, inks, black):  # type: ignore[no-untyped-def]
    """(2,) px, the center of the white cell where the numbers predict it; NaN if it is not there.

    Args:
        image: (H, W, 3) uint8 BGR; center_px: (N, 2).
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        layout: ``WhiteCellLayout``.
        inks: (4, 3) the colors of red, green and blue in rows 1 to 3. black: (3,) the color between them.
    """
    predicted, slope = _fit_layout_map(center_px, cell, layout)
    if np.isnan(predicted[0]):
        return predicted
    axial, axial_mm = np.empty((2, 2)), layout.axial_mm
    for row in range(2):
        for column in range(2):
            axial[row, column] = slope[row, 0] * axial_mm[0, column] + slope[row, 1] * axial_mm[1, column]
    return _verified_center(image, predicted, axial, inks, black)


@compiled
def _nearest_numbered_cells(cell, white_mm, center_mm):  # type: ignore[no-untyped-def]
    """The numbered cells nearest to the white cell in the layout, and their squared distances, mm^2."""
    nearest, squares, found = np.empty(MAX_FIT_CELLS, np.int64), np.empty(MAX_FIT_CELLS), 0
    for i in range(cell.shape[0]):
        if cell[i] < 0:
            continue
        x, y = center_mm[cell[i], 0] - white_mm[0], center_mm[cell[i], 1] - white_mm[1]
        square, k = x * x + y * y, min(found, MAX_FIT_CELLS - 1)
        if found == MAX_FIT_CELLS and square >= squares[k]:
            continue
        while k > 0 and squares[k - 1] > square:
            nearest[k], squares[k] = nearest[k - 1], squares[k - 1]
            k -= 1
        nearest[k], squares[k] = i, square
        found = min(found + 1, MAX_FIT_CELLS)
    return nearest[:found], squares[:found]


@compiled
def _fit_layout_map(center_px, cell, layout):  # type: ignore[no-untyped-def]
    """Fit a quadratic map from layout to image through the numbered cells nearest to the white cell.

    Returns (2,) px the white cell's predicted center, NaN where the prediction is uncertain; and (2, 2) px per mm
    there.
    """
    white_mm, axial_mm, center_mm = layout.white_mm, layout.axial_mm, layout.center_mm
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
    residual = 0.0
    for k in range(count):
        u, v = center_px[near[k], 0] - about_x, center_px[near[k], 1] - about_y
        for a in range(TERMS):
            u -= rows[k, a] * right[0, a]
            v -= rows[k, a] * right[1, a]
        residual += weight[k] * (u * u + v * v)
    slope = right[:2, 1:3] / scale
    determinant = (slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]) * (
        axial_mm[0, 0] * axial_mm[1, 1] - axial_mm[0, 1] * axial_mm[1, 0]
    )
    edge2 = abs(determinant) * 2.0 / np.sqrt(3.0)
    variance = residual / (2.0 * total) * (1.0 + right[2, 0] * total / count)
    if not variance < MAX_PREDICTED_DEVIATION**2 * edge2:
        return nowhere
    return np.array([about_x + right[0, 0], about_y + right[1, 0]]), slope


@compiled
def _whiteness(color, strongest):  # type: ignore[no-untyped-def]
    """The weakest channel of a color, relative to the inks' maximum of that channel."""
    return min(color[0] / strongest[0], color[1] / strongest[1], color[2] / strongest[2])


@compiled
def _verified_center(image, predicted, slope, inks, black):  # type: ignore[no-untyped-def]
    """(2,) px, the center of the white cell; NaN if it is not at its predicted center.

    ``slope`` is (2, 2), px per axial step.
    """
    strongest, nowhere = np.ones(3), np.full(2, np.nan)
    for channel in range(3):
        strongest[channel] = max(inks[:, channel].max(), 1.0)
    ground = _whiteness(black, strongest)  # of black, or of the palest ink
    for c in range(1, 4):
        ground = max(ground, _whiteness(inks[c], strongest))
    if _is_white_triangle(image, predicted, slope, ground, strongest) and _is_between_inks(
        image, predicted, slope, inks, black
    ):
        return predicted.copy()
    # the centroid is more accurate than the map, unless something white is next to the cell
    u, v = _white_centroid(image, predicted, slope, ground, strongest)
    if not u * u + u * v + v * v <= MAX_CENTROID_DISTANCE**2:
        return nowhere
    middle = predicted + slope @ np.array([u, v])
    if _is_white_triangle(image, middle, slope, ground, strongest) and _is_between_inks(
        image, middle, slope, inks, black
    ):
        return middle
    return nowhere


@compiled
def _image_point(middle, slope, u, v):  # type: ignore[no-untyped-def]
    """The point of the image at the axial vector (u, v) from the middle."""
    return middle[0] + slope[0, 0] * u + slope[0, 1] * v, middle[1] + slope[1, 0] * u + slope[1, 1] * v


@compiled
def _sample_radius(slope):  # type: ignore[no-untyped-def]
    """The radius of a color sample, px."""
    return 0.1 * np.sqrt(abs(slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]))


@compiled
def _fill_mean_color(image, middle, slope, u, v, out):  # type: ignore[no-untyped-def]
    """Write the mean color (3,) at the axial vector (u, v) from the middle; False outside the image."""
    px, py = _image_point(middle, slope, u, v)
    return fill_patch_mean(
        image.reshape(-1), image.shape[0], image.shape[1], px, py, _sample_radius(slope), out
    )


@compiled
def _white_centroid(image, predicted, slope, ground, strongest):  # type: ignore[no-untyped-def]
    """The axial vector to the centroid of the whiteness above ``ground``; NaN where nothing is whiter."""
    buffers, radius = allocate_sample_buffers(), _sample_radius(slope)
    patches = buffers.patches
    for n in range(CENTROID_POINTS.shape[0]):
        patches[X + n], patches[Y + n] = _image_point(
            predicted, slope, CENTROID_POINTS[n, 0], CENTROID_POINTS[n, 1]
        )
        patches[RADIUS + n] = radius
    fill_patch_means(image.reshape(-1), image.shape[0], image.shape[1], CENTROID_POINTS.shape[0], buffers)
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
    """Whether the cell is white inside and nowhere outside; no point outside the image is white."""
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
        is_inside = _fill_mean_color(image, middle, slope, OUTSIDE_POINTS[n, 0], OUTSIDE_POINTS[n, 1], own)
        if is_inside and _whiteness(own, strongest) - ground > MAX_OUTSIDE * reach:
            return False
    return True


@compiled
def _is_between_inks(image, middle, slope, inks, black):  # type: ignore[no-untyped-def]
    """Whether the three adjacent cells show their inks, or black where a cell is missing."""
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
