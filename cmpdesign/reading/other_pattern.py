"""The number of layers of a pattern in an image that does not fit the layout.

A pattern of more layers than the layout has hides the white cell from a search by the layout, and a pattern of fewer
layers has no outer markers. The number is confirmed by a reading of the image with a pattern of this number of layers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.graphs import MAX_LAYERS

if TYPE_CHECKING:
    from cmpdesign.files.images import Image
    from extractor.layout.reference import Reference
    from extractor.result import Markers

# Least share of the markers of the counted layers, and of the outermost, that must be measured.
MIN_COUNTED_SHARE = 0.75
# Colored cells of n layers: three triangles in every sextant of the first layer, six more with each further layer.
CELLS_PER_LAYERS_SQUARED = 3


def other_pattern_reason(reference: Reference, image: Image, markers: Markers) -> str | None:
    """One sentence on a pattern of another number of layers; None if the image does not confirm another number.

    Args:
        reference: the layout, of triangles.
        image: (H, W, 3) BGR.
        markers: result of the extraction, which was not verified.
    """
    if reference.cell_corners.shape[1] != 3 or not reference.present.all():
        return None
    layers = _layers_measured(reference, image, markers) or _layers_counted(image, markers)
    if layers is None or layers == reference.layers:
        return None
    return (
        f"the pattern in the picture does not fit the layout: it has {layers} layers, the layout {reference.layers}; "
        "give the layout of this pattern"
    )


def _layers_measured(reference: Reference, image: Image, markers: Markers) -> int | None:
    """The number of layers, where nearly all markers up to one layer are measured and no marker beyond; else None.

    The pattern must end within the image: the next layer would lie within the image, too.
    """
    found = np.isfinite(markers.xy_px[:, 0])
    if not found.any():
        return None
    outermost = int(reference.layer[found].max())
    measured = markers.status == 1
    least = min(measured[reference.layer <= outermost].mean(), measured[reference.layer == outermost].mean())
    if outermost < 1 or least < MIN_COUNTED_SHARE:
        return None
    ends = markers.xy_px[reference.edges]
    edge_px = float(np.nanmax(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))
    low, high = np.nanmin(markers.xy_px, axis=0), np.nanmax(markers.xy_px, axis=0)
    is_inside = (low > edge_px).all() and (high < np.array(image.shape[1::-1]) - 1 - edge_px).all()
    return outermost if is_inside else None


def _layers_counted(image: Image, markers: Markers) -> int | None:
    """The number of layers by the count of cells, where an extraction with this number confirms the number; else
    None.
    """
    from extractor import Extractor, parse_layout

    walk = markers.stages.get("walk")
    if walk is None:
        return None
    layers = round(float(np.sqrt(np.count_nonzero(walk.part >= 0) / CELLS_PER_LAYERS_SQUARED)))
    if not 1 <= layers <= MAX_LAYERS:
        return None
    for pattern in registered_patterns():
        design = Design.model_validate({"pattern": pattern, "layers": layers, "pitch_mm": 1.0})
        other = parse_layout(layout_to_json(build_layout(design)))
        if other.cell_corners.shape[1] != 3:
            continue
        measured = _layers_measured(other, image, Extractor(other, side="either").extract(image))
        if measured is not None:
            return measured
    return None
