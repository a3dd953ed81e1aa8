"""How far the gridlines lie off, place by place, where refinement last compared the image with the pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .gaussian import density, normal
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, bow
from .stepping import TRUSTED

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
        across = abs(ux) > abs(uy)  # then columns of pixels are walked through, else rows
        p0, q0, up, uq = (x0, y0, ux, uy) if across else (y0, x0, uy, ux)
        sense = 1.0 if across else -1.0
        p_end, q_end = (width - 1, height - 1) if across else (height - 1, width - 1)
        first = int(np.ceil(min(p0, p0 + length * up)))
        last = int(np.floor(max(p0, p0 + length * up)))
        stride = np.uint64(3 * width) if across else np.uint64(3)
        for p in range(max(first, 0), min(last, p_end) + 1):
            middle = q0 + (p - p0) * uq / up
            middle += sense * bow((p - p0) / (up * length), length, leave, arrive) / up
            start = max(int(np.ceil(middle - reach / abs(up))), 0)
            end = min(int(np.floor(middle + reach / abs(up))), q_end)
            at = np.uint64((start * width + p if across else p * width + start) * 3)
            for q in range(start, end + 1):
                along = ((p - p0) * up + (q - q0) * uq) / length
                j = int(np.floor(along * (count + 1) - 0.5))
                if along * (count + 1) >= 0.5 and j < count:
                    z = (
                        sense * ((q - q0) * up - (p - p0) * uq) - bow(along, length, leave, arrive)
                    ) * inverse
                    rest = u0 * flat[at] + u1 * flat[at + one] + u2 * flat[at + two] - foot[e]
                    if drawn:
                        rest -= u0 * shown[at] + u1 * shown[at + one] + u2 * shown[at + two]
                    else:
                        rest -= normal(-z)
                    g = density(z)
                    votes[j, 0] += g * rest
                    votes[j, 1] += g * g
                at += stride
        for j in range(count):
            if votes[j, 1] < MIN_VOTES:
                continue
            if not drawn:
                start, end = (j + 0.5) / (count + 1), (count - j - 0.5) / (count + 1)
                if length * min(start * room[e, 1], end * room[e, 2]) < CLEAR_SIGMA * sigma:
                    continue
            out[e, j, OFFSET] = sigma * votes[j, 0] / votes[j, 1]
            out[e, j, VARIANCE] = noise**2 * sigma**2 / (strength * votes[j, 1])
    return out


def measure(
    image: NDArray[np.uint8], model: NDArray[np.float32], reading: Reading, count: int
) -> NDArray[np.float64]:
    """(E, m, 3): points on the gridlines as they were read, moved to where the image shows them, and their variances
    across; NaN where there are none."""
    offsets = read_offsets(image, model, *reading, count)
    return np.asarray(_points(reading.lines, offsets))


@compiled
def _points(lines, offsets):  # type: ignore[no-untyped-def]
    """(E, m, 3) the measured points and their variance across the gridline."""
    edges, count = offsets.shape[0], offsets.shape[1]
    out = np.full((edges, count, 3), np.nan)
    for e in range(edges):
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        for j in range(count):
            t = (j + 1.0) / (count + 1.0)
            off = bow(t, length, lines[e, LEAVE], lines[e, ARRIVE]) + offsets[e, j, OFFSET]
            out[e, j, 0] = lines[e, X] + t * length * ux - off * uy
            out[e, j, 1] = lines[e, Y] + t * length * uy + off * ux
            out[e, j, 2] = offsets[e, j, VARIANCE]
    return out
