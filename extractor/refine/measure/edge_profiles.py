"""Edge profiles: the colors across each gridline as a profile from 1 to 0, and the blur of that profile.

Profiles are read between the corners of a gridline only (``matched_filter``). They are fast, and safe from a start
that is a pixel off.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined
from extractor.refine.measure.matched_filter import HEIGHT, MAX_REACH, SINE_A, SINE_B, SQUARED_CONTRAST
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, sagitta

BLUR_SAMPLES = 8  # on each side of a gridline
MIN_CONTRAST = 12.0  # gray levels
MAX_REACH_SHARE = (
    0.45  # of the distance to the next gridline, the reach of a blur profile; 0.41 in a regular cell
)
MIN_BLUR_GRIDLINES = 12
# Wide blur mixes the neighbours' inks into the middles that the contrasts are taken from, which makes profiles look too
# steep: the apparent and the true blur, in units of the cell's height (rendered honeycombs).
APPARENT_BLUR = np.array([0.0, 0.092, 0.112, 0.128, 0.137, 0.149, 0.154])
TRUE_BLUR = np.array([0.000, 0.093, 0.117, 0.140, 0.160, 0.195, 0.225])
BILINEAR_PX2 = 1.0 / 6.0  # mean variance that bilinear sampling adds to the blur
CLEARANCE_COLUMNS = 4  # ``HEIGHT``, ``SINE_A``, ``SINE_B``, ``SQUARED_CONTRAST``


@compiled
def gridline_clearance(lines, contrasts, xy, cells, edge_cells):  # type: ignore[no-untyped-def]
    """The space around each gridline.

    Args:
        lines: (E, 8), as ``gridlines`` gives them. contrasts: (E, 3) gray levels, of the values on both sides.
        xy: (M, 2) px, the markers. cells: (K, 3) marker ids. edge_cells: (E, 2) cells on both sides, -1 for none.

    Returns:
        (E, 4) px, the height of the lower cell beside the gridline; the sines of the smallest angles at its start and
        end; gray levels^2, the squared contrast. All 0 where the contrast is low.
    """
    clearance = np.zeros((lines.shape[0], CLEARANCE_COLUMNS))
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength < MIN_CONTRAST**2:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0 = lines[e, X], lines[e, Y]
        height, at_a, at_b = length, 1.0, 1.0
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            off, along = 0.0, 0.0
            for corner in range(3):
                dx, dy = xy[cells[i, corner], 0] - x0, xy[cells[i, corner], 1] - y0
                if abs(dy * ux - dx * uy) > abs(off):
                    off, along = dy * ux - dx * uy, dx * ux + dy * uy
            off = abs(off)
            height = min(height, off)
            if along > 0.0:
                at_a = min(at_a, off / np.sqrt(off * off + along * along))
            if along < length:
                at_b = min(at_b, off / np.sqrt(off * off + (length - along) ** 2))
        clearance[e, HEIGHT], clearance[e, SQUARED_CONTRAST] = height, strength
        clearance[e, SINE_A], clearance[e, SINE_B] = max(at_a, 0.05), max(at_b, 0.05)
    return clearance


@compiled
def _isolated_gridlines(lines, clearance):  # type: ignore[no-untyped-def]
    """The gridlines with a contrast whose middles are clear of other gridlines, and True; where these are few, all
    gridlines with a contrast, and False."""
    isolated, all_of_them = np.empty(lines.shape[0], np.int64), np.empty(lines.shape[0], np.int64)
    isolated_count, count = 0, 0
    for e in range(lines.shape[0]):
        if clearance[e, SQUARED_CONTRAST] == 0.0:
            continue
        sine = min(clearance[e, SINE_A], clearance[e, SINE_B])
        distance = 0.4 * lines[e, LENGTH] * sine / np.sqrt(max(1.0 - sine * sine, 1e-9))
        if MAX_REACH * clearance[e, HEIGHT] < MAX_REACH_SHARE * distance:
            isolated[isolated_count] = e
            isolated_count += 1
        all_of_them[count] = e
        count += 1
    if isolated_count >= MIN_BLUR_GRIDLINES:
        return isolated[:isolated_count], True
    return all_of_them[:count], False


@inlined
def _light_sample(image, light, x, y, weights):  # type: ignore[no-untyped-def]
    """The light at (x, y), interpolated between four pixels, the channels multiplied by the ``weights``
    (three numbers); NaN outside the image (H, W, 3)."""
    height, width = image.shape[0], image.shape[1]
    if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
        return np.nan
    ix, iy = min(int(x), width - 2), min(int(y), height - 2)
    total = 0.0
    for dy in range(2):
        for dx in range(2):
            share = (1.0 - abs(x - ix - dx)) * (1.0 - abs(y - iy - dy))
            for channel in range(3):
                total += share * weights[channel] * light[image[iy + dy, ix + dx, channel]]
    return total


@compiled
def profile_blur(view, lines, across, most):  # type: ignore[no-untyped-def]
    """The median blur across the middles of some gridlines.

    The integral of f (1 - f) over a profile f of the light is sigma / sqrt(pi). Bilinear samples add to the integral,
    and so does another gridline near the profile: where too few gridlines are isolated, the lower quartile of all is
    taken.

    Args:
        view: ``PyramidLevel``. lines: (E, 8). across: ``EdgeContrasts``.
        most: gridlines to read, about.

    Returns:
        px, sigma; NaN where no gridline can be read.
    """
    image, light, sides, clearance = view.image, view.response.light, across.sides, across.clearance
    which, are_isolated = _isolated_gridlines(lines, clearance)
    every = max(which.shape[0] // most, 1)
    blurs, count = np.empty(which.shape[0] // every + 1), 0
    for e in which[::every]:
        u0, u1, u2 = sides[e, 0] - sides[e, 3], sides[e, 1] - sides[e, 4], sides[e, 2] - sides[e, 5]
        strength = u0 * u0 + u1 * u1 + u2 * u2
        u0, u1, u2 = u0 / strength, u1 / strength, u2 / strength
        foot = u0 * sides[e, 3] + u1 * sides[e, 4] + u2 * sides[e, 5]
        nx, ny, length = -lines[e, UY], lines[e, UX], lines[e, LENGTH]
        step = MAX_REACH * clearance[e, HEIGHT] / BLUR_SAMPLES
        total = 0.0
        for k in range(3):
            t = 0.4 + 0.1 * k
            off = sagitta(t, length, lines[e, LEAVE], lines[e, ARRIVE])
            x = lines[e, X] + t * length * lines[e, UX] + off * nx
            y = lines[e, Y] + t * length * lines[e, UY] + off * ny
            for m in range(-BLUR_SAMPLES, BLUR_SAMPLES + 1):
                at_x, at_y = x + m * step * nx, y + m * step * ny
                f = _light_sample(image, light, at_x, at_y, (u0, u1, u2)) - foot
                total += f * (1.0 - f) * step / 3.0
        if np.isfinite(total):
            apparent = total * np.sqrt(np.pi)
            # the height of a regular cell of the same area
            size = np.sqrt(0.5 * 3**0.5 * length * clearance[e, HEIGHT])
            share = np.sqrt(max(apparent * abs(apparent) - BILINEAR_PX2, 0.0)) / size
            blurs[count] = size * np.interp(share, APPARENT_BLUR, TRUE_BLUR)
            count += 1
    if count == 0:
        return np.nan
    return np.median(blurs[:count]) if are_isolated else np.partition(blurs[:count], count // 4)[count // 4]
