"""Compare designs before making one: the error of each marker in pictures of a pressed pad, against the truth.

    python examples/compare_designs.py

``cmpdesign evaluate designs`` compares by the error in space, on a whole simulated sensor.
"""

from __future__ import annotations

import numpy as np

import cmpdesign
from extractor import Extractor

WIDTH_MM, SCALE_PX_PER_MM, PICTURES = 24.0, 18.0, 3


def error_um(design: cmpdesign.Design) -> float:
    """RMS error of a marker, per axis, um on the pattern, at three turns and presses."""
    extractor, errors_px = Extractor(design.layout), []
    for number in range(PICTURES):
        seen = cmpdesign.render(
            design.layout,
            pitch_px=SCALE_PX_PER_MM * design.report.pitch_mm,
            rotation_deg=7.3 * (1 + number),
            press_mm=0.1 * number,
            noise=2,
            seed=number,
        )
        errors_px.append(extractor.extract(seen.image).xy_px - seen.truth.marker_xy_px)
    return float(1000 / SCALE_PX_PER_MM * np.sqrt(np.nanmean(np.square(errors_px))))


def main() -> None:
    print("pattern    layers  markers  pitch mm  error um")
    for pattern in ("honeycomb", "round"):
        for layers in (6, 9):
            design = cmpdesign.Design(pattern=pattern, layers=layers, width_mm=WIDTH_MM)
            report = design.report
            figures = f"{report.present_markers:7d}  {report.pitch_mm:8.3f}  {error_um(design):8.3f}"
            print(f"{pattern:9s}  {layers:6d}  {figures}")


if __name__ == "__main__":
    main()
