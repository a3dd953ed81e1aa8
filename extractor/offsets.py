"""How far the gridlines lie off, place by place, where refinement last compared the image with the pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, bow
from .profiles import HALF, I1, I2, I3, I4, I5
from .stepping import TRUSTED
from .synthesis import C0, C1, C2, C3, C4, C5

BAND = 2.2  # how far from a gridline its pixels count, in units of the blur
CLEAR_SIGMA = 2.0  # how far the next gridline must be where nothing was drawn, in units of the blur
MIN_VOTES = 0.08  # of a pixel on the gridline
OFFSET, VARIANCE = range(2)


class Reading(NamedTuple):
    """Along what gridlines, and beside which colors, refinement last compared the image with the pattern.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3).
        foot: (E,) what a color beyond the gridline gives in units of the contrast; where drawn, black and half of what
            the levels were corrected by.
        room: (E, 4), as ``unmixing`` gives it; used where nothing was drawn.
        use: (E,) how far the gridline is trusted.
        sigma: the blur, px.
        noise: grey levels.
        drawn: the pattern was drawn.
    """

    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    foot: NDArray[np.float64]
    room: NDArray[np.float64]
    use: NDArray[np.float64]
    sigma: float
    noise: float
    drawn: bool


@compiled
def foot_of(contrasts, black, off):  # type: ignore[no-untyped-def]
    """(E,) black (E, 3) and half of a change of the sides' levels (E,), in units of the contrast."""
    out = np.zeros(contrasts.shape[0])
    for e in range(contrasts.shape[0]):
        strength = 0.0
        for channel in range(3):
            strength += contrasts[e, channel] ** 2
            out[e] += contrasts[e, channel] * black[e, channel]
        out[e] = (out[e] + 0.5 * off[e]) / max(strength, 1e-9)
    return out


@compiled
def read_offsets(image, model, lines, contrasts, foot, room, use, sigma, noise, drawn, count):  # type: ignore[no-untyped-def]
    """(E, m, 2): how far each gridline lies off towards (-uy, ux) around its virtual markers, px, and the variance.

    NaN where the gridline has no contrast, is not trusted, leaves the image, or where another one is too near for what
    was not drawn.
    """
    out = np.full((lines.shape[0], count, 2), np.nan)
    flat, shown, height, width = image.reshape(-1), model.reshape(-1), image.shape[0], image.shape[1]
    one, two = np.uint64(1), np.uint64(2)
    inverse, reach = 1.0 / sigma, BAND * sigma
    votes = np.zeros((count, 2))
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength == 0.0 or use[e] < TRUSTED:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0, leave, arrive = lines[e, X], lines[e, Y], lines[e, LEAVE], lines[e, ARRIVE]
        u0, u1, u2 = contrasts[e, 0] / strength, contrasts[e, 1] / strength, contrasts[e, 2] / strength
        votes[:] = 0.0
        zero = foot[e]
        across = abs(ux) > abs(uy)  # then columns of pixels are walked through, else rows
        p0, q0, up, uq = (x0, y0, ux, uy) if across else (y0, x0, uy, ux)
        sense = 1.0 if across else -1.0
        p_end, q_end = (width - 1, height - 1) if across else (height - 1, width - 1)
        stride = np.uint64(3 * width) if across else np.uint64(3)
        per_up, short, places = 1.0 / up, 1.0 / length, count + 1.0
        half, lean, step = abs(reach * per_up), uq * per_up, uq * short
        # the first and the last virtual marker are half a place from where their pixels begin and end
        from_p, to_p = p0 + (0.5 / places) * length * up, p0 + (1.0 - 0.5 / places) * length * up
        slack = reach * abs(uq)
        first = max(int(np.ceil(min(from_p, to_p) - slack)), 0)
        last = min(int(np.floor(max(from_p, to_p) + slack)), p_end)
        wide = int(2.0 * half) + 1  # the same for every row across, which is what processors guess best
        for p in range(first, last + 1):
            middle = q0 + (p - p0) * lean
            middle += sense * bow((p - p0) * per_up * short, length, leave, arrive) * per_up
            start = max(int(np.ceil(middle - half)), 0)
            at = np.uint64((start * width + p if across else p * width + start) * 3)
            t = ((p - p0) * up + (start - q0) * uq) * short
            aside = sense * ((start - q0) * up - (p - p0) * uq)
            for _ in range(min(wide, q_end - start + 1)):
                place = t * places - 0.5
                s = 1.0 - t
                z = (aside - length * (t * s * (leave * s - arrive * t))) * inverse
                zz = z * z
                if place >= 0.0 and place < count and zz < BAND * BAND:
                    g = C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5))))
                    rest = u0 * flat[at] + u1 * flat[at + one] + u2 * flat[at + two] - zero
                    if drawn:
                        rest -= u0 * shown[at] + u1 * shown[at + one] + u2 * shown[at + two]
                    else:
                        rest -= HALF - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))
                    at_place = np.uint64(place)
                    votes[at_place, 0] += g * rest
                    votes[at_place, 1] += g * g
                at += stride
                t += step
                aside += sense * up
        for j in range(count):
            if votes[j, 1] < MIN_VOTES:
                continue
            if not drawn:
                near, far = (j + 0.5) / places, (count - j - 0.5) / places
                if length * min(near * room[e, 1], far * room[e, 2]) < CLEAR_SIGMA * sigma:
                    continue
            out[e, j, OFFSET] = sigma * votes[j, 0] / votes[j, 1]
            out[e, j, VARIANCE] = noise**2 * sigma**2 / (strength * votes[j, 1])
    return out


def measure(
    image: NDArray[np.uint8], model: NDArray[np.float32], reading: Reading, count: int, scale: int
) -> NDArray[np.float64]:
    """(E, m, 3): points on the gridlines as they were read, moved to where the image shows them, and their variances
    across, at the full scale of an image that was reduced by ``scale``; NaN where there are none."""
    if count == 0:
        return np.empty((len(reading.lines), 0, 3))
    offsets = read_offsets(image, model, *reading, count)
    return np.asarray(_points(reading.lines, offsets, scale))


@compiled
def _points(lines, offsets, scale):  # type: ignore[no-untyped-def]
    """(E, m, 3) the measured points and their variance across the gridline."""
    edges, count = offsets.shape[0], offsets.shape[1]
    out = np.full((edges, count, 3), np.nan)
    for e in range(edges):
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        for j in range(count):
            t = (j + 1.0) / (count + 1.0)
            off = bow(t, length, lines[e, LEAVE], lines[e, ARRIVE]) + offsets[e, j, OFFSET]
            out[e, j, 0] = (lines[e, X] + t * length * ux - off * uy + 0.5) * scale - 0.5
            out[e, j, 1] = (lines[e, Y] + t * length * uy + off * ux + 0.5) * scale - 0.5
            out[e, j, 2] = offsets[e, j, VARIANCE] * scale * scale
    return out
