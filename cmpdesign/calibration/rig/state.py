"""The state of a sensor beside its residuals: light, focus, share read, force scale, ages of its calibrations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import date

from cmpdesign.documents.calibration import CameraStatePart, ForceScalePart, ViewStatePart
from cmpdesign.inputs.cameras import CameraState
from cmpdesign.sensor.sensor_file import SensorFile
from extractor import Markers, Reference
from extractor.contact import load_gel


def view_states(file: SensorFile, layout: Reference, markers: Sequence[Markers]) -> dict[str, ViewStatePart]:
    """View -> what its picture tells."""
    least = file.table.limits.min_share_read
    return {name: _view_state(layout, one, least) for name, one in zip(file.rig.names, markers, strict=True)}


def _view_state(layout: Reference, markers: Markers, least: float) -> ViewStatePart:
    quality, measured = markers.quality, layout.present & (markers.status == 1)
    share = float(measured.sum() / max(layout.present.sum(), 1))
    figures = {
        name: None if quality is None or not math.isfinite(value := getattr(quality, name)) else value
        for name in ("blur_px", "evenness", "clipping", "contrast")
    }
    few = f"clean the window: {share:.0%} of the markers are measured, {least:.0%} are expected"
    hints = () if quality is None else quality.hints
    return ViewStatePart(share_read=share, hints=(*hints, few) if share < least else hints, **figures)


def camera_states(cameras: Mapping[str, CameraState | None]) -> dict[str, CameraStatePart]:
    """Camera -> what its driver answers, without recorded sources."""
    return {
        name: CameraStatePart(settings=asdict(one.settings), notes=tuple(one.notes()))
        for name, one in cameras.items()
        if one is not None
    }


def force_scale(file: SensorFile, layout: Reference) -> ForceScalePart | None:
    """The scale of forces of a sensor.

    Raises:
        SensorError, extractor.GelError: the gel's file cannot be read, or is another pad's.
    """
    elastomer, gel = file.table.elastomer, file.gel
    if elastomer is None:
        return None
    if gel is not None:
        load_gel(gel).require_layout(layout)
    return ForceScalePart(
        young_mpa=elastomer.young_mpa, young_sigma_mpa=elastomer.young_sigma_mpa, gel=elastomer.gel
    )


def ages_days(file: SensorFile, today: date) -> dict[str, int | None]:
    """Calibration -> its age; None without a date."""
    found = file.table.calibration
    return {
        name: None if table.date is None else (today - table.date).days
        for name, table in (("camera", found.camera), ("rig", found.rig))
        if table is not None
    }
