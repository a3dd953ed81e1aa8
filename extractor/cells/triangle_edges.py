"""Measures the edges of triangles with sub-pixel accuracy, of many triangles together in branch-free loops.

The profile of the ink's light across an edge, 1 inside and 0 outside, is integrated: its area gives the edge's position
for any blur, so that the blur need not be known. The edge is the line through two such positions. Profiles run along
the median, not the normal, so that they avoid the other edges in any triangle.
"""

from __future__ import annotations

import numpy as np

from extractor.image.response import light_at
from extractor.numeric.bilinear import SUBPIXEL_STEPS
from extractor.numeric.bilinear_batch import (
    BATCH_POINTS,
    BLUE,
    COLOR,
    GREEN,
    INSIDE,
    RADIUS,
    RED,
    X,
    Y,
    allocate_sample_buffers,
    fill_patch_means,
    fill_point_samples,
    fixed_point_coordinate,
    fixed_point_length,
)
from extractor.numeric.compilation import compiled

FIRST_PROFILE = 0.25  # of an edge, from its start to the first profile, and from the second one to its end
HALF_PROFILE = 4  # samples on each side of an edge
BORDER_MARGIN_PX = 0.01  # from profiles to the last row and column; more than half a sub-pixel step
PROFILE_REACH = 0.5  # half length of a profile, in vectors from the cell's center to the edge's middle
FINE_REACH_PX = 8.0  # longer profiles are followed by shorter ones,
MAX_PASSES = 3  # in so many passes at most
MIN_DEPTH_PX = 0.3  # distance of an edge from the cell's center
MIN_CONTRAST = 12.0  # norm over the three 8-bit channels, between the ink and the color outside the edge
MIN_SINE = 0.05  # two edges that meet at less than 3 degrees have no corner
MAX_CORNER_SHIFT = 1.0  # in units of the corner's distance from the center
MIN_PROFILE_LEVEL, MAX_PROFILE_LEVEL = -0.2, 1.2  # to which a profile is limited
SMALLEST = 1e-9  # of a squared contrast, to divide by
BATCH_CELLS = BATCH_POINTS // 3  # triangles measured together
# Columns of the edges' table: the ends; the cell's center and the distance of its first corner from the center; the
# profiles' reach; the normal, the edge's distance from the center and the vector from the center to its middle; the
# ink's color; the weights that turn a color into a share of ink, and the background's weighted color; 1 if the edge is
# valid; the profiles' middles, their step, and the areas under them; the line n . p = d.
START_X, START_Y, END_X, END_Y, CENTER_X, CENTER_Y, SIZE, REACH = (k * BATCH_POINTS for k in range(8))
NORMAL_X, NORMAL_Y, DEPTH, MEDIAN_X, MEDIAN_Y, INK = (k * BATCH_POINTS for k in range(8, 14))
WEIGHT, BACKGROUND, VALID = (k * BATCH_POINTS for k in (16, 19, 20))
FIRST_X, FIRST_Y, SECOND_X, SECOND_Y, STEP_X, STEP_Y = (k * BATCH_POINTS for k in range(21, 27))
AREA, AREA_BEFORE, LINE_X, LINE_Y, LINE_D = (k * BATCH_POINTS for k in range(27, 32))
COLUMNS = 32


@compiled
def update_triangle_corners(view, corners, good):  # type: ignore[no-untyped-def]
    """Move the corners of triangles to the intersections of their measured edges.

    The first profiles reach across the cell; for large cells shorter ones follow, down to ``FINE_REACH_PX``.

    Args:
        view: ``PyramidLevel``.
        corners: (N, 3, 2) float64 px, clockwise in the image, updated.
        good: (N,) bool, the triangles to measure; set to False for those without valid edges.
    """
    flat, height, width = view.image.reshape(-1), view.image.shape[0], view.image.shape[1]
    light = view.response.light
    edges, buffers = np.zeros(COLUMNS * BATCH_POINTS), allocate_sample_buffers()
    left, reach = np.flatnonzero(good), np.full(good.shape[0], PROFILE_REACH)
    for number in range(MAX_PASSES):
        for begin in range(0, left.shape[0], BATCH_CELLS):
            cells = left[begin : begin + BATCH_CELLS]
            count = 3 * cells.shape[0]
            _fill_edges(corners, cells, reach, edges)
            _fill_normals(edges, count)
            _fill_contrast_weights(flat, light, height, width, edges, count, buffers)
            _fill_profile_places(height, width, edges, count)
            _fill_profile_areas(flat, light, height, width, False, edges, count, buffers)
            _fill_profile_areas(flat, light, height, width, True, edges, count, buffers)
            _fill_edge_lines(edges, count)
            _update_corners(edges, cells, corners, good, reach, number == 0)
        left = left[reach[left] > 0.0]


@compiled
def _fill_edges(corners, cells, reach, edges):  # type: ignore[no-untyped-def]
    """Write the ends, centers, sizes and reaches: the first edge of each cell, then the second, then the third."""
    count = cells.shape[0]
    for n in range(count):
        i = cells[n]
        x = (corners[i, 0, 0] + corners[i, 1, 0] + corners[i, 2, 0]) / 3
        y = (corners[i, 0, 1] + corners[i, 1, 1] + corners[i, 2, 1]) / 3
        size = np.sqrt((corners[i, 0, 0] - x) ** 2 + (corners[i, 0, 1] - y) ** 2)
        for k in range(3):
            to, end = k * count + n, (k + 1) % 3
            edges[START_X + to], edges[START_Y + to] = corners[i, k, 0], corners[i, k, 1]
            edges[END_X + to], edges[END_Y + to] = corners[i, end, 0], corners[i, end, 1]
            edges[CENTER_X + to], edges[CENTER_Y + to] = x, y
            edges[SIZE + to], edges[REACH + to] = size, reach[i]


@compiled
def _fill_normals(edges, count):  # type: ignore[no-untyped-def]
    """Write the outward normals, the distances and the middles of the edges, relative to the centers."""
    for i in range(count):
        x, y, cx, cy = edges[START_X + i], edges[START_Y + i], edges[CENTER_X + i], edges[CENTER_Y + i]
        dx, dy = edges[END_X + i] - x, edges[END_Y + i] - y
        length = np.sqrt(dx * dx + dy * dy)
        nx, ny = dy / length, -dx / length  # outward: corners run clockwise with y down
        edges[NORMAL_X + i], edges[NORMAL_Y + i] = nx, ny
        edges[DEPTH + i] = (x - cx) * nx + (y - cy) * ny
        edges[MEDIAN_X + i], edges[MEDIAN_Y + i] = x + 0.5 * dx - cx, y + 0.5 * dy - cy


@compiled
def _fill_contrast_weights(flat, light, height, width, edges, count, buffers):  # type: ignore[no-untyped-def]
    """Write the weights that separate each cell's ink from the color outside each edge, and the edges' validity."""
    patches, cells = buffers.patches, count // 3
    for i in range(cells):
        patches[X + i], patches[Y + i] = edges[CENTER_X + i], edges[CENTER_Y + i]
        patches[RADIUS + i] = 0.2 * edges[SIZE + i]
    fill_patch_means(flat, height, width, cells, buffers)
    for k in range(3):
        for i in range(cells):
            edges[VALID + k * cells + i] = patches[INSIDE + i]
            for channel in range(0, 3 * BATCH_POINTS, BATCH_POINTS):
                edges[INK + channel + k * cells + i] = patches[COLOR + channel + i]
    for i in range(count):
        patches[X + i] = edges[CENTER_X + i] + 2 * edges[MEDIAN_X + i]
        patches[Y + i] = edges[CENTER_Y + i] + 2 * edges[MEDIAN_Y + i]
        patches[RADIUS + i] = 0.4 * edges[DEPTH + i]
    fill_patch_means(flat, height, width, count, buffers)
    for i in range(count):
        b0, b1 = patches[COLOR + i], patches[COLOR + BATCH_POINTS + i]
        b2 = patches[COLOR + 2 * BATCH_POINTS + i]
        u0, u1, u2 = (
            edges[INK + i] - b0,
            edges[INK + BATCH_POINTS + i] - b1,
            edges[INK + 2 * BATCH_POINTS + i] - b2,
        )
        contrast = u0 * u0 + u1 * u1 + u2 * u2
        is_valid = (contrast >= MIN_CONTRAST**2) & (edges[DEPTH + i] > MIN_DEPTH_PX)
        edges[VALID + i] *= patches[INSIDE + i] * is_valid
        b0, b1, b2 = light_at(light, b0), light_at(light, b1), light_at(light, b2)
        u0 = light_at(light, edges[INK + i]) - b0
        u1 = light_at(light, edges[INK + BATCH_POINTS + i]) - b1
        u2 = light_at(light, edges[INK + 2 * BATCH_POINTS + i]) - b2
        contrast = max(u0 * u0 + u1 * u1 + u2 * u2, SMALLEST)
        u0, u1, u2 = u0 / contrast, u1 / contrast, u2 / contrast
        edges[WEIGHT + i], edges[WEIGHT + BATCH_POINTS + i], edges[WEIGHT + 2 * BATCH_POINTS + i] = u0, u1, u2
        edges[BACKGROUND + i] = u0 * b0 + u1 * b1 + u2 * b2


@compiled
def _fill_profile_places(height, width, edges, count):  # type: ignore[no-untyped-def]
    """Write the profiles' middles; edges with a profile that leaves the image become invalid."""
    right, bottom = width - 1.0 - BORDER_MARGIN_PX, height - 1.0 - BORDER_MARGIN_PX
    for i in range(count):
        x, y = edges[START_X + i], edges[START_Y + i]
        end_x, end_y = edges[END_X + i], edges[END_Y + i]
        dx, dy = FIRST_PROFILE * (end_x - x), FIRST_PROFILE * (end_y - y)
        x, y, end_x, end_y = x + dx, y + dy, end_x - dx, end_y - dy
        edges[FIRST_X + i], edges[FIRST_Y + i], edges[SECOND_X + i], edges[SECOND_Y + i] = x, y, end_x, end_y
        wide, high = edges[REACH + i] * abs(edges[MEDIAN_X + i]), edges[REACH + i] * abs(edges[MEDIAN_Y + i])
        is_inside = (min(x, end_x) >= wide) & (min(y, end_y) >= high)
        edges[VALID + i] *= is_inside & (max(x, end_x) + wide < right) & (max(y, end_y) + high < bottom)


@compiled
def _fill_profile_areas(flat, light, height, width, second, edges, count, buffers):  # type: ignore[no-untyped-def]
    """Write the areas under the first or ``second`` profiles, in steps, and keep the ones before in ``AREA_BEFORE``."""
    points, parts = buffers.fixed_points, buffers.channel_sums
    share = np.float32(1.0 / (SUBPIXEL_STEPS * SUBPIXEL_STEPS))
    for i in range(count):
        is_valid, reach = edges[VALID + i] > 0.0, edges[REACH + i]
        x = reach * edges[MEDIAN_X + i]
        y = reach * edges[MEDIAN_Y + i]
        x, y = (
            (edges[SECOND_X + i] - x, edges[SECOND_Y + i] - y)
            if second
            else (edges[FIRST_X + i] - x, edges[FIRST_Y + i] - y)
        )
        points[X + i], points[Y + i] = (
            fixed_point_coordinate(x if is_valid else 0.0),
            fixed_point_coordinate(y if is_valid else 0.0),
        )
    for i in range(count):
        step = edges[REACH + i] / HALF_PROFILE if edges[VALID + i] > 0.0 else 0.0
        edges[STEP_X + i], edges[STEP_Y + i] = step * edges[MEDIAN_X + i], step * edges[MEDIAN_Y + i]
        edges[AREA_BEFORE + i], edges[AREA + i] = edges[AREA + i], 0.0
    for m in range(2 * HALF_PROFILE + 1):
        weight = 0.5 if m == 0 or m == 2 * HALF_PROFILE else 1.0
        fill_point_samples(flat, height, width, count, buffers)
        for i in range(count):
            u0, u1, u2 = (
                edges[WEIGHT + i],
                edges[WEIGHT + BATCH_POINTS + i],
                edges[WEIGHT + 2 * BATCH_POINTS + i],
            )
            f = u0 * light_at(light, share * parts[BLUE + i]) + u1 * light_at(light, share * parts[GREEN + i])
            f += u2 * light_at(light, share * parts[RED + i]) - edges[BACKGROUND + i]
            edges[AREA + i] += weight * min(max(f, MIN_PROFILE_LEVEL), MAX_PROFILE_LEVEL)
        for i in range(count):
            points[X + i] += fixed_point_length(edges[STEP_X + i])
            points[Y + i] += fixed_point_length(edges[STEP_Y + i])


@compiled
def _fill_edge_lines(edges, count):  # type: ignore[no-untyped-def]
    """Write the lines through the two positions of each edge at which the ink falls to half."""
    for i in range(count):
        depth, reach = edges[DEPTH + i], edges[REACH + i]
        step = reach / HALF_PROFILE
        first = depth * (edges[AREA_BEFORE + i] * step - reach)
        second = depth * (edges[AREA + i] * step - reach)
        slope = (second - first) / (1.0 - 2 * FIRST_PROFILE)
        off_a, off_b = first - FIRST_PROFILE * slope, second + FIRST_PROFILE * slope
        nx, ny = edges[NORMAL_X + i], edges[NORMAL_Y + i]
        ax, ay = edges[START_X + i] + off_a * nx, edges[START_Y + i] + off_a * ny
        dx, dy = edges[END_X + i] + off_b * nx - ax, edges[END_Y + i] + off_b * ny - ay
        norm = np.sqrt(dx * dx + dy * dy)
        edges[LINE_X + i], edges[LINE_Y + i] = dy / norm, -dx / norm
        edges[LINE_D + i] = edges[LINE_X + i] * ax + edges[LINE_Y + i] * ay


@compiled
def _update_corners(edges, cells, corners, good, reach, first):  # type: ignore[no-untyped-def]
    """Move the cells' corners to the lines' intersections, and write the next pass's ``reach`` (N,), 0 for none.

    A second pass always follows the ``first`` one: the values of blurred light make cells look too large at the start.
    """
    count, moved = cells.shape[0], np.empty((3, 2))
    for n in range(count):
        i, size = cells[n], edges[SIZE + n]
        is_valid = edges[VALID + n] * edges[VALID + count + n] * edges[VALID + 2 * count + n] > 0.0
        good[i] = is_valid and _fill_line_intersections(edges, n, count, MAX_CORNER_SHIFT * size, moved)
        if good[i]:
            for k in range(3):
                corners[i, k, 0], corners[i, k, 1] = moved[k, 0], moved[k, 1]
        is_done = not good[i] or (not first and reach[i] * size < 2 * FINE_REACH_PX)
        reach[i] = 0.0 if is_done else min(max(0.25 * reach[i], 2 * FINE_REACH_PX / size), reach[i])


@compiled
def _fill_line_intersections(edges, n, count, limit, moved):  # type: ignore[no-untyped-def]
    """Write the intersections ``moved`` (3, 2) of the lines of cell n.

    Returns False if two lines are parallel or a corner moves by ``limit`` px or more.
    """
    for k in range(3):
        here, before = k * count + n, (k + 2) % 3 * count + n
        ax, ay, a = edges[LINE_X + before], edges[LINE_Y + before], edges[LINE_D + before]
        bx, by, b = edges[LINE_X + here], edges[LINE_Y + here], edges[LINE_D + here]
        sine = ax * by - ay * bx
        if not abs(sine) >= MIN_SINE:
            return False
        moved[k, 0], moved[k, 1] = (a * by - ay * b) / sine, (ax * b - a * bx) / sine
        dx, dy = moved[k, 0] - edges[START_X + here], moved[k, 1] - edges[START_Y + here]
        if not dx * dx + dy * dy < limit * limit:
            return False
    return True
