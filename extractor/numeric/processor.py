"""How the compiled loops use the processor: its widest vectors, and two threads for large patterns. No bit of a result
depends on it.
"""

from __future__ import annotations

from extractor._native import numeric as native


def use_widest_vectors(is_widest: bool) -> bool:
    """Use the widest vectors that the processor has, as at first, or those of the least processor of the build.

    For tests: results do not depend on it.

    Returns:
        Whether the two differ on this processor.
    """
    return native.use_widest_vectors(is_widest)


def use_parts_from(items: int) -> int:
    """Run loops over so many items or more in two threads.

    For tests: results do not depend on it.

    Returns:
        The number before.
    """
    return native.use_parts_from(items)
