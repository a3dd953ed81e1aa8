"""Where the edges of triangles lie: those of many triangles at once, each a lane of loops without branches.

The ink's profile across an edge, 1 inside and 0 outside, is integrated: its area is the edge's position whatever the
blur, so no blur has to be known. The line through two such positions is the edge. Profiles run along the median, not
the normal: so they stay clear of the other edges in any triangle.
"""

from __future__ import annotations

import numpy as np

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

FIRST_PROFILE = 0.25  # of an edge, where its first profile crosses it; the second does as far from its end
HALF_PROFILE = 4  # samples on each side of an edge
BORDER_MARGIN_PX = (
    0.01  # px, that profiles stay away from the last row and column, more than half a step of a sample
)
PROFILE_REACH = 0.8  # reach of a profile in units of the way from the cell's center to the middle of the edge
FINE_REACH_PX = 8.0  # profiles that reach farther are followed by narrower ones,
MAX_PASSES = 3  # so often at most
MIN_DEPTH_PX = 0.3  # of an edge, from the cell's center
MIN_CONTRAST = 12.0  # of an ink against what lies beyond its edge, over the three channels, 8-bit
MIN_SINE = 0.05  # two edges that meet at less than 3 degrees have no corner
MAX_CORNER_SHIFT = 1.0  # in units of the corner's distance from the center
MIN_PROFILE_LEVEL, MAX_PROFILE_LEVEL = -0.2, 1.2  # between which a profile is held
BATCH_CELLS = BATCH_POINTS // 3  # triangles at once
# Columns of what is known of an edge: its ends, the center of its cell and how far the first corner is from there; the
# reach of profiles; the normal, the edge's distance from the center, the way from there to its middle; the color of
# its ink; what turns a color into a share of ink, and what is taken off; 1 if it can be drawn; where the profiles
# cross it, how they step, and the areas under them; the line n . p = d.
START_X, START_Y, END_X, END_Y, CENTER_X, CENTER_Y, SIZE, REACH = (k * BATCH_POINTS for k in range(8))
NORMAL_X, NORMAL_Y, DEPTH, MEDIAN_X, MEDIAN_Y, INK = (k * BATCH_POINTS for k in range(8, 14))
WEIGHT, BACKGROUND, VALID = (k * BATCH_POINTS for k in (16, 19, 20))
FIRST_X, FIRST_Y, SECOND_X, SECOND_Y, STEP_X, STEP_Y = (k * BATCH_POINTS for k in range(21, 27))
AREA, AREA_BEFORE, LINE_X, LINE_Y, LINE_D = (k * BATCH_POINTS for k in range(27, 32))
COLUMNS = 32


@compiled
def update_triangle_corners(image, corners, good):  # type: ignore[no-untyped-def]
    """Move the corners (N, 3, 2) of each ``good`` (N,) triangle to where the lines of its edges meet, in place; what
    has no such edges is good no more.

    The first profiles reach across the cell; where it is large, narrower ones follow until they step by a pixel.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    edges, buffers = np.zeros(COLUMNS * BATCH_POINTS), allocate_sample_buffers()
    left, reach = np.flatnonzero(good), np.full(good.shape[0], PROFILE_REACH)
    for _ in range(MAX_PASSES):
        for first in range(0, left.shape[0], BATCH_CELLS):
            cells = left[first : first + BATCH_CELLS]
            count = 3 * cells.shape[0]
            _fill_edges(corners, cells, reach, edges)
            _fill_normals(edges, count)
            _fill_contrast_weights(flat, height, width, edges, count, buffers)
            _fill_profile_places(height, width, edges, count)
            _fill_profile_areas(flat, height, width, False, edges, count, buffers)
            _fill_profile_areas(flat, height, width, True, edges, count, buffers)
            _fill_edge_lines(edges, count)
            _update_corners(edges, cells, corners, good, reach)
        left = left[reach[left] > 0.0]


@compiled
def _fill_edges(corners, cells, reach, edges):  # type: ignore[no-untyped-def]
    """Lay out the edges of cells: the first one of each, then the second, then the third."""
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
    """Which way the edges lie from the centers."""
    for i in range(count):
        x, y, cx, cy = edges[START_X + i], edges[START_Y + i], edges[CENTER_X + i], edges[CENTER_Y + i]
        dx, dy = edges[END_X + i] - x, edges[END_Y + i] - y
        length = np.sqrt(dx * dx + dy * dy)
        nx, ny = dy / length, -dx / length  # outward: corners run clockwise with y down
        edges[NORMAL_X + i], edges[NORMAL_Y + i] = nx, ny
        edges[DEPTH + i] = (x - cx) * nx + (y - cy) * ny
        edges[MEDIAN_X + i], edges[MEDIAN_Y + i] = x + 0.5 * dx - cx, y + 0.5 * dy - cy


@compiled
def _fill_contrast_weights(flat, height, width, edges, count, buffers):  # type: ignore[no-untyped-def]
    """Compare each cell's ink with the colors beyond its edges."""
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
        fits = (contrast >= MIN_CONTRAST**2) & (edges[DEPTH + i] > MIN_DEPTH_PX)
        edges[VALID + i] *= patches[INSIDE + i] * fits
        contrast = max(contrast, MIN_CONTRAST**2)
        u0, u1, u2 = u0 / contrast, u1 / contrast, u2 / contrast
        edges[WEIGHT + i], edges[WEIGHT + BATCH_POINTS + i], edges[WEIGHT + 2 * BATCH_POINTS + i] = u0, u1, u2
        edges[BACKGROUND + i] = u0 * b0 + u1 * b1 + u2 * b2


@compiled
def _fill_profile_places(height, width, edges, count):  # type: ignore[no-untyped-def]
    """Where the profiles cross the edges; edges are left out where one does not stay in the image."""
    right, bottom = width - 1.0 - BORDER_MARGIN_PX, height - 1.0 - BORDER_MARGIN_PX
    for i in range(count):
        x, y = edges[START_X + i], edges[START_Y + i]
        end_x, end_y = edges[END_X + i], edges[END_Y + i]
        dx, dy = FIRST_PROFILE * (end_x - x), FIRST_PROFILE * (end_y - y)
        x, y, end_x, end_y = x + dx, y + dy, end_x - dx, end_y - dy
        edges[FIRST_X + i], edges[FIRST_Y + i], edges[SECOND_X + i], edges[SECOND_Y + i] = x, y, end_x, end_y
        wide, high = edges[REACH + i] * abs(edges[MEDIAN_X + i]), edges[REACH + i] * abs(edges[MEDIAN_Y + i])
        begins = (min(x, end_x) >= wide) & (min(y, end_y) >= high)
        edges[VALID + i] *= begins & (max(x, end_x) + wide < right) & (max(y, end_y) + high < bottom)


@compiled
def _fill_profile_areas(flat, height, width, second, edges, count, buffers):  # type: ignore[no-untyped-def]
    """Write the areas under the first or second profiles across the edges, in steps, and keep the ones before."""
    points, parts = buffers.fixed_points, buffers.channel_sums
    for i in range(count):
        fits, reach = edges[VALID + i] > 0.0, edges[REACH + i]
        x = reach * edges[MEDIAN_X + i]
        y = reach * edges[MEDIAN_Y + i]
        x, y = (
            (edges[SECOND_X + i] - x, edges[SECOND_Y + i] - y)
            if second
            else (edges[FIRST_X + i] - x, edges[FIRST_Y + i] - y)
        )
        points[X + i], points[Y + i] = (
            fixed_point_coordinate(x if fits else 0.0),
            fixed_point_coordinate(y if fits else 0.0),
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
            f = u0 * parts[BLUE + i] + u1 * parts[GREEN + i] + u2 * parts[RED + i]
            f = f * (1.0 / (SUBPIXEL_STEPS * SUBPIXEL_STEPS)) - edges[BACKGROUND + i]
            edges[AREA + i] += weight * min(max(f, MIN_PROFILE_LEVEL), MAX_PROFILE_LEVEL)
        for i in range(count):
            points[X + i] += fixed_point_length(edges[STEP_X + i])
            points[Y + i] += fixed_point_length(edges[STEP_Y + i])


@compiled
def _fill_edge_lines(edges, count):  # type: ignore[no-untyped-def]
    """The lines through the two places of each edge where its ink has fallen halfway to the color beyond."""
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
def _update_corners(edges, cells, corners, good, reach):  # type: ignore[no-untyped-def]
    """Move the corners of the cells to where their lines meet, and write the ``reach`` (N,) of the next pass, 0 where
    none follows."""
    count, moved = cells.shape[0], np.empty((3, 2))
    for n in range(count):
        i, size = cells[n], edges[SIZE + n]
        fits = edges[VALID + n] * edges[VALID + count + n] * edges[VALID + 2 * count + n] > 0.0
        good[i] = fits and _fill_line_intersections(edges, n, count, MAX_CORNER_SHIFT * size, moved)
        if good[i]:
            for k in range(3):
                corners[i, k, 0], corners[i, k, 1] = moved[k, 0], moved[k, 1]
        ends = not good[i] or reach[i] * size < 2 * FINE_REACH_PX
        reach[i] = 0.0 if ends else max(0.25 * reach[i], 2 * FINE_REACH_PX / size)


@compiled
def _fill_line_intersections(edges, n, count, limit, moved):  # type: ignore[no-untyped-def]
    """Write where the lines of a cell's edges meet, corner by corner; False where one does not or lies beyond the limit
    from where it was."""
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
