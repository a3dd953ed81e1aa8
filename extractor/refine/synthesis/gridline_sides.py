"""The light on both sides of the gridlines, and the contrast of their values.

A gridline's normal is (-uy, ux). The light ``before`` the gridline lies on the side of (uy, -ux), the light ``beyond``
on the side of the normal.
"""

from __future__ import annotations

import numpy as np

from extractor.image.response import table_place
from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.gridlines import KNOWN, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.ink_polynomials import TERMS, fill_monomials

BEFORE, BEYOND = 0, 3  # first of the three channels on each side
SIDE_COLUMNS = 6


@compiled
def gridline_sides(lines, xy, cells, edge_cells, levels, frame):  # type: ignore[no-untyped-def]
    """The light on both sides of the gridlines, at the middles of the chords.

    Args:
        lines: (E, 8), as ``gridlines`` gives them; ``KNOWN`` is set to 0 beside cells with an unknown corner.
        xy: (M, 2) px, the markers.
        cells: (K, 3) marker ids of the drawn cells.
        edge_cells: (E, 2) the drawn cells on both sides, -1 for none.
        levels: ``InkLevels``.
        frame: ``PolynomialFrame``.

    Returns:
        (E, 6) light 0 to 255, three channels before the gridline and three beyond; 0 where not known.
    """
    out = np.zeros((lines.shape[0], SIDE_COLUMNS))
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        ux, uy, half = lines[e, UX], lines[e, UY], 0.5 * lines[e, LENGTH]
        mx, my = lines[e, X] + half * ux, lines[e, Y] + half * uy
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            a, b, c = cells[i, 0], cells[i, 1], cells[i, 2]
            cx, cy = (xy[a, 0] + xy[b, 0] + xy[c, 0]) / 3, (xy[a, 1] + xy[b, 1] + xy[c, 1]) / 3
            if not np.isfinite(cx):
                # a cell with an unknown corner is not drawn, and no gridline beside that cell is read
                lines[e, KNOWN] = 0.0
                break
            side = BEYOND if (cy - my) * ux - (cx - mx) * uy > 0.0 else BEFORE
            for channel in range(3):
                rise = levels.slope[i, channel, 0] * (mx - cx) + levels.slope[i, channel, 1] * (my - cy)
                out[e, side + channel] += levels.cell[i, channel] + rise
        if lines[e, KNOWN] == 0.0:
            out[e] = 0.0
    add_black(out, lines, levels.black, frame)
    return out


@compiled
def add_black(sides, lines, black, frame):  # type: ignore[no-untyped-def]
    """Add the black polynomial (3, 10), at the middles of the chords, to both sides (E, 6) of known gridlines."""
    terms = np.empty(TERMS)
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        half = 0.5 * lines[e, LENGTH]
        mx, my = lines[e, X] + half * lines[e, UX], lines[e, Y] + half * lines[e, UY]
        fill_monomials((mx - frame.x) / frame.scale, (my - frame.y) / frame.scale, terms)
        for channel in range(3):
            level = 0.0
            for k in range(TERMS):
                level += terms[k] * black[channel, k]
            sides[e, BEFORE + channel] += level
            sides[e, BEYOND + channel] += level


@compiled
def value_contrasts(sides, encoded):  # type: ignore[no-untyped-def]
    """(E, 3) gray levels: the values before the gridlines less those beyond, for the light on both ``sides`` (E, 6).

    ``encoded``: as in ``ResponseTables``.
    """
    out = np.empty((sides.shape[0], 3))
    for e in range(sides.shape[0]):
        for channel in range(3):
            before, beyond = sides[e, BEFORE + channel], sides[e, BEYOND + channel]
            out[e, channel] = encoded[table_place(before)] - encoded[table_place(beyond)]
    return out
