"""A new pattern: one function gives the places of the markers; all other parts follow from it.

    python examples/my_own_pattern.py

To use the pattern on the command line, put the function into a file of cmpdesign/patterns/.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import cmpdesign
from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints
from extractor import Extractor

TURN_DEG = 8.0  # from layer to layer


@register_pattern("swirl", TRIANGULAR_GRAPHS)
def swirl_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """Circles one pitch apart, each turned against the next, so that no gridline is radial."""
    angle = np.radians(120 - 60 * index / np.maximum(layer, 1) + TURN_DEG * layer)
    return np.asarray(layer[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def main() -> None:
    design = cmpdesign.Design(name="swirl", pattern="swirl", layers=6, pitch_mm=1.5)
    print(*design.check().findings or ["can be made and read"], sep="\n")
    design.write("swirl")
    seen = cmpdesign.render(design.layout, pitch_px=30, noise=2)
    markers = Extractor(design.layout).extract(seen.image)
    error_px = np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)
    print(f"{np.isfinite(error_px).sum()} of {len(error_px)} markers, error {np.nanmean(error_px):.4f} px")


if __name__ == "__main__":
    main()
