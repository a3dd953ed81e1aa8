"""Edge profiles: how far each gridline lies from where it is thought to be, at stations between its corners.

Fast, and sure from a start a pixel off; what the neighbourhood of the corners could tell is left unused.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.bilinear import weighted_sample
from extractor.numeric.compilation import compiled
from extractor.refine.measure.matched_filter import MAX_REACH
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, sagitta
from extractor.refine.synthesis.ink_levels import fill_monomials

BLUR_SAMPLES = 8  # on each side of a gridline
MIN_CONTRAST = 12.0
MAX_REACH_SHARE = (
    0.45  # of the way to the next gridline that a profile may reach for the blur; 0.41 in a regular cell
)
MIN_BLUR_GRIDLINES = 12
# Wide blur mixes the neighbours' inks into the middles that the contrasts are taken from, and the profile looks steeper
# than it is: the blur it shows, and the true one, in units of the cell's height (rendered honeycombs).
APPARENT_BLUR = np.array([0.0, 0.092, 0.112, 0.128, 0.137, 0.149, 0.154])
TRUE_BLUR = np.array([0.000, 0.093, 0.117, 0.140, 0.160, 0.195, 0.225])
BILINEAR_PX2 = 1.0 / 6.0  # variance that bilinear sampling adds to the blur, on the average
CLEARANCE_COLUMNS = (
    4  # columns: height of the lower cell beside it, sines of the angles at both ends, contrast squared
)


@compiled
def channel_projections(lines, contrasts, xy, cells, edge_cells, levels, black, frame):  # type: ignore[no-untyped-def]
    """(E, 4) weights of the channels and offset that make a color 1 before and 0 beyond the gridline (along its
    normal), and (E, 4) the room beside it."""
    weights, room = np.zeros((lines.shape[0], 4)), np.zeros((lines.shape[0], CLEARANCE_COLUMNS))
    terms = np.empty(10)
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength < MIN_CONTRAST**2:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0 = lines[e, X], lines[e, Y]
        middle_x, middle_y = x0 + 0.5 * length * ux, y0 + 0.5 * length * uy
        fill_monomials((middle_x - frame.x) / frame.scale, (middle_y - frame.y) / frame.scale, terms)
        foot = 0.0
        for channel in range(3):
            weights[e, channel] = contrasts[e, channel] / strength
            for k in range(10):
                foot += weights[e, channel] * terms[k] * black[channel, k]
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
            if off > 0.0:  # the cell lies beyond the gridline: its level is the profile's foot
                for channel in range(3):
                    foot += weights[e, channel] * levels[i, channel]
            off = abs(off)
            height = min(height, off)
            if along > 0.0:
                at_a = min(at_a, off / np.sqrt(off * off + along * along))
            if along < length:
                at_b = min(at_b, off / np.sqrt(off * off + (length - along) ** 2))
        weights[e, 3] = foot
        room[e, 0], room[e, 1], room[e, 2], room[e, 3] = height, max(at_a, 0.05), max(at_b, 0.05), strength
    return weights, room


@compiled
def _isolated_gridlines(lines, room):  # type: ignore[no-untyped-def]
    """Numbers of the gridlines with a contrast whose middles other gridlines keep away from; of all with a contrast,
    where these are few."""
    roomy, known = np.empty(lines.shape[0], np.int64), np.empty(lines.shape[0], np.int64)
    few, all_of_them = 0, 0
    for e in range(lines.shape[0]):
        if room[e, 3] == 0.0:
            continue
        sine = min(room[e, 1], room[e, 2])
        away = 0.4 * lines[e, LENGTH] * sine / np.sqrt(max(1.0 - sine * sine, 1e-9))
        if MAX_REACH * room[e, 0] < MAX_REACH_SHARE * away:
            roomy[few] = e
            few += 1
        known[all_of_them] = e
        all_of_them += 1
    return (roomy[:few], True) if few >= MIN_BLUR_GRIDLINES else (known[:all_of_them], False)


@compiled
def profile_blur(image, lines, weights, room, most):  # type: ignore[no-untyped-def]
    """The blur (px, sigma) seen across the middle of ``max_partial_share_in_dirt`` gridlines or fewer, their median;
    NaN where none is seen.

    The integral of f (1 - f) is sigma / sqrt(pi); bilinear samples add to it. So does another gridline near the
    profile: where too few gridlines have room around their middle, the least blurred quarter of all is taken.
    """
    which, roomy = _isolated_gridlines(lines, room)
    every = max(which.shape[0] // most, 1)
    blurs, count = np.empty(which.shape[0] // every + 1), 0
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    for e in which[::every]:
        u0, u1, u2, zero = weights[e, 0], weights[e, 1], weights[e, 2], weights[e, 3]
        nx, ny, length = -lines[e, UY], lines[e, UX], lines[e, LENGTH]
        step = MAX_REACH * room[e, 0] / BLUR_SAMPLES
        total = 0.0
        for k in range(3):
            t = 0.4 + 0.1 * k
            off = sagitta(t, length, lines[e, LEAVE], lines[e, ARRIVE])
            x = lines[e, X] + t * length * lines[e, UX] + off * nx
            y = lines[e, Y] + t * length * lines[e, UY] + off * ny
            for m in range(-BLUR_SAMPLES, BLUR_SAMPLES + 1):
                f = (
                    weighted_sample(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2)
                    - zero
                )
                total += f * (1.0 - f) * step / 3.0
        if np.isfinite(total):
            shown = total * np.sqrt(np.pi)
            size = np.sqrt(0.5 * 3**0.5 * length * room[e, 0])  # the height of a regular cell of this area
            share = np.sqrt(max(shown * abs(shown) - BILINEAR_PX2, 0.0)) / size
            blurs[count] = size * np.interp(share, APPARENT_BLUR, TRUE_BLUR)
            count += 1
    if count == 0:
        return np.nan
    return np.median(blurs[:count]) if roomy else np.partition(blurs[:count], count // 4)[count // 4]
