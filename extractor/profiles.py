"""Edge profiles: how far each gridline lies from where it is thought to be, at stations between its corners.

Fast, and sure from a start a pixel off; what the neighbourhood of the corners could tell is left unused.
"""

from __future__ import annotations

from math import erf

import numpy as np

from .engine import compiled
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, bow
from .levels import monomials
from .sampling import clamp, sample_dot
from .synthesis import AA, AB, AC, AD, BB, BC, BD, CC, CD, DD, MISFIT, PIXELS, SUMS, A, B, C, D

SAMPLES = 7  # at most, on each side of a gridline
REACH_SIGMA = 2.0  # how far a profile reaches, in units of the blur
CLEAR_SIGMA = 2.8  # how far the other gridline of a corner must be for it not to show, in units of the blur
MAX_REACH = 0.33  # of the cell's height, how far a profile may reach at most
MIN_CONTRAST = 12.0
STATION_PX = (
    1.5  # of a gridline's length that one station tells about, bilinear samples being means of four pixels
)
BILINEAR_PX2 = 1.0 / 6.0  # variance that bilinear sampling adds to the blur, on the average
ROOM = 4  # columns: height of the lower cell beside it, sines of the angles at both ends, contrast squared


@compiled
def unmixing(lines, contrasts, xy, cells, edge_cells, levels, black, frame_x, frame_y, scale):  # type: ignore[no-untyped-def]
    """(E, 4) weights of the channels and offset that make a color 1 before and 0 beyond the gridline (along its
    normal), and (E, 4) the room beside it."""
    weights, room = np.zeros((lines.shape[0], 4)), np.zeros((lines.shape[0], ROOM))
    terms = np.empty(10)
    for e in range(lines.shape[0]):
        strength = (contrasts[e] ** 2).sum()
        if lines[e, KNOWN] == 0.0 or strength < MIN_CONTRAST**2:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0 = lines[e, X], lines[e, Y]
        monomials(
            (x0 + 0.5 * length * ux - frame_x) / scale, (y0 + 0.5 * length * uy - frame_y) / scale, terms
        )
        height, at_a, at_b = length, 1.0, 1.0
        for channel in range(3):
            weights[e, channel] = contrasts[e, channel] / strength
            weights[e, 3] += weights[e, channel] * (terms * black[channel]).sum()
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            third, along = 0.0, 0.0
            for corner in range(3):
                c = xy[cells[i, corner]]
                off = (c[1] - y0) * ux - (c[0] - x0) * uy
                if abs(off) > abs(third):
                    third, along = off, (c[0] - x0) * ux + (c[1] - y0) * uy
            if third > 0.0:  # the cell lies beyond the gridline: its level is the profile's foot
                for channel in range(3):
                    weights[e, 3] += weights[e, channel] * levels[i, channel]
            height = min(height, abs(third))
            if along > 0.0:
                at_a = min(at_a, abs(third) / np.hypot(third, along))
            if along < length:
                at_b = min(at_b, abs(third) / np.hypot(third, length - along))
        room[e, 0], room[e, 1], room[e, 2], room[e, 3] = height, max(at_a, 0.05), max(at_b, 0.05), strength
    return weights, room


@compiled
def profile_blurs(image, lines, weights, room, every):  # type: ignore[no-untyped-def]
    """The blur seen across the middle of every n-th gridline: the integral of f (1 - f) is sigma / sqrt(pi)."""
    out = np.full(lines.shape[0] // every + 1, np.nan)
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    for e in range(0, lines.shape[0], every):
        if room[e, 3] == 0.0:
            continue
        u0, u1, u2, zero = weights[e]
        nx, ny, length = -lines[e, UY], lines[e, UX], lines[e, LENGTH]
        step = MAX_REACH * room[e, 0] / 8
        total = 0.0
        for k in range(3):
            t = 0.4 + 0.1 * k
            off = bow(t, length, lines[e, LEAVE], lines[e, ARRIVE])
            x = lines[e, X] + t * length * lines[e, UX] + off * nx
            y = lines[e, Y] + t * length * lines[e, UY] + off * ny
            for m in range(-8, 9):
                f = sample_dot(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2) - zero
                total += f * (1.0 - f) * step / 3.0
        out[e // every] = total * np.sqrt(np.pi)
    return out


@compiled
def read_profiles(image, lines, weights, room, sigma, most):  # type: ignore[no-untyped-def]
    """(E, 24) sums as ``read_gridlines`` gives them, from at most ``most`` stations a gridline.

    At each station the matched filter of a blurred step tells how far the gridline lies from where it is thought to
    be; it weighs as much as the station's length carries information.
    """
    out = np.zeros((lines.shape[0], SUMS))
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    kernel, step_profile = np.zeros(2 * SAMPLES + 1), np.zeros(2 * SAMPLES + 1)
    kept_reach = -1.0
    samples, norm, step = 2, 1.0, 1.0
    for e in range(lines.shape[0]):
        if room[e, 3] == 0.0:
            continue
        u0, u1, u2, zero = weights[e]
        nx, ny, length = -lines[e, UY], lines[e, UX], lines[e, LENGTH]
        # the sharper a corner, the longer the gridline runs close to its neighbour
        start = min(max(CLEAR_SIGMA * sigma / (length * room[e, 1]), 0.15), 0.4)
        end = 1.0 - min(max(CLEAR_SIGMA * sigma / (length * room[e, 2]), 0.15), 0.4)
        stations = min(max(int(length * (end - start)), 3), most)
        reach = min(REACH_SIGMA * sigma, MAX_REACH * room[e, 0])
        if reach != kept_reach:
            kept_reach, norm = reach, 0.0
            samples = min(max(int(np.ceil(reach)), 2), SAMPLES)
            step = reach / samples
            for m in range(-samples, samples + 1):
                z = m * step / sigma
                kernel[m + samples] = np.exp(-0.5 * z * z) / (np.sqrt(2 * np.pi) * sigma)
                step_profile[m + samples] = 0.5 * (1.0 - erf(z / np.sqrt(2.0)))
                norm += kernel[m + samples] ** 2
        information = room[e, 3] / (2 * np.sqrt(np.pi) * sigma)
        information *= min(length * (end - start) / stations, STATION_PX)
        for j in range(stations):
            t = start + (end - start) * (j + 0.5) / stations
            off = bow(t, length, lines[e, LEAVE], lines[e, ARRIVE])
            x = lines[e, X] + t * length * lines[e, UX] + off * nx
            y = lines[e, Y] + t * length * lines[e, UY] + off * ny
            product, squares = 0.0, 0.0
            for m in range(-samples, samples + 1):
                f = sample_dot(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2) - zero
                rest = clamp(f, -0.3, 1.3) - step_profile[m + samples]
                product += kernel[m + samples] * rest
                squares += rest * rest
            offset = product / norm
            if not abs(offset) < max(1.0, 0.15 * length):
                continue
            out[e, AA] += information * (1 - t) * (1 - t)
            out[e, AB] += information * (1 - t) * t
            out[e, BB] += information * t * t
            out[e, A] += information * (1 - t) * offset
            out[e, B] += information * t * offset
            c = t * (1 - t)
            d = c * (1 - 2 * t)
            out[e, AC] += information * (1 - t) * c
            out[e, AD] += information * (1 - t) * d
            out[e, BC] += information * t * c
            out[e, BD] += information * t * d
            out[e, CC] += information * c * c
            out[e, CD] += information * c * d
            out[e, DD] += information * d * d
            out[e, C] += information * c * offset
            out[e, D] += information * d * offset
            out[e, MISFIT] += information * squares / norm
            out[e, PIXELS] += 2.0 * samples + 1.0
    return out
