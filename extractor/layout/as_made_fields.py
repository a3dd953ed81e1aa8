"""The optional field ``as_made`` of a layout file: the differences of a made pad from its design."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.layout import json_fields as fields
from extractor.layout.consistency import MAX_CELL_HEIGHT_MM
from extractor.layout.reference import AsMade

SIDES = ("front", "back")
OPTIONAL = ("outlines", "covariance_mm2", "cell_height_mm")
COLUMNS = ("xx", "xy", "yy")  # of a covariance


def read_as_made(document: dict[str, Any], markers: int) -> AsMade | None:
    """The made pad; None for a pad as designed.

    Args:
        document: the layout file.
        markers: number of markers.

    Raises:
        LayoutError: a field is wrong.
    """
    if "as_made" not in document:
        return None
    made = fields.mapping(document["as_made"], "as_made")
    fields.known_fields(made, ("of", "product", "side"), "as_made.", optional=OPTIONAL)
    fields.require_version_2(made, ("cell_height_mm",), "as_made.", document["version"])
    of = fields.text_field(made["of"], "as_made.of")
    if not re.fullmatch("[0-9a-f]{64}", of):
        fields.fail("as_made.of", fields.shown(of), "the digest of a layout, 64 hex digits")
    side = made["side"]
    if side not in SIDES:
        fields.fail("as_made.side", fields.shown(side), f"one of {', '.join(SIDES)}")
    return AsMade(
        of=of,
        product=fields.text_field(made["product"], "as_made.product"),
        side=side,
        outlines_mm=_outlines_mm(made["outlines"]) if "outlines" in made else None,
        covariance_mm2=_covariance_mm2(made["covariance_mm2"], markers) if "covariance_mm2" in made else None,
        cell_height_mm=_cell_height_mm(made.get("cell_height_mm", 0.0)),
    )


def _cell_height_mm(value: object) -> float:
    if type(value) not in (int, float) or not abs(value) <= MAX_CELL_HEIGHT_MM:  # type: ignore[arg-type]
        limit = f"{MAX_CELL_HEIGHT_MM:g}"
        fields.fail("as_made.cell_height_mm", fields.shown(value), f"a number from -{limit} to {limit} mm")
    return float(value)  # type: ignore[arg-type]


def _outlines_mm(outlines: object) -> tuple[NDArray[np.float64], ...]:
    if not isinstance(outlines, list):
        fields.fail("as_made.outlines", fields.shown(outlines), "a list of outlines")
    return tuple(fields.points_mm(ring, f"as_made.outlines[{i}]") for i, ring in enumerate(outlines))


def _covariance_mm2(value: object, markers: int) -> NDArray[np.float64]:
    """(M, 2, 2) from the columns xx, xy, yy; NaN where all three are null."""
    columns = fields.mapping(value, "as_made.covariance_mm2")
    fields.known_fields(columns, COLUMNS, "as_made.covariance_mm2.")
    xx, xy, yy = (
        fields.lengths_mm(columns[name], f"as_made.covariance_mm2.{name}", markers, nullable=True)
        for name in COLUMNS
    )
    unknown = np.isnan([xx, xy, yy])
    with np.errstate(invalid="ignore"):
        is_covariance = (xx >= 0) & (yy >= 0) & (xx * yy >= xy * xy)
    wrong = np.flatnonzero(~(unknown.all(axis=0) | is_covariance))
    if len(wrong):
        first = int(wrong[0])
        shown = ", ".join("null" if np.isnan(v) else f"{v:g}" for v in (xx[first], xy[first], yy[first]))
        fields.fail(
            f"as_made.covariance_mm2 of marker {first}",
            f"[{shown}]",
            "xx, xy, yy of a covariance, or three nulls",
        )
    return np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
