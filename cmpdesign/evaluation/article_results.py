"""The article's results of the same experiments, on manufactured sensors (its section IV)."""

from __future__ import annotations

# Section IV-B and Fig. 11a: change of the edge fitting error from the square to the multicolor pattern.
EDGE_ERROR_CHANGE_PERCENT = {"press": -61.2, "press_shear": -58.1}
# Section IV-B and Fig. 11b: change of the response from the square to the multicolor pattern.
RESPONSE_CHANGE_PERCENT = {"shear_x": 17.6, "shear_y": 12.2}
# Table I: successes in ten trials per mode.
ARTICLE_TRIALS = 10
ARTICLE_SUCCESSES = {
    "twist": {"square": 7, "multicolor": 9, "multicolor_repair": 10},
    "shear_x": {"square": 6, "multicolor": 7, "multicolor_repair": 10},
    "shear_y": {"square": 6, "multicolor": 10, "multicolor_repair": 10},
}


def change_percent(square: float | None, multicolor: float | None) -> float | None:
    """Change from the square to the multicolor pattern's value, in percent of the square pattern's value."""
    if square is None or multicolor is None or square == 0:
        return None
    return round(100 * (multicolor - square) / square, 2)
