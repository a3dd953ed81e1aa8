"""Times of moves: every straight move starts and ends at rest, because corners are sharp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.strokes import Strokes


def move_times_s(
    length_mm: NDArray[np.float64], speed_mm_s: float, accel_mm_s2: float
) -> NDArray[np.float64]:
    """Times of straight moves from rest to rest: a trapezoid of speed, or a triangle for short moves."""
    reaches_speed = length_mm >= speed_mm_s**2 / accel_mm_s2
    trapezoid = length_mm / speed_mm_s + speed_mm_s / accel_mm_s2
    return np.where(reaches_speed, trapezoid, 2 * np.sqrt(length_mm / accel_mm_s2))


def stroke_lengths_mm(strokes: Strokes) -> NDArray[np.float64]:
    """(P - S,) lengths of the straight moves of open strokes, in order."""
    moves = np.diff(strokes.xy_mm, axis=0)
    lengths = np.hypot(moves[:, 0], moves[:, 1])
    return np.delete(lengths, strokes.first[1:-1] - 1)


def travel_lengths_mm(strokes: Strokes) -> NDArray[np.float64]:
    """(S - 1,) lengths of the moves without beam from each open stroke's end to the next stroke's start."""
    jumps = strokes.xy_mm[strokes.first[1:-1]] - strokes.xy_mm[strokes.first[1:-1] - 1]
    return np.asarray(np.hypot(jumps[:, 0], jumps[:, 1]))


def begin_times_s(
    strokes: Strokes, speed_mm_s: float, travel_mm_s: float, accel_mm_s2: float
) -> tuple[NDArray[np.float64], float]:
    """(S,) start time of each open stroke, and the end time of the last stroke, in s from the first start."""
    burn_s = move_times_s(stroke_lengths_mm(strokes), speed_mm_s, accel_mm_s2)
    moves = np.diff(strokes.first) - 1
    per_stroke_s = np.add.reduceat(burn_s, np.cumsum(moves) - moves) if len(burn_s) else np.zeros(0)
    travel_s = move_times_s(travel_lengths_mm(strokes), travel_mm_s, accel_mm_s2)
    begin_s = np.cumsum(np.concatenate([[0.0], per_stroke_s[:-1] + travel_s]))
    return begin_s, float(begin_s[-1] + per_stroke_s[-1])
