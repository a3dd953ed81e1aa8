"""Construction of a layout from a design."""

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
from cmpdesign.patterns.pad_code import PadCode, coded_graph

MAX_VIRTUAL_MARKERS = 4_000_000  # of a layout; readers refuse more


def build_layout(design: Design) -> Layout:
    """Build the layout of a design: every marker, cell and edge, in the layout frame (mm).

    A clip outline removes cells, and edges without a remaining cell. All markers stay, because a marker's
    position in the arrays is its id. ``Layout.present`` marks the markers that can be seen.

    Raises:
        DesignError: the sizes cannot be resolved, there are too many virtual markers, the layers have no such code, or
            the clip outline removes the reference cell or one of its neighbours.

    >>> from cmpdesign import load
    >>> layout = build_layout(load("honeycomb", {"layers": "10", "pitch_mm": "1.5"}))
    >>> len(layout.marker_xy_mm), len(layout.cell_corners), len(layout.edges)
    (331, 600, 930)
    >>> layout.size_mm
    (32.309401076, 27.980762114)
    """
    shape, pitch_mm = resolve_size(design)
    pattern = registered_patterns()[design.pattern]
    graph = pattern.graph.make_graph(shape.layers)
    code = PadCode(design.code, design.code_share) if design.code else None
    if code is not None:
        graph = coded_graph(graph, code)
    turn = rotation_matrix(design.rotation_deg).T
    xy_mm = pitch_mm * (pattern.positions(graph.layer, graph.index, shape) @ turn)
    centre_mm = pitch_mm * (pattern_centre(design, shape) @ turn)

    if design.clip == "none":
        corners = rim_corners(design, shape)
        outline_mm = pitch_mm * corners + design.border_mm * corner_offsets(corners)
    else:
        outline_mm = clip_outline(design)
        graph = _clip_graph(design, graph, xy_mm - centre_mm)

    edges = _edges(graph.corners)
    _require_few_virtual_markers(design, len(edges))
    return Layout(
        pattern=design.pattern,
        parameters=_layout_parameters(design, shape, pitch_mm),
        marker_layer=graph.layer.astype(np.int32),
        marker_index=graph.index.astype(np.int32),
        marker_xy_mm=_round_points(xy_mm),
        cell_corners=graph.corners.astype(np.int32),
        cell_color=graph.color,
        edges=edges,
        virtual_per_edge=design.virtual_per_edge,
        reference_cell=graph.reference_cell,
        reference_marker=graph.reference_marker,
        palette=design.palette.model_dump(),
        border_mm=design.border_mm,
        outline_mm=_round_points(outline_mm + centre_mm),
        fiducials_mm=_round_points(fiducial_positions(design.fiducials, outline_mm + centre_mm)),
        fiducial_diameter_mm=design.fiducials.diameter_mm if design.fiducials.count else 0.0,
        code=code,
    )


def _require_few_virtual_markers(design: Design, edges: int) -> None:
    if design.virtual_per_edge * edges > MAX_VIRTUAL_MARKERS:
        raise DesignError(
            f"virtual_per_edge = {design.virtual_per_edge} on {edges} edges is more than {MAX_VIRTUAL_MARKERS} "
            f"virtual markers, which readers refuse; make it at most {MAX_VIRTUAL_MARKERS // edges}"
        )


def _clip_graph(design: Design, graph: MarkerGraph, xy_mm: Points) -> MarkerGraph:
    """The graph without the cells that cross the clip outline less its border; ``xy_mm`` is relative to the centre."""
    # A tolerance of one picometre keeps a cell that exactly fills the window.
    tolerance_mm = 10**-DECIMALS
    if design.clip == "circle":
        limit_mm = clip_outline(design, design.border_mm)[0, 0]
        inside = np.hypot(*xy_mm.T) <= limit_mm + tolerance_mm
    else:
        limit_mm = clip_outline(design, design.border_mm).max(axis=0)
        inside = (np.abs(xy_mm) <= limit_mm + tolerance_mm).all(axis=1)
    keep = inside[graph.corners].all(axis=1)
    if not keep[graph.reference_cell]:
        raise DesignError(
            f"the {design.clip} clip outline, less a border of {design.border_mm:g} mm, cuts the reference "
            "cell away: no marker could be numbered; make the outline larger or the pitch smaller"
        )
    if not _is_reference_surrounded(graph, keep):
        raise DesignError(
            f"the {design.clip} clip outline, less a border of {design.border_mm:g} mm, cuts cells around "
            "the reference cell away; make the outline larger or the pitch smaller"
        )
    reference = int(np.count_nonzero(keep[: graph.reference_cell]))
    return replace(graph, corners=graph.corners[keep], color=graph.color[keep], reference_cell=reference)


def _is_reference_surrounded(graph: MarkerGraph, keep: NDArray[np.bool_]) -> bool:
    """True when every cell that shares a side with the reference cell is kept. Numbering starts at these cells."""
    shared = np.isin(graph.corners, graph.corners[graph.reference_cell]).sum(axis=1)
    return bool(keep[shared >= 2].all())


def _edges(corners: Ints) -> NDArray[np.int32]:
    """(E, 2) int32: the sides of all cells, each once, from the smaller to the larger id, in ascending order."""
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    low, high = sides.min(axis=1), sides.max(axis=1)
    base = int(high.max()) + 1
    return np.stack(np.divmod(np.unique(low * base + high), base), axis=-1).astype(np.int32)


def _layout_parameters(design: Design, shape: PatternShape, pitch_mm: float) -> dict[str, Any]:
    """The resolved parameters: always layers, pitch_mm, mirrored, rotation_deg; others where they apply."""
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
    """Points rounded to ``DECIMALS``, without negative zeros, so that every machine writes the same digits."""
    return np.round(points, DECIMALS) + 0.0
