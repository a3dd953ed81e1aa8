"""Is this picture the pattern that the layout describes, seen and numbered as designed?

The colors are judged here once more, from picture and layout alone, without the extractor's own bookkeeping.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.patterns.colors import BLACK, BLUE, COLORS, GREEN, RED, WHITE

if TYPE_CHECKING:
    from cmpdesign.files.images import Image
    from extractor import Extractor
    from extractor.layout.reference import Reference
    from extractor.result import Markers

MIN_SHARE = 0.9
# How far samples lie from a cell's centre towards its corners: clear of the blurred edges.
_SAMPLE_REACH = 0.35
# Share of the inks' chroma: below it a cell shows no color of its own (glare, dust, black).
_MIN_CHROMA_SHARE = 0.4


@dataclass(frozen=True, eq=False)
class Verdict:
    """What was found in one image.

    Attributes:
        verified: reference found, no contradiction, enough markers measured, view side as designed.
        reason: one sentence that says why not; None when verified.
        present: markers that can be seen in this layout.
        measured, repaired, fitted, lost: how many of them.
        share: measured / present.
        mirrored: seen from the back; None when nothing was found.
        contradictions: cells whose color in the image is not the layout's.
        markers: the extraction's result.
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
        document["share"] = round(self.share, 6)
        document["contradictions"] = list(self.contradictions)
        document["timings_ms"] = {name: round(ms, 3) for name, ms in self.markers.timings_ms.items()}
        return document


def verify(extractor: Extractor, reference: Reference, image: Image, min_share: float = MIN_SHARE) -> Verdict:
    """Extract one image and judge it.

    Args:
        extractor: made for ``reference``.
        image: (H, W, 3) BGR.
        min_share: of the markers present in the layout, from 0 to 1, how many must be measured.

    Raises:
        CmpDesignError: ``min_share`` is no share.
    """
    if not 0 <= min_share <= 1:
        raise CmpDesignError(f"min_share is {min_share:g}; expected a share from 0 to 1")
    return judge_markers(reference, image, extractor.extract(image), min_share)


def judge_markers(
    reference: Reference, image: Image, markers: Markers, min_share: float = MIN_SHARE
) -> Verdict:
    """The verdict on an image that is extracted already."""
    status = markers.status[reference.present]
    lost, measured, repaired, fitted = (int(np.count_nonzero(status == code)) for code in range(4))
    present = len(status)
    contradictions = find_color_contradictions(reference, image, markers.xy_px)
    reason = (
        _not_found_reason(markers)
        or _wrong_colors_reason(reference, contradictions)
        or _wrong_side_reason(reference, markers)
        or _too_few_reason(measured, present, min_share)
    )
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
    words = {
        "no_color": "the image holds no colors that could be inks",
        "no_pattern": "no triangles of the pattern were found",
        "reference_lost": "the white reference cell was not found",
        "ambiguous": "the numbering is ambiguous",
    }
    return words.get(str(markers.reason), "no marker was found")


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
    seen, designed = ("back", "front") if markers.mirrored else ("front", "back")
    return f"the pattern is seen from the {seen}, but designed to be seen from the {designed}"


def _too_few_reason(measured: int, present: int, min_share: float) -> str | None:
    # Rounding must not refuse 90 of 100 at a share of 0.9.
    if measured >= min_share * present - 1e-9:
        return None
    found = f"{measured} of {present} markers measured ({measured / present:.1%})"
    return f"{found}, expected at least {min_share:.1%}"


def find_color_contradictions(
    reference: Reference, image: Image, xy_px: NDArray[np.float64]
) -> tuple[int, ...]:
    """Cells with all corners found whose color in the image is decidedly not the layout's.

    The inks are taken from the image: each is the median over the cells that the layout gives that color.
    They must be the right way round (in each channel, the ink named after it leads): a numbering turned by a
    third, in which all cells agree with each other, is found out too; then every colored cell is returned.
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
    usual = float(ink_size.min())
    nearest = (chroma @ (ink_chroma / ink_size[:, None]).T).argmax(axis=1)
    colored = np.linalg.norm(chroma, axis=1) > _MIN_CHROMA_SHARE * usual
    wrong = colored & (nearest != color) & (color != WHITE)
    return tuple(cells[wrong].tolist())


def _chroma(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) what remains without the gray part."""
    return np.asarray(rgb - rgb.mean(axis=1, keepdims=True))


def _cell_levels(image: Image, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) mean R, G, B inside (N, K, 2) cells: at the centre and part of the way to each corner."""
    import cv2

    centre = corners.mean(axis=1, keepdims=True)
    points = np.concatenate([centre, centre + _SAMPLE_REACH * (corners - centre)], axis=1).astype(np.float32)
    sampled = cv2.remap(
        image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(sampled.astype(np.float64).mean(axis=1)[:, ::-1])
