"""Reading of a made pad before its files are written: drawn as the camera sees it, read, compared with the design."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.checks import CAMERA_PX, Finding
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK
from cmpdesign.products.as_made.made_pad import MadePad, make_pad
from cmpdesign.watch import told

if TYPE_CHECKING:
    from extractor.presets import Preset

FOLDER = "as-made"
# Share of the picture's height or width that the pad fills.
FILL_SHARE = 0.94
# A camera in focus blurs an edge by about a pixel (standard deviation).
BLUR_PX = 0.8
MIN_SHARE = 0.98
# Largest deviation of a marker, in pitches, without a warning.
WARNING_PITCHES = 0.02
# A pattern with this number of colored cells is numbered with any clip outline: all patterns that failed had fewer than
# ten.
CERTAIN_CELLS = 40


@dataclass(frozen=True, eq=False)
class PadReading:
    """The extractor's reading of a made pad, compared with the nominal layout.

    Attributes:
        share: measured markers over visible markers.
        rms_px, worst_px: deviation of the measured markers from their nominal places; NaN if none was measured.
        pitch_px, pitch_mm: distance of neighbouring markers.
        side_seen: the side that the extractor found; None if it found no marker.
        xy_mm: (M, 2) places in the layout frame, NaN where not measured.
    """

    share: float
    rms_px: float
    worst_px: float
    pitch_px: float
    pitch_mm: float
    side_seen: str | None
    xy_mm: NDArray[np.float64]

    @property
    def worst_pitches(self) -> float:
        return self.worst_px / self.pitch_px

    def figures(self) -> dict[str, Any]:
        """Share, side, and the deviations in px, mm and pitches; None where no marker was measured."""
        scales = {"px": 1.0, "mm": self.pitch_mm / self.pitch_px, "pitch": 1 / self.pitch_px}
        found: dict[str, Any] = {"measured_share": round(self.share, 6), "side_seen": self.side_seen}
        for name, value in (("rms", self.rms_px), ("worst", self.worst_px)):
            known = np.isfinite(value)
            found |= {
                f"{name}_{unit}": round(value * by, 5) if known else None for unit, by in scales.items()
            }
        return found

    def line(self) -> str:
        """The reading in one line."""
        if not np.isfinite(self.rms_px):
            return f"{self.share:.1%} of the markers measured"
        mm = self.pitch_mm / self.pitch_px
        values = [
            f"{name} {px:.3f} px, {1000 * px * mm:.2f} um, {px / self.pitch_px:.4f} pitch"
            for name, px in (("RMS", self.rms_px), ("worst", self.worst_px))
        ]
        return f"{self.share:.1%} of the markers measured from the {self.side_seen}; {'; '.join(values)}"


def read_pad(pad: MadePad, camera_px: tuple[int, int] = CAMERA_PX, preset: Preset = "balanced") -> PadReading:
    """Draw a camera's picture that a made pad fills, and read the picture with the nominal layout.

    The picture has no noise, so the deviations are systematic.

    Raises:
        extractor.errors.LayoutError: the layout's cells are no triangles.
    """
    import cv2

    from cmpdesign.files.layout_json import layout_to_json
    from cmpdesign.scene import Camera, Optics, Plain, Scene, render
    from extractor import Extractor, Status, parse_layout

    nominal, camera_turn_deg, scale = pad.nominal, *filling_view(pad.nominal, camera_px)
    pitch_mm = float(nominal.parameters["pitch_mm"])
    camera = Camera(scale * pitch_mm, camera_turn_deg)
    scene = Scene(pad.layout, camera, optics=Optics(BLUR_PX))
    rendered = render(replace(scene, background=Plain(scene.ink(BLACK))), size=camera_px)
    reference = parse_layout(layout_to_json(replace(nominal, as_made=None)))
    markers = Extractor(reference, preset, side="either").extract(rendered.image)
    visible = nominal.present & rendered.truth.visible
    measured = visible & (markers.status == Status.MEASURED)
    deviation = np.hypot(*(markers.xy_px - rendered.truth.marker_xy_px)[measured].T)
    xy_mm = np.full_like(nominal.marker_xy_mm, np.nan)
    # The pad is flat, so the map to the picture is a homography.
    assert rendered.truth.H is not None
    layout_from_image = np.linalg.inv(rendered.truth.H)
    xy_mm[measured] = cv2.perspectiveTransform(markers.xy_px[None], layout_from_image)[0, measured]
    return PadReading(
        share=float(measured.sum() / max(visible.sum(), 1)),
        rms_px=float(np.sqrt((deviation**2).mean())) if measured.any() else float("nan"),
        worst_px=float(deviation.max()) if measured.any() else float("nan"),
        pitch_px=scale * pitch_mm,
        pitch_mm=pitch_mm,
        side_seen=None if markers.mirrored is None else seen_side(bool(markers.mirrored)),
        xy_mm=xy_mm,
    )


@dataclass(frozen=True, eq=False)
class PadReadings:
    """The reading of several pads: files ``as-made/<product>.json``, findings, figures and readings by product."""

    files: dict[str, str | bytes]
    findings: list[Finding]
    figures: dict[str, Any]
    readings: dict[str, PadReading]


def read_pads(
    pads: Iterable[MadePad], camera_px: tuple[int, int] = CAMERA_PX, preset: Preset = "balanced"
) -> PadReadings:
    """Read pads; a pad whose cells are no triangles is not read, and its markers have nominal places."""
    from cmpdesign.files.layout_json import layout_to_json

    found = PadReadings({}, [], {}, {})
    every = list(pads)
    for pad in told(every, len(every), "pads"):
        found.figures[pad.product] = pad.figures()
        if pad.nominal.cell_corners.shape[1] == 3:
            reading = read_pad(pad, camera_px, preset)
            found.readings[pad.product] = reading
            found.findings.extend(reading_findings(pad, reading))
            found.figures[pad.product] |= {"camera_px": list(camera_px), **reading.figures()}
            pad = pad.with_markers(reading.xy_mm)
        found.files[f"{FOLDER}/{pad.product}.json"] = layout_to_json(pad.layout)
    return found


def reading_findings(pad: MadePad, reading: PadReading) -> list[Finding]:
    """Errors where too few markers or the wrong side are read; a warning where markers deviate."""
    name, cause = pad.product, pad.main_cause
    designed = seen_side(pad.nominal.mirrored)
    if reading.side_seen is not None and reading.side_seen != designed:
        subject = f"{name}: pads that show the {reading.side_seen}, but are designed to show the {designed}"
        remedy = "set mirrored to the side that the camera sees"
        return [Finding(subject, 1, 0, "", remedy, "error", is_measure=False)]
    remedy = f"change {cause}" if cause else "make pitch_mm larger, or use a camera with more pixels"
    if reading.share < MIN_SHARE:
        subject = f"{name}: share of markers that are measured on the pad as made"
        return [Finding(subject, reading.share, MIN_SHARE, "", remedy, "error")]
    if reading.worst_pitches > WARNING_PITCHES:
        subject = f"{name}: deviation of a marker on the pad as made"
        return [Finding(subject, reading.worst_pitches, WARNING_PITCHES, "pitch", remedy, "warning")]
    return []


def clip_findings(layout: Layout, camera_px: tuple[int, int] = CAMERA_PX) -> list[Finding]:
    """An error if a clip outline leaves too few cells to be numbered; only small patterns are drawn and read."""
    cells = len(layout.colored_cells)
    triangular = layout.cell_corners.shape[1] == 3
    if "clip" not in layout.parameters or not triangular or cells >= CERTAIN_CELLS:
        return []
    reading = read_pad(make_pad(layout, "design", list(layout.colored_outlines_mm)), camera_px)
    if reading.share >= MIN_SHARE:
        return []
    subject = f"share of markers that are measured where the clip leaves {cells} colored cells"
    remedy = "make the clip outline larger or the pitch smaller"
    return [Finding(subject, reading.share, MIN_SHARE, "", remedy, "error")]


def filling_view(layout: Layout, camera_px: tuple[int, int]) -> tuple[float, float]:
    """Turn in degrees and scale in px per mm at which the pad fills the picture best."""
    width, height = layout.size_mm
    upright = min(camera_px[0] / width, camera_px[1] / height)
    turned = min(camera_px[0] / height, camera_px[1] / width)
    return (90.0, FILL_SHARE * turned) if turned > 1.01 * upright else (0.0, FILL_SHARE * upright)
