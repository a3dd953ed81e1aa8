"""A sensor file with the rig as calibrated: the lines of the measured file stay, its rig's tables are replaced."""

from __future__ import annotations

from datetime import date

from cmpdesign.calibration.rig.calibration import RigCalibration
from cmpdesign.sensor.sensor_file import SensorFile
from cmpdesign.sensor.toml_text import deviation_table, medium_table, replaced_tables, toml_table, view_table
from extractor import Reference
from extractor.space.rig import READ_TABLES


def calibrated_text(
    sensor: SensorFile,
    found: RigCalibration,
    layout: Reference,
    pictures: int,
    steps_mm: tuple[float, ...],
    day: str | None,
) -> str:
    """The text of the sensor file with the calibrated rig, and [calibration.rig].

    Args:
        sensor: the measured file.
        layout: the pad.
        pictures: their number, at rest.
        day: of the pictures, YYYY-MM-DD.
    """
    views, count = found.rig.views, len(found.values)
    tables = [view_table(view) for view in views]
    if views[0].medium is not None:
        tables.append(medium_table(views[0].medium))
        tables.append(toml_table("[medium_deviation]", found.rig.medium_deviation))
    tables += [deviation_table(one) for one in found.rig.deviations]
    record = {
        "date": date.fromisoformat(day) if day else None,
        "layout_digest": layout.digest,
        "pictures": pictures,
        "steps_mm": steps_mm,
        "rms_px": tuple(found.rms_px.values()),
        "scale": found.scale,
        "depth_share": found.depth_share,
        "held": found.held,
        "parameters": found.names[:count],
        "stated": tuple(found.stated.tolist()),
        "deviations": tuple(found.deviations[:count].tolist()),
    }
    tables.append(toml_table("[calibration.rig]", record))
    return replaced_tables(sensor.text, tables, (*READ_TABLES, "calibration.rig"))
