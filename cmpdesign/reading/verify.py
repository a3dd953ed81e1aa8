"""Verification of an image against a layout: pattern, colors, numbering and viewed side.

The colors are checked from image and layout alone, independently of the extractor's classification.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.patterns.colors import BLACK, BLUE, COLORS, GREEN, RED, WHITE
from cmpdesign.reading.other_pattern import other_pattern_reason
from cmpdesign.reading.quality import quality_to_json

if TYPE_CHECKING:
    from cmpdesign.files.images import Image
    from extractor import Extractor
    from extractor.layout.reference import Reference
    from extractor.result import Markers

# Least share of the present markers that must be measured.
MIN_SHARE = 0.9
# Place of samples from a cell's centre (0) to a corner (1), clear of the blurred edges.
_SAMPLE_REACH = 0.35
# Least chroma of a colored cell, as a share of the inks' chroma; glare, dust and black are below.
_MIN_CHROMA_SHARE = 0.4
_SIDE_CAUSES = {
    "other_side": "a mirrored camera, the pad's other face, or an RGB image saved as BGR",
    "mirrored": "a mirrored camera or the pad's other face, by the colors of the inks",
    "swapped_channels": "red and blue are swapped, by the colors of the inks: an RGB image saved as BGR",
}


@dataclass(frozen=True, eq=False)
class Verdict:
    """The verdict on one image.

    Attributes:
        verified: markers found, no contradiction, enough markers measured, viewed side as designed.
        reason: one sentence on the failure; None when verified.
        present: number of markers that are visible in this layout.
        measured, repaired, fitted, lost: numbers of present markers by status.
        share: measured / present.
        mirrored: the image shows the back; None when no marker was found.
        contradictions: cells whose color in the image contradicts the layout.
        markers: result of the extraction.
    """

    verified: bool
    reason: str | None
    present: int
    measured: int
    repaired: int
    fitted: int
    lost: int
    share: float
    mirrored: bool | None
    contradictions: tuple[int, ...]
    markers: Markers

    def line(self) -> str:
        """The verdict in one line, and a line for each hint on a pattern that was found."""
        pad = "" if self.markers.code is None else f"pad {self.markers.code}, "
        repaired = self.repaired + self.fitted
        counts = f"{pad}{self.measured} of {self.present} measured, {repaired} repaired, {self.lost} lost"
        head = "verified" if self.verified else f"not verified: {self.reason}"
        line = f"{head} ({counts}, {sum(self.markers.timings_ms.values()):.1f} ms)"
        quality = self.markers.quality
        hints = quality.hints if quality is not None and self.markers.found else ()
        return "".join([line, *(f"\n  {hint}" for hint in hints if hint not in head)])

    def to_json(self) -> dict[str, Any]:
        """The verdict as a JSON object; times in ms."""
        names = (
            "verified",
            "reason",
            "present",
            "measured",
            "repaired",
            "fitted",
            "lost",
            "share",
            "mirrored",
        )
        document = {name: getattr(self, name) for name in names}
        if self.markers.code is not None:
            document["code"] = self.markers.code
        document["share"] = round(self.share, 6)
        document["contradictions"] = list(self.contradictions)
        document["quality"] = quality_to_json(self.markers.quality)
        document["timings_ms"] = {name: round(ms, 3) for name, ms in self.markers.timings_ms.items()}
        return document


def verify(extractor: Extractor, image: Image, min_share: float = MIN_SHARE) -> Verdict:
    """Extract the markers of one image and give a verdict.

    Args:
        extractor: of the layout, or of the layouts of a family; with ``side="either"`` the extractor reads both sides,
            and the verdict distinguishes them.
        image: (H, W, 3) BGR, uint8 or uint16.
        min_share: least share of the present markers that must be measured, 0 to 1.

    Raises:
        CmpDesignError: ``min_share`` is not from 0 to 1.
    """
    if not 0 <= min_share <= 1:
        raise CmpDesignError(f"min_share is {min_share:g}; expected a share from 0 to 1")
    markers = extractor.extract(image)
    reference = extractor.layout_of(markers)
    verdict = judge_markers(reference, image, markers, min_share)
    if verdict.verified:
        return verdict
    misfit = other_pattern_reason(reference, image, verdict.markers)
    return verdict if misfit is None else replace(verdict, reason=misfit)


def judge_markers(
    reference: Reference, image: Image, markers: Markers, min_share: float = MIN_SHARE
) -> Verdict:
    """The verdict on an image from its extracted markers."""
    status = markers.status[reference.present]
    lost, measured, repaired, fitted = (int(np.count_nonzero(status == code)) for code in range(4))
    present = len(status)
    contradictions = find_color_contradictions(reference, image, markers.xy_px)
    reason = _not_found_reason(markers)
    if reason is None:
        colors = _wrong_colors_reason(reference, contradictions)
        side = _wrong_side_reason(reference, markers)
        too_few = _too_few_reason(markers, measured, present, min_share)
        # what hides markers may hide a part of a cell beside them, too
        is_hidden = too_few is not None and len(contradictions) < present - measured
        ordered = (side, too_few, colors) if is_hidden else (colors, side, too_few)
        reason = next((one for one in ordered if one is not None), None)
    return Verdict(
        verified=reason is None,
        reason=reason,
        present=present,
        measured=measured,
        repaired=repaired,
        fitted=fitted,
        lost=lost,
        share=measured / present,
        mirrored=None if markers.mirrored is None else bool(markers.mirrored),
        contradictions=contradictions,
        markers=markers,
    )


def _not_found_reason(markers: Markers) -> str | None:
    if np.isfinite(markers.xy_px).all(axis=1).any():
        return None
    return "; ".join(markers.advice) or "no marker was found"


def _wrong_colors_reason(reference: Reference, contradictions: tuple[int, ...]) -> str | None:
    if not contradictions:
        return None
    first = contradictions[0]
    more = f" and {len(contradictions) - 1} more" if len(contradictions) > 1 else ""
    color = COLORS[reference.cell_color[first]]
    return f"colors contradict the layout: cell {first}, which should be {color}{more}"


def _wrong_side_reason(reference: Reference, markers: Markers) -> str | None:
    if markers.mirrored == reference.mirrored:
        return None
    from extractor.numbering.ink_fields import Palette

    viewed, designed = ("back", "front") if markers.mirrored else ("front", "back")
    fields = markers.stages["number"].fields
    why = "other_side"
    if fields is not None:
        shares = fields.shares[[0, 2, 1]]  # as the stated side numbers the classes
        why = Palette(dict(reference.palette)).other_side_reason(shares)
    remedy = f" ({parameter('channels', 'rgb')})" if why == "swapped_channels" else ""
    return (
        f"the pattern is seen from the {viewed}, but designed to be seen from the {designed}: "
        f"{_SIDE_CAUSES[why]}{remedy}"
    )


def _too_few_reason(markers: Markers, measured: int, present: int, min_share: float) -> str | None:
    # The tolerance accepts 90 of 100 at a share of 0.9 despite rounding.
    if measured >= min_share * present - 1e-9:
        return None
    found = f"{measured} of {present} markers measured ({measured / present:.1%})"
    return "; ".join([f"{found}, expected at least {min_share:.1%}", *markers.advice])


def find_color_contradictions(
    reference: Reference, image: Image, xy_px: NDArray[np.float64]
) -> tuple[int, ...]:
    """Find cells whose color in the image contradicts the layout.

    The level of each ink is the median over the cells to which the layout gives this ink. In each channel the ink of
    the channel's name must be the brightest. A numbering turned by a third, in which all cells agree with each other,
    fails this test, and all colored cells are returned.

    Args:
        reference: the layout.
        image: (H, W, 3) BGR.
        xy_px: (M, 2) found markers, NaN where not found; only cells with all corners found are tested.

    Returns:
        Numbers of the cells.
    """
    cells = np.flatnonzero(np.isfinite(xy_px[reference.cell_corners]).all(axis=(1, 2)))
    color = reference.cell_color[cells]
    inks = (RED, GREEN, BLUE)
    if reference.cell_corners.shape[1] != 3 or any(not (color == ink).any() for ink in (*inks, BLACK)):
        return ()
    level = _cell_levels(image, xy_px[reference.cell_corners[cells]])
    black = np.median(level[color == BLACK], axis=0)
    medians = np.array([np.median(level[color == ink], axis=0) for ink in inks]) - black
    gain = medians.mean(axis=0)
    if (gain <= 0).any() or (medians.argmax(axis=0) != inks).any():
        return tuple(cells[color < BLACK].tolist())
    chroma, ink_chroma = _chroma((level - black) / gain), _chroma(medians / gain)
    ink_size = np.linalg.norm(ink_chroma, axis=1)
    least_size = float(ink_size.min())
    nearest = (chroma @ (ink_chroma / ink_size[:, None]).T).argmax(axis=1)
    colored = np.linalg.norm(chroma, axis=1) > _MIN_CHROMA_SHARE * least_size
    wrong = colored & (nearest != color) & (color != WHITE)
    return tuple(cells[wrong].tolist())


def _chroma(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) levels less their mean over the channels."""
    return np.asarray(rgb - rgb.mean(axis=1, keepdims=True))


def _cell_levels(image: Image, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) mean R, G, B of (N, K, 2) cells, sampled at the centre and part of the way to each corner."""
    import cv2

    from extractor.image.input import in_native_order

    centre = corners.mean(axis=1, keepdims=True)
    points = np.concatenate([centre, centre + _SAMPLE_REACH * (corners - centre)], axis=1).astype(np.float32)
    sampled = cv2.remap(
        in_native_order(image),
        points[..., 0],
        points[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(sampled.astype(np.float64).mean(axis=1)[:, ::-1])
