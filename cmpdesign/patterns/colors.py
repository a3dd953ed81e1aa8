"""The colors that a cell may have, by number."""

from __future__ import annotations

COLORS = ("red", "green", "blue", "black", "white")


RED, GREEN, BLUE, BLACK, WHITE = range(5)
