"""How long a job takes: every straight move starts and ends at rest, as sharp corners force it to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.strokes import Strokes


def move_times_s(
    length_mm: NDArray[np.float64], speed_mm_s: float, accel_mm_s2: float
) -> NDArray[np.float64]:
    """Times of straight moves from rest to rest: a trapezoid of speed, or a triangle where it is too
    short."""
    full = length_mm >= speed_mm_s**2 / accel_mm_s2
    trapezoid = length_mm / speed_mm_s + speed_mm_s / accel_mm_s2
    return np.where(full, trapezoid, 2 * np.sqrt(length_mm / accel_mm_s2))


def stroke_lengths_mm(strokes: Strokes) -> NDArray[np.float64]:
    """(P - S,) lengths of the straight moves of open strokes, in order."""
    steps = np.diff(strokes.xy_mm, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    return np.delete(lengths, strokes.first[1:-1] - 1)


def travel_lengths_mm(strokes: Strokes) -> NDArray[np.float64]:
    """(S - 1,) lengths of the dark moves from each open stroke's end to the next one's start."""
    jumps = strokes.xy_mm[strokes.first[1:-1]] - strokes.xy_mm[strokes.first[1:-1] - 1]
    return np.asarray(np.hypot(jumps[:, 0], jumps[:, 1]))


def begin_times_s(
    strokes: Strokes, speed_mm_s: float, travel_mm_s: float, accel_mm_s2: float
) -> tuple[NDArray[np.float64], float]:
    """When each open stroke begins, and when the last one ends, from the first one's start, in s."""
    burn = move_times_s(stroke_lengths_mm(strokes), speed_mm_s, accel_mm_s2)
    moves = np.diff(strokes.first) - 1
    per_stroke = np.add.reduceat(burn, np.cumsum(moves) - moves) if len(burn) else np.zeros(0)
    travel = move_times_s(travel_lengths_mm(strokes), travel_mm_s, accel_mm_s2)
    begun = np.cumsum(np.concatenate([[0.0], per_stroke[:-1] + travel]))
    return begun, float(begun[-1] + per_stroke[-1])
