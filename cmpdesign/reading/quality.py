"""The quality of images, as reports show it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from extractor.quality import Quality

NUMBERS = ("blur_px", "noise", "contrast", "clipping", "evenness", "edge_px")


def quality_to_json(quality: Quality | None) -> dict[str, Any] | None:
    """The properties, null where unknown, the two weakest inks, and the hints."""
    if quality is None:
        return None
    numbers = {name: getattr(quality, name) for name in NUMBERS}
    return {
        **{name: round(value, 4) if np.isfinite(value) else None for name, value in numbers.items()},
        "weakest_inks": list(quality.weakest_inks),
        "hints": list(quality.hints),
    }


def median_quality(qualities: Sequence[Quality]) -> Quality | None:
    """Each property's median over images, and the inks that differ least most often; None without images."""
    from extractor.quality import Quality

    if not qualities:
        return None
    medians = {name: float(np.median([getattr(q, name) for q in qualities])) for name in NUMBERS}
    return Quality(**medians, weakest_inks=Counter(q.weakest_inks for q in qualities).most_common(1)[0][0])
