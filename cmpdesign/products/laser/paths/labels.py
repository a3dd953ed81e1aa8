"""Labels of test pieces: letters and digits of seven straight segments, as closed strokes that go and return."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.laser.paths.beam import Points

# A character is one wide and two high. Segments: a top, b upper right, c lower right, d bottom, e lower left, f upper
# left, g middle.
_SEGMENTS = {
    "a": ((0, 2), (1, 2)),
    "b": ((1, 2), (1, 1)),
    "c": ((1, 1), (1, 0)),
    "d": ((0, 0), (1, 0)),
    "e": ((0, 0), (0, 1)),
    "f": ((0, 1), (0, 2)),
    "g": ((0, 1), (1, 1)),
}
_CHARACTERS = {
    "0": "abcdef", "1": "bc", "2": "abged", "3": "abgcd", "4": "fgbc", "5": "afgcd", "6": "afgedc", "7": "abc",
    "8": "abcdefg", "9": "gfabcd", "A": "efabcg", "B": "fgcde", "C": "afed", "D": "bgcde", "E": "afged", "F": "afge",
}  # fmt: skip
# Distance from character to character, in widths.
ADVANCE = 1.6


def label_paths(text: str, x_mm: float, y_mm: float, height_mm: float) -> Points:
    """(N, 2, 2) segments of a text, each from end to end; B and D are drawn as small letters.

    Args:
        text: of 0 to 9 and A to F.
        x_mm, y_mm: lower left corner of the first character.
        height_mm: height of a character.
    """
    width = height_mm / 2
    segments = [
        np.array(_SEGMENTS[name]) * width + (x_mm + place * ADVANCE * width, y_mm)
        for place, character in enumerate(text)
        for name in _CHARACTERS[character]
    ]
    return np.array(segments, dtype=np.float64).reshape(-1, 2, 2)


def arrow_paths(x_mm: float, y_mm: float, length_mm: float) -> Points:
    """(3, 2, 2) segments of an arrow that points up, from its foot."""
    tip, wing = (x_mm, y_mm + length_mm), length_mm / 4
    left, right = ((x_mm + side, y_mm + length_mm - wing) for side in (-wing, wing))
    return np.array([((x_mm, y_mm), tip), (tip, left), (tip, right)])
