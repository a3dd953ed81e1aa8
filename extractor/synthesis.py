"""The pattern is drawn from its current markers, and what the image shows beyond it is read along the gridlines.

A pixel of the drawing is the share of each cell under a Gaussian (the optics' blur and the pixel's box in one) times
the cell's level over black. The three sides of a cell are half planes, where two of them are near they form a wedge
(``gaussian``); inclusion and exclusion joins them:

    share = wedge01 + wedge12 + wedge20 - side0 - side1 - side2 + 1.

Every pixel near a gridline then votes with the derivative of the drawing by the gridline's offset, which sinks towards
its two ends as 1 - t and t: the gradient of the log-likelihood, and its curvature.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled
from .gaussian import REACH, density, normal, side_of_wedge
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, bow

BAND = 2.5  # how far from a gridline its pixels vote, in units of the blur

# columns of what is read along a gridline: sums over its pixels
AA, AB, BB, A, B, SHARE_A, SHARE_B, MISFIT, PIXELS, BLUR, BLUR_CURVATURE = range(11)


@compiled
def start_residual(image, black, frame_x, frame_y, scale, box, out):  # type: ignore[no-untyped-def]
    """out = image - black inside the box (x from, y from, x to, y to)."""
    for y in range(box[1], box[3]):
        v = (y - frame_y) / scale
        for channel in range(3):
            c = black[channel]
            c0 = c[0] + v * (c[2] + v * (c[5] + v * c[9]))
            c1 = c[1] + v * (c[4] + v * c[8])
            c2 = c[3] + v * c[7]
            k0, k1, k2, k3 = np.float32(c0), np.float32(c1), np.float32(c2), np.float32(c[6])
            shift, step = np.float32(-frame_x / scale), np.float32(1.0 / scale)
            for x in range(box[0], box[2]):
                u = shift + step * np.float32(x)
                out[y, x, channel] = np.float32(image[y, x, channel]) - (k0 + u * (k1 + u * (k2 + u * k3)))


@compiled
def _side(lines, e, forward, sense, inverse, out):  # type: ignore[no-untyped-def]
    """A cell's side in units of the blur: d = out[0] + out[1] x + out[2] y inside, t from its first corner likewise.

    out: 0-2 distance, 3-5 place along, 6 length, 7 and 8 slopes at its first and second corner, positive inwards.
    """
    line = lines[e]
    ux, uy, length = line[UX], line[UY], line[LENGTH]
    nx, ny = -uy * sense * inverse, ux * sense * inverse
    out[0], out[1], out[2] = -(nx * line[X] + ny * line[Y]), nx, ny
    ux, uy = ux * inverse, uy * inverse
    along = -(ux * line[X] + uy * line[Y])
    out[6] = length * inverse
    if forward:
        out[3], out[4], out[5] = along, ux, uy
        out[7], out[8] = sense * line[LEAVE], sense * line[ARRIVE]
    else:
        out[3], out[4], out[5] = out[6] - along, -ux, -uy
        out[7], out[8] = -sense * line[ARRIVE], -sense * line[LEAVE]


@compiled
def _opening(side, other):  # type: ignore[no-untyped-def]
    """The angle at the corner between a side's end and the next one's start, over 2 pi."""
    ax, ay = -side[4] , -side[5]
    bx, by = other[4], other[5]
    # the first side bows inwards with slope 8 along its direction; seen from the corner that turns it outwards
    angle = np.arccos(min(max((ax * bx + ay * by) / (np.hypot(ax, ay) * np.hypot(bx, by)), -1.0), 1.0))
    return (angle + np.arctan(side[8]) - np.arctan(other[7])) / (2.0 * np.pi)


@compiled
def draw_cells(xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, residual):  # type: ignore[no-untyped-def]
    """Subtract the drawn cells from the residual image."""
    inverse = 1.0 / sigma
    side = np.zeros((3, 9))
    opening = np.zeros(3)
    d, t = np.zeros(3), np.zeros(3)
    for i in range(cells.shape[0]):
        if lines[cell_edges[i, 0], KNOWN] * lines[cell_edges[i, 1], KNOWN] * lines[cell_edges[i, 2], KNOWN] == 0.0:
            continue
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        turn = 1.0 if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 else -1.0
        for k in range(3):
            e = cell_edges[i, k]
            forward = edges[e, 0] == cells[i, k]
            _side(lines, e, forward, turn if forward else -turn, inverse, side[k])
        for k in range(3):
            opening[k] = _opening(side[k], side[(k + 1) % 3])
        bulge = 0.0
        for k in range(3):
            bulge = max(bulge, (0.25 * side[k, 6] + REACH) * max(abs(side[k, 7]), abs(side[k, 8])))
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        far = REACH + bulge
        # the corners of the triangle moved outwards bound its rows; they lie far out where a corner is sharp
        top = max(int(np.ceil(min(a[1], b[1], c[1]) - far * sigma)), box[1])
        bottom = min(int(max(a[1], b[1], c[1]) + far * sigma), box[3] - 1)
        left = max(np.ceil(min(a[0], b[0], c[0]) - far * sigma), float(box[0]))
        right = min(np.floor(max(a[0], b[0], c[0]) + far * sigma), box[2] - 1.0)
        l0, l1, l2 = np.float32(levels[i, 0]), np.float32(levels[i, 1]), np.float32(levels[i, 2])
        g0, g1, g2 = np.float32(slopes[i, 0, 0]), np.float32(slopes[i, 1, 0]), np.float32(slopes[i, 2, 0])
        h0, h1, h2 = np.float32(slopes[i, 0, 1]), np.float32(slopes[i, 1, 1]), np.float32(slopes[i, 2, 1])
        for y in range(top, bottom + 1):
            low, high = left, right
            for k in range(3):
                rest = side[k, 0] + side[k, 2] * y + far
                if side[k, 1] > 0.0:
                    low = max(low, np.ceil(-rest / side[k, 1]))
                elif side[k, 1] < 0.0:
                    high = min(high, np.floor(-rest / side[k, 1]))
                elif rest < 0.0:
                    high = low - 1.0
            dy = np.float32(y - cy)
            for x in range(int(low), int(high) + 1):
                near, out = 0, False
                for k in range(3):
                    t[k] = side[k, 3] + side[k, 4] * x + side[k, 5] * y
                    d[k] = side[k, 0] + side[k, 1] * x + side[k, 2] * y
                    if d[k] < REACH + bulge:
                        d[k] -= bow(t[k] / side[k, 6], side[k, 6], side[k, 7], side[k, 8])
                        if d[k] < REACH:
                            near += 1
                            if d[k] <= -REACH:
                                out = True
                if out:
                    continue
                share = 1.0
                if near > 0:
                    if near == 3:
                        share = 1.0
                    elif near == 2:
                        share = 0.0
                    for k in range(3):
                        n = (k + 1) % 3
                        if d[k] < REACH and d[n] < REACH:
                            back = side[k, 6] - t[k]
                            share += opening[k]
                            share += side_of_wedge(d[k], back - side[k, 8] * d[k])
                            share += side_of_wedge(d[n], t[n] + side[n, 7] * d[n])
                        if near != 2 and d[k] < REACH:
                            share -= normal(-d[k]) if near == 1 else normal(d[k])
                    if near == 3:
                        share = max(share, 0.0)
                s = np.float32(share)
                dx = np.float32(x - cx)
                residual[y, x, 0] -= s * (l0 + g0 * dx + h0 * dy)
                residual[y, x, 1] -= s * (l1 + g1 * dx + h1 * dy)
                residual[y, x, 2] -= s * (l2 + g2 * dx + h2 * dy)


@compiled
def edge_contrasts(lines, xy, cells, edge_cells, levels, slopes):  # type: ignore[no-untyped-def]
    """(E, 3): level at the gridline's middle on the side of (uy, -ux) less that on the side of (-uy, ux)."""
    out = np.zeros((lines.shape[0], 3))
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        ux, uy, half = lines[e, UX], lines[e, UY], 0.5 * lines[e, LENGTH]
        mx, my = lines[e, X] + half * ux, lines[e, Y] + half * uy
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            cx, cy = xy[cells[i]][:, 0].mean(), xy[cells[i]][:, 1].mean()
            if not np.isfinite(cx):  # half of it is out of sight; it cannot be drawn, so its sides cannot be read
                out[e] = 0.0
                lines[e, KNOWN] = 0.0
                break
            sign = -1.0 if (cy - my) * ux - (cx - mx) * uy > 0.0 else 1.0
            for channel in range(3):
                level = levels[i, channel] + slopes[i, channel, 0] * (mx - cx) + slopes[i, channel, 1] * (my - cy)
                out[e, channel] += sign * level
    return out


@compiled
def read_gridlines(lines, contrasts, sigma, box, residual):  # type: ignore[no-untyped-def]
    """(E, 11) sums over the pixels near each gridline; the columns are named above.

    AA, AB, BB: squared derivatives of the drawing by the gridline's offset at its ends; A, B: derivative times
    residual; SHARE: derivative times the share of a side, per unit of contrast; MISFIT: squared residual of PIXELS;
    BLUR: residual times the derivative by sigma.
    """
    out = np.zeros((lines.shape[0], 11))
    inverse = 1.0 / sigma
    for e in range(lines.shape[0]):
        u0, u1, u2 = contrasts[e]
        strength = u0 * u0 + u1 * u1 + u2 * u2
        if lines[e, KNOWN] == 0.0 or strength == 0.0:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0, leave, arrive = lines[e, X], lines[e, Y], lines[e, LEAVE], lines[e, ARRIVE]
        x1, y1 = x0 + length * ux, y0 + length * uy
        sag = 0.25 * length * max(abs(leave), abs(arrive))
        reach = BAND * sigma
        flat = abs(ux) > abs(uy)  # then columns of pixels are walked through, else rows
        if flat:
            first, last = min(x0, x1) - reach, max(x0, x1) + reach
        else:
            first, last = min(y0, y1) - reach, max(y0, y1) + reach
        lower, upper = (box[0], box[2] - 1) if flat else (box[1], box[3] - 1)
        other_low, other_high = (box[1], box[3] - 1) if flat else (box[0], box[2] - 1)
        half = (reach + sag) / max(abs(ux), abs(uy))
        aa, ab, bb, sa, sb, wa, wb = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        misfit, blur, curvature, pixels = 0.0, 0.0, 0.0, 0
        for p in range(max(int(np.ceil(first)), lower), min(int(np.floor(last)), upper) + 1):
            middle = y0 + (p - x0) * uy / ux if flat else x0 + (p - y0) * ux / uy
            for q in range(max(int(np.ceil(middle - half)), other_low), min(int(np.floor(middle + half)), other_high) + 1):
                x, y = (p, q) if flat else (q, p)
                along = ((x - x0) * ux + (y - y0) * uy)
                if along < -reach or along > length + reach:
                    continue
                d = (y - y0) * ux - (x - x0) * uy - bow(along / length, length, leave, arrive)
                if abs(d) > reach:
                    continue
                z = d * inverse
                g = density(z) * inverse
                from_a, from_b = along * inverse, (along - length) * inverse
                if from_a > 4.0 and from_b < -4.0:
                    to_b = along / length
                    to_a = 1.0 - to_b
                else:
                    whole = normal(from_a) - normal(from_b)
                    to_b = (along * whole + sigma * (density(from_a) - density(from_b))) / length
                    to_a = whole - to_b
                r0, r1, r2 = residual[y, x, 0], residual[y, x, 1], residual[y, x, 2]
                r = u0 * r0 + u1 * r1 + u2 * r2
                ga, gb = g * to_a, g * to_b
                aa += ga * ga
                ab += ga * gb
                bb += gb * gb
                sa += ga * r
                sb += gb * r
                wa += ga
                wb += gb
                misfit += r0 * r0 + r1 * r1 + r2 * r2
                pixels += 1
                # beyond the gridline's ends the blur is another
                whole = to_a + to_b
                blur += r * z * g * whole
                curvature += (z * g * whole) ** 2
        row = out[e]
        row[AA], row[AB], row[BB] = aa * strength, ab * strength, bb * strength
        row[A], row[B], row[SHARE_A], row[SHARE_B] = sa, sb, 0.5 * wa, 0.5 * wb
        row[MISFIT], row[PIXELS] = misfit, pixels
        row[BLUR], row[BLUR_CURVATURE] = blur, curvature * strength
    return out
