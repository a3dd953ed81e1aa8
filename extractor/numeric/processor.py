"""The vectors that the compiled loops use: the widest ones of the processor, with the same bits in every result."""

from __future__ import annotations

from extractor._native import numeric as native


def use_widest_vectors(is_widest: bool) -> bool:
    """Use the widest vectors that the processor has, as at first, or those of the least processor of the build.

    For tests: results do not depend on it.

    Returns:
        Whether the two differ on this processor.
    """
    return native.use_widest_vectors(is_widest)
