"""Green's matrix of one pad, for ``extractor.contact``: displacement of the markers by loads on the touched face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.patch_response import patch_response
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import require
from cmpdesign.contact.finite_block.walls import WallResponse, inside_outline
from extractor.contact import Gel
from extractor.layout.layout_file import LayoutLike, layout_of

Array = NDArray[np.float64]
LOADS_PER_PITCH = 2  # of the square grid of loads, along a neighbouring distance of markers
LOAD_WIDTH = 0.5  # in units of the spacing of the loads; their sum is uniform to 2 %, at a depth of one spacing to 1e-3
MAX_MARKERS, MAX_LOADS = 1500, 4000
AREA_SAMPLES = 24  # along each axis of the square of a load whose part inside the outline is counted


def make_gel(layout: LayoutLike, elastomer: Elastomer, *, margin_mm: float = 0.0) -> Gel:
    """Green's matrix of a pad whose gel ends at the layout's outline.

    Args:
        layout: the pad.
        elastomer: thickness, Poisson's ratio and marker depth. Young's modulus has no influence.
        margin_mm: width of the gel beyond the layout's outline.

    Raises:
        ContactError: too many markers or loads, or a negative margin.
    """
    reference = layout_of(layout)
    require(len(reference.xy_mm) <= MAX_MARKERS, "markers", len(reference.xy_mm), f"at most {MAX_MARKERS}")
    require(margin_mm >= 0, "margin_mm", margin_mm, "0 or more")
    outline = _widened(reference.outline_mm, margin_mm)
    edges = np.linalg.norm(np.diff(reference.xy_mm[reference.edges], axis=1)[:, 0], axis=1)
    spacing = float(np.median(edges)) / LOADS_PER_PITCH
    loads, area = _loads(outline, spacing)
    require(len(loads) <= MAX_LOADS, "loads", len(loads), f"at most {MAX_LOADS}; take a larger pitch")
    width = LOAD_WIDTH * spacing
    unit = replace(elastomer, young_mpa=1.0)
    reach = float(np.linalg.norm(np.ptp(outline, axis=0)))
    endless = patch_response(unit, width, unit.marker_depth_mm, reach).matrix(reference.xy_mm, loads)
    change = WallResponse(unit, outline, reference.xy_mm).matrix(loads, width)
    return Gel(
        layout_digest=reference.digest,
        thickness_mm=unit.thickness_mm,
        poisson=unit.poisson,
        marker_depth_mm=unit.marker_depth_mm,
        margin_mm=margin_mm,
        outline_mm=outline,
        loads_mm=loads,
        spacing_mm=spacing,
        width_mm=width,
        area_mm2=area,
        matrix=(endless + change).astype(np.float32),
    )


def _widened(outline_mm: Array, margin_mm: float) -> Array:
    from cmpdesign.layout.outline import corner_offsets

    return outline_mm if margin_mm == 0 else outline_mm + margin_mm * corner_offsets(outline_mm)


def _loads(outline_mm: Array, spacing_mm: float) -> tuple[Array, Array]:
    """Centres (K, 2) of a square grid inside the outline, and the integral (K,) mm^2 of each load inside it."""
    low, high = outline_mm.min(axis=0), outline_mm.max(axis=0)
    axes = [
        spacing_mm * np.arange(np.ceil(a / spacing_mm), np.floor(b / spacing_mm) + 1)
        for a, b in zip(low, high, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    loads = grid[inside_outline(outline_mm, grid) > 0]
    width = LOAD_WIDTH * spacing_mm
    offset = 4 * width * (2 * (np.arange(AREA_SAMPLES) + 0.5) / AREA_SAMPLES - 1)
    square = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    weight = np.exp(-0.5 * (square**2).sum(axis=1) / width**2) * (offset[1] - offset[0]) ** 2
    inside = inside_outline(outline_mm, (loads[:, None] + square).reshape(-1, 2)).reshape(len(loads), -1)
    return loads, inside @ weight
