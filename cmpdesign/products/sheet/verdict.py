"""Is this picture a print sheet of the layout, and is it printed true?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.files.resolution import resolution_dpi
from cmpdesign.products.sheet.key import BAR_MM
from cmpdesign.products.sheet.scan import NO_CODE, SheetBars, SheetReading, find_sheet_bars, measure_sheet

if TYPE_CHECKING:
    from cmpdesign.files.images import Image

# A print off by more than this, or bars this far from a right angle, is not the design any more.
SCALE_TOLERANCE, SKEW_TOLERANCE_DEG = 0.005, 0.2
# A camera that leans by four degrees 400 mm away moves a bar's end by this.
PERSPECTIVE_TOLERANCE_MM = 0.1
# No printer fits a page by more than from A3 to A5: beyond, a file's resolution is not its picture's.
PLAUSIBLE_SCALES = 0.45, 2.2


@dataclass(frozen=True)
class SheetVerdict:
    """What was found on one sheet.

    Attributes:
        verified: it is the layout's, and nothing that could be measured is off.
        reason: one sentence that says why not; None when verified.
        note: what could not be measured and why; None when all was.
        reading: the measures; None when there is no sheet.
    """

    verified: bool
    reason: str | None
    note: str | None
    reading: SheetReading | None

    @property
    def is_sheet(self) -> bool:
        """False when the picture shows no sheet's code."""
        return self.reason != NO_CODE

    def to_json(self) -> dict[str, Any]:
        sheet = None if self.reading is None else {**self.reading.to_json(), "note": self.note}
        return {"verified": self.verified, "reason": self.reason, "sheet": sheet}

    def line(self) -> str:
        """The verdict in one line."""
        head = "verified" if self.verified else f"not verified: {self.reason}"
        if self.reading is None:
            return head
        found = self.reading
        scale = f"scale x / y {found.ratio:.4f}"
        if found.scale_x is not None and found.dpi is not None:
            dpi = " x ".join(dict.fromkeys(f"{value:.4g}" for value in found.dpi))
            scale = f"scale x {found.scale_x:.4f}, y {found.scale_y:.4f} at {dpi} dpi"
        note = f"; {self.note}" if self.note else ""
        return f"{head} (print sheet {found.key.name}, {scale}, skew {found.skew_deg:+.3f} deg{note})"


def judge_sheet(image: Image, path: Path, digest: str, dpi: float | None = None) -> SheetVerdict:
    """The verdict on a picture of a sheet.

    Args:
        image: (H, W, 3) BGR.
        path: its file, which may state the picture's resolution.
        digest: the layout's.
        dpi: the resolution, if it is known better; 0 when it is not known at all.
    """
    bars = find_sheet_bars(image)
    if isinstance(bars, str):
        return SheetVerdict(False, bars, None, None)
    reading, note = _measure_with_resolution(bars, path, dpi)
    reason = _failure_reason(reading, digest)
    return SheetVerdict(reason is None, reason, note, reading)


def _measure_with_resolution(
    bars: SheetBars, path: Path, dpi: float | None
) -> tuple[SheetReading, str | None]:
    """The reading, and why the scales themselves are not known, if they are not."""
    if dpi:
        return measure_sheet(bars, (dpi, dpi)), None
    stated = "no resolution is given" if dpi == 0 else resolution_dpi(path)
    if not isinstance(stated, str):
        reading = measure_sheet(bars, stated)
        assert reading.scale_x is not None and reading.scale_y is not None
        low, high = PLAUSIBLE_SCALES
        if low < reading.scale_x < high and low < reading.scale_y < high:
            return reading, None
        stated = (
            f"the file states {stated[0]:.4g} dpi, by which the bars are "
            f"{BAR_MM * reading.scale_x:.3g} x {BAR_MM * reading.scale_y:.3g} mm"
        )
    return measure_sheet(bars), f"scales not known, only their ratio: {stated}"


def _failure_reason(reading: SheetReading, digest: str) -> str | None:
    """Why the sheet is not the layout, true to size; None when nothing speaks against it."""
    if reading.key.digest != digest:
        return f"the sheet is of another layout ({reading.key.name}, digest {reading.key.digest[:12]})"
    if reading.perspective_mm > PERSPECTIVE_TOLERANCE_MM:
        return (
            f"the sheet is bent or seen at an angle: the bars' ends are off by {reading.perspective_mm:.2f} mm, "
            f"limit {PERSPECTIVE_TOLERANCE_MM} mm; scan it, or photograph it flat and from straight above"
        )
    scales = {"scale in x": reading.scale_x, "scale in y": reading.scale_y, "scale x / y": reading.ratio}
    for name, scale in scales.items():
        if scale is not None and abs(scale - 1) > SCALE_TOLERANCE:
            return f"{name} is {scale:.4f}, limit 1 +- {SCALE_TOLERANCE}; print without fitting to the page"
    if abs(reading.skew_deg) > SKEW_TOLERANCE_DEG:
        return f"skew is {reading.skew_deg:.2f} deg, limit {SKEW_TOLERANCE_DEG} deg"
    return None
