"""Pictures of the mold: every part from two sides, and the assembly exploded along its pins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mesh.picture import ABOVE, BELOW, Framing, PictureDirection, draw_label, draw_meshes
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh
from cmpdesign.products.mold.parts import Part

Image = NDArray[np.uint8]

SIZE_PX = (560, 400)
EXPLODED_PX = (860, 1200)
# Width right of the exploded parts, for their names.
NAMES_PX = 170
EXPLODED_VIEW = PictureDirection(-60.0, 22.0)
# Gap between exploded parts, as a share of their width.
EXPLODED_GAP_SHARE = 0.2
EXPLODED_NAME = "exploded"


def mold_pictures(parts: Sequence[Part], meshes: Sequence[TriangleMesh]) -> dict[str, Image]:
    """The exploded picture, and "<part>-above" and "<part>-below" of every part: (H, W, 3) uint8 BGR."""
    return {EXPLODED_NAME: exploded_picture(parts, meshes), **part_pictures(meshes)}


def part_pictures(meshes: Sequence[TriangleMesh]) -> dict[str, Image]:
    """Pictures of every part from two sides."""
    directions = {"above": ABOVE, "below": BELOW}
    return {
        f"{mesh.name}-{side}": draw_meshes([mesh], direction, SIZE_PX)
        for mesh in meshes
        for side, direction in directions.items()
    }


def exploded_picture(parts: Sequence[Part], meshes: Sequence[TriangleMesh]) -> Image:
    """The picture of the parts above each other, with their names."""
    groups = exploded_meshes(parts, meshes)
    size = (EXPLODED_PX[0] - NAMES_PX, EXPLODED_PX[1])
    placed = [mesh for group in groups.values() for mesh in group]
    framing = Framing.of(placed, EXPLODED_VIEW, size)
    picture = np.full((EXPLODED_PX[1], EXPLODED_PX[0], 3), 255, np.uint8)
    picture[:, : size[0]] = draw_meshes(placed, EXPLODED_VIEW, size)
    for name, group in groups.items():
        points = framing.to_px(np.concatenate([mesh.points for mesh in group]))
        x, y, _ = points[points[:, 0].argmax()]
        text = name if len(group) == 1 else f"{name} ({len(group)})"
        draw_label(picture, text, (x, y), size[0] + 10)
    return picture


def exploded_meshes(
    parts: Sequence[Part], meshes: Sequence[TriangleMesh]
) -> Mapping[str, list[TriangleMesh]]:
    """The meshes above each other in the order of use, turned as in use, the pins over the base.

    Args:
        parts, meshes: the parts and their meshes, in the same order.

    Returns:
        Part name -> its meshes (several for the pins).
    """
    placed: dict[str, list[TriangleMesh]] = {}
    gap = EXPLODED_GAP_SHARE * float(np.ptp(meshes[0].points[:, :2], axis=0).max())
    top = 0.0
    for part, mesh in _parts_in_order(parts, meshes):
        turned = mesh.moved(0.0, 0.0, 0.0, part.turned)
        low, high = float(turned.points[:, 2].min()), float(turned.points[:, 2].max())
        places = part.stack.pins_mm.tolist() if part.name == "pin" else [(0.0, 0.0)]
        placed[part.name] = [turned.moved(x, y, top - low) for x, y in places]
        top += high - low + gap
    return placed


def _parts_in_order(parts: Sequence[Part], meshes: Sequence[TriangleMesh]) -> list[tuple[Part, TriangleMesh]]:
    """Parts with their meshes: base, pins, then the others."""
    pairs = list(zip(parts, meshes, strict=True))
    pins = [pair for pair in pairs if pair[0].name == "pin"]
    others = [pair for pair in pairs if pair[0].name != "pin"]
    return [others[0], *pins, *others[1:]]
