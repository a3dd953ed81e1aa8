"""The result of extraction, and the reasons for few or no markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.frozen_record import LateRecord
from extractor.quality import Quality


class Status(IntEnum):
    """How a marker's position was found."""

    LOST = 0
    MEASURED = 1
    REPAIRED = 2  # mild omission, eq. 6
    FITTED = 3  # heavy omission, quadratic fit within the marker's layer


class VirtualStatus(IntEnum):
    """How a virtual marker's position was found."""

    LOST = 0
    MEASURED = 1
    INTERPOLATED = 2


class Origin(StrEnum):
    """The evidence that fixed the start of the numbering."""

    WHITE = "white"  # the white cell
    CODE = "code"  # the white cells of a coded pad
    OUTLINE = "outline"  # the pattern's rim, because the white cell is hidden
    PREVIOUS = "previous"  # the previous frame, because the white cell is hidden


class Reason(StrEnum):
    """Why no or few markers were found in an image."""

    NO_COLOR = "no_color"  # the image is grayscale
    NO_PATTERN = "no_pattern"  # no triangles that meet as in a pattern
    REFERENCE_LOST = "reference_lost"  # a pattern whose white cell is not visible
    AMBIGUOUS = "ambiguous"  # more than one cell could be the reference
    SEVERAL_PADS = "several_pads"  # several white cells, each with the surrounding cells of a pattern
    OTHER_CODE = "other_code"  # white cells that are not those of the layout's code
    OTHER_SIDE = (
        "other_side"  # the other side, or red and blue are swapped: the inks do not distinguish the cases
    )
    MIRRORED = "mirrored"  # the pattern's other side, in inks of the palette's colors
    SWAPPED_CHANNELS = "swapped_channels"  # the inks have the palette's colors if red and blue are swapped
    FEW_MARKERS = (
        "few_markers"  # the numbering is known, but fewer than half of the visible markers are reported
    )

    @property
    def text(self) -> str:
        """Meaning and remedy, in one clause."""
        return _REASON_TEXTS[self]


SIDE_REASONS = (Reason.OTHER_SIDE, Reason.MIRRORED, Reason.SWAPPED_CHANNELS)

_REASON_TEXTS = {
    Reason.NO_COLOR: "the image holds no colors; give a color image of the pattern, in light that shows all inks, "
    "neither dark nor overexposed",
    Reason.NO_PATTERN: "no triangles of the pattern were found; focus, check light and exposure, and show the pattern "
    "with 8 px an edge or more",
    Reason.REFERENCE_LOST: "the white reference cell was not found; uncover or clean it, keep it in view, and check "
    "that the layout is the pattern's",
    Reason.AMBIGUOUS: "the numbering is ambiguous: more than one cell could be the white cell; remove glare and dirt, "
    "and show the pattern around the white cell",
    Reason.SEVERAL_PADS: "several white cells agree with the cells around them; show one pad alone",
    Reason.OTHER_CODE: "the white cells are not those of the layout's code; give the layout of this pad, or clean the "
    "pattern and remove glare",
    Reason.OTHER_SIDE: "the pattern is seen from another side than stated: a mirrored camera, the pad's other "
    "face, or an RGB image where BGR is expected; state side or channels",
    Reason.MIRRORED: "the pattern is seen from another side than stated: by the colors of its inks a mirrored "
    "camera or the pad's other face; state side, or turn the image or the pad",
    Reason.SWAPPED_CHANNELS: "red and blue are swapped: with both exchanged, the side is the stated side and the "
    "inks have the layout's colors; state channels, or convert the image to BGR",
    Reason.FEW_MARKERS: "fewer than half of the visible markers were found; check focus, exposure and light, "
    "uncover or clean the pattern, and check that the layout is the pattern's",
}


class VirtualMarkers(NamedTuple):
    """m virtual markers on each of E edges.

    Attributes:
        xy_px, cov_px2: (E, m, 2) and (E, m, 2, 2) float64, NaN where lost.
        status: (E, m) uint8, a ``VirtualStatus`` each.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


VIRTUAL = (
    "virtual_xy_px",
    "virtual_cov_px2",
    "virtual_status",
)  # attributes of Markers, in the order of VirtualMarkers


@dataclass(frozen=True, eq=False)
class Markers(LateRecord):
    """The M markers of one image by id, and m virtual markers on each of E edges. Can be pickled and copied.

    Attributes:
        xy_px: (M, 2) float64 in the image frame ((0, 0) is the centre of the top-left pixel), NaN where lost.
        cov_px2: (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
        virtual_xy_px: (E, m, 2) float64, in the order of the layout's edges, from the smaller id; NaN where lost.
        virtual_cov_px2: (E, m, 2, 2) float64, NaN where lost.
        virtual_status: (E, m) uint8, a ``VirtualStatus`` each: measured across the gridline (every virtual marker is
            interpolated along it), or interpolated only. An extractor's result computes the virtual markers when they
            are first asked for.
        mirrored: whether the image shows the pattern's back; None when no cell was numbered.
        reason: why no or few markers were found; None without a problem. ``FEW_MARKERS`` may come with markers.
        timings_ms: stage name -> milliseconds, read-only.
        stages: stage name -> that stage's result, for debugging and drawing, read-only.
        origin: the evidence that fixed the numbering; None when no cell was numbered.
        quality: blur, noise, contrast, clipping, light and scale of the image; None when there was no color image.
        code: id of the pad's code; None for a pad without a code, and when no cell was numbered.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]
    virtual_xy_px: NDArray[np.float64]
    virtual_cov_px2: NDArray[np.float64]
    virtual_status: NDArray[np.uint8]
    mirrored: bool | None
    reason: Reason | None
    timings_ms: Mapping[str, float]
    stages: Mapping[str, Any] = field(default_factory=dict, repr=False)
    origin: Origin | None = None
    quality: Quality | None = None
    code: int | None = None

    def __post_init__(self) -> None:
        self._freeze_mappings("timings_ms", "stages")

    def moved(self, offset_px: tuple[float, float]) -> Markers:
        """The same markers in a frame whose origin lies this offset (px) further left and up."""

        def virtual() -> VirtualMarkers:
            return VirtualMarkers(self.virtual_xy_px + offset_px, self.virtual_cov_px2, self.virtual_status)

        others = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in VIRTUAL}
        return Markers.with_later({VIRTUAL: virtual}, **{**others, "xy_px": self.xy_px + offset_px})

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.counts.items())
        reason = "" if self.reason is None else f"; {self.reason}"
        return f"<Markers: {counts}{reason}>"

    def _repr_html_(self) -> str:
        """A table of the statuses, for notebooks."""
        from html import escape

        rows = {name: str(count) for name, count in self.counts.items()}
        if self.mirrored is not None:
            rows["seen from"] = "the back" if self.mirrored else "the front"
        if self.reason is not None:
            rows["reason"] = self.reason.text
        if self.quality is not None and self.quality.hints:
            rows["remedy"] = "; ".join(self.quality.hints)
        cells = "".join(f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in rows.items())
        return f"<table>{cells}</table>"

    @property
    def counts(self) -> dict[str, int]:
        """Number of markers by status: measured, repaired, fitted, lost; lost includes markers that no cell shows."""
        order = (Status.MEASURED, Status.REPAIRED, Status.FITTED, Status.LOST)
        return {status.name.lower(): int(np.count_nonzero(self.status == status)) for status in order}

    @property
    def found(self) -> bool:
        """Whether any marker has a position."""
        return bool(np.any(self.status))

    @property
    def advice(self) -> tuple[str, ...]:
        """The remedy of the reason, and the hints of the quality; empty without both."""
        reason = () if self.reason is None else (self.reason.text,)
        return reason + (() if self.quality is None else self.quality.hints)
