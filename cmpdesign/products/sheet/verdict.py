"""The verdict on a picture of a print sheet: the sheet's layout, and the scales and skew of the print."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.files.resolution import resolution_dpi
from cmpdesign.products.sheet.key import BAR_MM
from cmpdesign.products.sheet.scan import NO_CODE, SheetBars, SheetReading, find_sheet_bars, measure_sheet

if TYPE_CHECKING:
    from cmpdesign.files.images import Image

# Largest deviation of a scale from 1, and of the bars' angle from 90 degrees.
SCALE_TOLERANCE, SKEW_TOLERANCE_DEG = 0.005, 0.2
# A camera that leans by four degrees at a distance of 400 mm moves a bar's end by this distance.
PERSPECTIVE_TOLERANCE_MM = 0.1
# Printers scale by at most A3 to A5. Outside this range the stated resolution is not the picture's.
PLAUSIBLE_SCALES = 0.45, 2.2


@dataclass(frozen=True)
class SheetVerdict:
    """The verdict on one sheet.

    Attributes:
        verified: the sheet shows the layout, and every measured value is within its tolerance.
        reason: one sentence on the failure; None when verified.
        note: values that could not be measured, and the cause; None when all were measured.
        reading: the measures; None without a sheet.
    """

    verified: bool
    reason: str | None
    note: str | None
    reading: SheetReading | None

    @property
    def is_sheet(self) -> bool:
        """False when no code of a print sheet was found in the picture."""
        return self.reason != NO_CODE

    def to_json(self) -> dict[str, Any]:
        sheet = None if self.reading is None else {**self.reading.to_json(), "note": self.note}
        return {"verified": self.verified, "reason": self.reason, "sheet": sheet}

    def line(self) -> str:
        """The verdict in one line."""
        head = "verified" if self.verified else f"not verified: {self.reason}"
        if self.reading is None:
            return head
        reading = self.reading
        scale = f"scale x / y {reading.ratio:.4f}"
        if reading.scale_x is not None and reading.dpi is not None:
            dpi = " x ".join(dict.fromkeys(f"{value:.4g}" for value in reading.dpi))
            scale = f"scale x {reading.scale_x:.4f}, y {reading.scale_y:.4f} at {dpi} dpi"
        note = f"; {self.note}" if self.note else ""
        return f"{head} (print sheet {reading.key.name}, {scale}, skew {reading.skew_deg:+.3f} deg{note})"


def judge_sheet(
    image: Image, path: Path | None, digests: Collection[str], dpi: float | None = None
) -> SheetVerdict:
    """Judge a picture of a print sheet.

    Args:
        image: (H, W, 3) BGR, uint8 or uint16.
        path: the picture's file, which may state the resolution; None without a file of its own.
        digests: digests of the layouts of which the sheet may be.
        dpi: resolution instead of the file's; 0: unknown, the file's resolution is ignored.
    """
    bars = find_sheet_bars(image)
    if isinstance(bars, str):
        return SheetVerdict(False, bars, None, None)
    reading, note = _measure_with_resolution(bars, path, dpi)
    reason = _failure_reason(reading, digests)
    return SheetVerdict(reason is None, reason, note, reading)


def _measure_with_resolution(
    bars: SheetBars, path: Path | None, dpi: float | None
) -> tuple[SheetReading, str | None]:
    """The reading, and the reason for unknown scales (None if the scales are known)."""
    if dpi:
        return measure_sheet(bars, (dpi, dpi)), None
    resolution = "no resolution is given" if dpi == 0 or path is None else resolution_dpi(path)
    if not isinstance(resolution, str):
        reading = measure_sheet(bars, resolution)
        assert reading.scale_x is not None and reading.scale_y is not None
        low, high = PLAUSIBLE_SCALES
        if low < reading.scale_x < high and low < reading.scale_y < high:
            return reading, None
        resolution = (
            f"the file states {resolution[0]:.4g} dpi, by which the bars are "
            f"{BAR_MM * reading.scale_x:.3g} x {BAR_MM * reading.scale_y:.3g} mm"
        )
    return measure_sheet(bars), f"scales not known, only their ratio: {resolution}"


def _failure_reason(reading: SheetReading, digests: Collection[str]) -> str | None:
    """One sentence on the first failed test; None if the sheet passes all tests."""
    if reading.key.digest not in digests:
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
