"""From a design to its layout."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.design.fiducials import fiducial_positions
from cmpdesign.errors import DesignError
from cmpdesign.layout.layout import DECIMALS, Layout
from cmpdesign.layout.outline import Points, corner_offsets, rotation_matrix
from cmpdesign.layout.sizing import clip_outline, pattern_centre, resolve_size, rim_corners
from cmpdesign.patterns import PatternShape, registered_patterns
from cmpdesign.patterns.graphs import MarkerGraph
from cmpdesign.patterns.numbering import Ints


def build_layout(design: Design) -> Layout:
    """The layout of a design: every marker, cell and edge, in the layout frame (mm).

    A clip outline drops cells and the edges that no cell is left at; markers all stay, because a marker's
    position in the arrays is its id. ``Layout.present`` says which of them can be seen.

    Raises:
        DesignError: the sizes cannot be resolved, or the clip outline drops the reference cell.

    >>> from cmpdesign import load_design
    >>> layout = build_layout(load_design("honeycomb", {"layers": "10", "pitch_mm": "1.5"}))
    >>> len(layout.marker_xy_mm), len(layout.cell_corners), len(layout.edges)
    (331, 600, 930)
    >>> layout.size_mm
    (32.309401076, 27.980762114)
    """
    shape, pitch_mm = resolve_size(design)
    pattern = registered_patterns()[design.pattern]
    mesh = pattern.graph.mesh(shape.layers)
    turn = rotation_matrix(design.rotation_deg).T
    xy_mm = pitch_mm * (pattern.positions(mesh.layer, mesh.index, shape) @ turn)
    centre_mm = pitch_mm * (pattern_centre(design, shape) @ turn)

    if design.clip == "none":
        corners = rim_corners(design, shape)
        outline_mm = pitch_mm * corners + design.border_mm * corner_offsets(corners)
    else:
        outline_mm = clip_outline(design)
        mesh = _clip_graph(design, mesh, xy_mm - centre_mm)

    return Layout(
        pattern=design.pattern,
        parameters=_layout_parameters(design, shape, pitch_mm),
        marker_layer=mesh.layer.astype(np.int32),
        marker_index=mesh.index.astype(np.int32),
        marker_xy_mm=_round_points(xy_mm),
        cell_corners=mesh.corners.astype(np.int32),
        cell_color=mesh.color,
        edges=_edges(mesh.corners),
        virtual_per_edge=design.virtual_per_edge,
        reference_cell=mesh.reference_cell,
        reference_marker=mesh.reference_marker,
        palette=design.palette.model_dump(),
        border_mm=design.border_mm,
        outline_mm=_round_points(outline_mm + centre_mm),
        fiducials_mm=_round_points(fiducial_positions(design.fiducials, outline_mm + centre_mm)),
        fiducial_diameter_mm=design.fiducials.diameter_mm if design.fiducials.count else 0.0,
    )


def _clip_graph(design: Design, mesh: MarkerGraph, xy_mm: Points) -> MarkerGraph:
    """The mesh without the cells that reach over the clip outline less its border; xy from the centre."""
    # A picometre of tolerance: a cell that exactly fills the window is inside it.
    slack_mm = 10**-DECIMALS
    if design.clip == "circle":
        reach_mm = clip_outline(design, design.border_mm)[0, 0]
        inside = np.hypot(*xy_mm.T) <= reach_mm + slack_mm
    else:
        reach_mm = clip_outline(design, design.border_mm).max(axis=0)
        inside = (np.abs(xy_mm) <= reach_mm + slack_mm).all(axis=1)
    keep = inside[mesh.corners].all(axis=1)
    if not keep[mesh.reference_cell]:
        raise DesignError(
            f"the {design.clip} clip outline, less a border of {design.border_mm:g} mm, cuts the reference "
            "cell away: nothing could be numbered; make the outline larger or the pitch smaller"
        )
    if not _is_reference_surrounded(mesh, keep):
        raise DesignError(
            f"the {design.clip} clip outline, less a border of {design.border_mm:g} mm, cuts cells around "
            "the reference cell away; make the outline larger or the pitch smaller"
        )
    reference = int(np.count_nonzero(keep[: mesh.reference_cell]))
    return replace(mesh, corners=mesh.corners[keep], color=mesh.color[keep], reference_cell=reference)


def _is_reference_surrounded(mesh: MarkerGraph, keep: NDArray[np.bool_]) -> bool:
    """True when every cell that shares a side with the reference cell is kept: numbering starts from them."""
    shared = np.isin(mesh.corners, mesh.corners[mesh.reference_cell]).sum(axis=1)
    return bool(keep[shared >= 2].all())


def _edges(corners: Ints) -> NDArray[np.int32]:
    """(E, 2) the cells' sides, each once, from the smaller to the larger id, in ascending order."""
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    low, high = sides.min(axis=1), sides.max(axis=1)
    base = int(high.max()) + 1
    return np.stack(np.divmod(np.unique(low * base + high), base), axis=-1).astype(np.int32)


def _layout_parameters(design: Design, shape: PatternShape, pitch_mm: float) -> dict[str, Any]:
    """What the design came to: layers, pitch_mm, mirrored, rotation_deg always, the rest where it applies."""
    parameters: dict[str, Any] = {
        "name": design.name,
        "layers": shape.layers,
        "pitch_mm": pitch_mm,
        "mirrored": design.mirrored,
        "rotation_deg": design.rotation_deg,
    }
    for option in sorted(registered_patterns()[design.pattern].options):
        parameters[option] = getattr(shape, option)
    if design.clip != "none":
        fields = ("clip", "clip_width_mm", "clip_height_mm", "clip_diameter_mm")
        parameters |= {f: getattr(design, f) for f in fields if getattr(design, f) is not None}
    return parameters


def _round_points(points: Points) -> Points:
    """Rounded as layouts are, and without negative zeros, so that every machine writes the same digits."""
    return np.round(points, DECIMALS) + 0.0
