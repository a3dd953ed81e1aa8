"""Reading of a layout file as a ``Layout``, for scenes of the pattern as printed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.layout.layout import AsMade, Layout, equal_length_outlines
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.pad_code import PadCode

if TYPE_CHECKING:
    from extractor.layout.reference import Reference


def read_layout(path: str | Path) -> Layout:
    """Read a ``layout.json`` with the extractor's reader, which checks the file.

    Raises:
        extractor.errors.LayoutError: the file cannot be read or contradicts itself.
    """
    from extractor.layout.layout_file import load_layout

    return layout_from_reference(load_layout(path))


def layout_from_reference(reference: Reference) -> Layout:
    """Convert a ``Reference`` to a ``Layout``; both share the read-only arrays."""
    return Layout(
        pattern=reference.pattern,
        parameters=reference.parameters,
        marker_layer=reference.layer,
        marker_index=reference.index,
        marker_xy_mm=reference.xy_mm,
        cell_corners=reference.cell_corners,
        cell_color=reference.cell_color,
        edges=reference.edges,
        virtual_per_edge=reference.virtual_per_edge,
        reference_cell=reference.reference_cell,
        reference_marker=reference.reference_marker,
        palette=reference.palette,
        border_mm=reference.border_mm,
        outline_mm=reference.outline_mm,
        fiducials_mm=reference.fiducials_mm,
        fiducial_diameter_mm=reference.fiducial_diameter_mm,
        code=None if reference.code is None else PadCode(reference.code.id, reference.code.share),
        as_made=_as_made(reference),
    )


def _as_made(reference: Reference) -> AsMade | None:
    made = reference.as_made
    if made is None:
        return None
    outlines = None if made.outlines_mm is None else equal_length_outlines(made.outlines_mm)
    side = seen_side(made.side == "back")
    return AsMade(made.of, made.product, side, outlines, made.covariance_mm2, made.cell_height_mm)
