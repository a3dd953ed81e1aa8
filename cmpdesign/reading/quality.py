"""The quality of images, for reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from extractor.quality import Quality

NUMBERS = ("blur_px", "noise", "contrast", "clipping", "evenness", "edge_px", "row_jump_px")


def quality_to_json(quality: Quality | None) -> dict[str, Any] | None:
    """The properties, null where unknown, the two weakest inks, and the hints."""
    if quality is None:
        return None
    numbers = {name: getattr(quality, name) for name in NUMBERS}
    return {
        **{name: round(value, 4) if np.isfinite(value) else None for name, value in numbers.items()},
        "weakest_inks": list(quality.weakest_inks),
        "row_fault": quality.row_fault or None,
        "hints": list(quality.hints),
    }


def quality_text(quality: Mapping[str, Any]) -> str:
    """One line on a quality from ``quality_to_json``."""
    if quality["contrast"] is None:
        return "unknown"
    inks = " and ".join(quality["weakest_inks"])
    return (
        f"blur {quality['blur_px']:.2f} px of {quality['edge_px']:.1f} px an edge, "
        f"noise {quality['noise']:.1f} of 255, contrast {quality['contrast']:.0f} ({inks}), "
        f"{quality['clipping']:.0%} clipped, evenness {quality['evenness']:.2f}"
    )


def reasons_text(reasons: Mapping[str, int]) -> str:
    """Counted reasons of frames; reasons of the extractor in words."""
    from extractor import Reason

    codes = set(Reason)
    texts = {code.value: code.text for code in codes}
    texts[Reason.SEVERAL_PADS] += ", or give a rig to `reconstruct`, which reads several views of one pad"
    return "; ".join(f"{count} x {texts.get(reason, reason)}" for reason, count in reasons.items())


def median_quality(qualities: Sequence[Quality]) -> Quality | None:
    """Each property's median over images, and the two inks that most often have the smallest contrast; None without
    images.
    """
    from extractor.quality import Quality

    if not qualities:
        return None
    medians = {name: float(np.median([getattr(q, name) for q in qualities])) for name in NUMBERS}
    inks = Counter(q.weakest_inks for q in qualities).most_common(1)[0][0]
    fault = Counter(q.row_fault for q in qualities).most_common(1)[0][0]
    return Quality(**medians, weakest_inks=inks, row_fault=fault)
