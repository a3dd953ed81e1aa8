"""``cmpdesign verify --sheet-dpi``: scans of print sheets; whose they are and how true they were printed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmpdesign.cli.terminal import BAD_INPUT, one_line, print_error, printable

if TYPE_CHECKING:
    from cmpdesign.sheet_reading import SheetReading

# A print off by more than this, or bars this far from a right angle, is not the design any more.
SCALE_TOLERANCE, SKEW_TOLERANCE_DEG = 0.005, 0.2


def verify_sheets(layout: Path, images: list[Path], dpi: float, output: Path | None, as_json: bool) -> None:
    """Print a line for each scan, or the report; never returns (exit code as for ``verify``)."""
    from extractor import load_layout

    reference = load_layout(layout)
    rows = [_row(path, reference.digest, dpi or None) for path in images]
    report = json.dumps({"format": "cmp-print-check", "version": 1, "sheets": rows}, indent=2) + "\n"
    if output is not None:
        from cmpdesign.writers.atomic import write_file

        write_file(output / "sheets.json", report)
    sys.stdout.write(report if as_json else "".join(_line(row) for row in rows))
    raise typer.Exit(max(BAD_INPUT if "error" in row else int(not row["verified"]) for row in rows))


def _row(path: Path, digest: str, dpi: float | None) -> dict[str, Any]:
    from cmpdesign.images import ImageFileError, read_image
    from cmpdesign.sheet_reading import read_sheet

    name = printable(path)
    try:
        image = read_image(path)
    except ImageFileError as error:
        print_error(error)
        return {"image": name, "verified": False, "error": one_line(error)}
    reading = read_sheet(image, dpi)
    if isinstance(reading, str):
        return {"image": name, "verified": False, "reason": reading}
    reason = _reason(reading, digest)
    return {"image": name, "verified": reason is None, "reason": reason, **reading.to_json()}


def _reason(reading: SheetReading, digest: str) -> str | None:
    """Why the sheet is not the layout, true to size; None when it is."""
    if reading.key.digest != digest:
        return f"the sheet is of another layout ({reading.key.name}, digest {reading.key.digest[:12]})"
    scales = {"scale in x": reading.scale_x, "scale in y": reading.scale_y, "scale x / y": reading.ratio}
    for name, scale in scales.items():
        if scale is not None and abs(scale - 1) > SCALE_TOLERANCE:
            return f"{name} is {scale:.4f}, limit 1 +- {SCALE_TOLERANCE}; print without fitting to the page"
    if abs(reading.skew_deg) > SKEW_TOLERANCE_DEG:
        return f"skew is {reading.skew_deg:.2f} deg, limit {SKEW_TOLERANCE_DEG} deg"
    return None


def _line(row: dict[str, Any]) -> str:
    if "error" in row:
        return ""
    head = f"{row['image']}: " + ("verified" if row["verified"] else f"not verified: {row['reason']}")
    if "ratio" not in row:
        return head + "\n"
    known = row["scale_x"] is not None
    scale = (
        f"scale x {row['scale_x']:.4f}, y {row['scale_y']:.4f}"
        if known
        else f"scale x / y {row['ratio']:.4f}"
    )
    return f"{head} ({row['name']}, {scale}, skew {row['skew_deg']:+.3f} deg)\n"
