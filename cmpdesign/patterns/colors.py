"""The colors of cells and their numbers."""

from __future__ import annotations

COLORS = ("red", "green", "blue", "black", "white")


RED, GREEN, BLUE, BLACK, WHITE = range(5)
