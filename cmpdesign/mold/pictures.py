"""Pictures of the mold: every part from two sides, and the assembly exploded along its pins."""

from __future__ import annotations

from collections.abc import Sequence

from cmpdesign.mold.parts import Part
from cmpdesign.writers.mesh_png import ABOVE, BELOW, View, meshes_to_png
from cmpdesign.writers.meshes import Mesh

SIZE_PX = (560, 400)
EXPLODED_PX = (800, 1150)
APART_MM = 9.0
EXPLODED = View(-60.0, 22.0)


def part_pictures(meshes: Sequence[Mesh]) -> dict[str, bytes]:
    """``part-above.png`` and ``part-below.png`` of every part."""
    views = {"above": ABOVE, "below": BELOW}
    return {
        f"{mesh.name}-{side}.png": meshes_to_png([mesh], view, SIZE_PX)
        for mesh in meshes
        for side, view in views.items()
    }


def exploded(parts: Sequence[Part], meshes: Sequence[Mesh]) -> list[Mesh]:
    """The parts above each other in the order of use, turned as they are used, the pins over the base."""
    placed: list[Mesh] = []
    top = 0.0
    for part, mesh in _in_order(parts, meshes):
        turned = mesh.moved(0.0, 0.0, 0.0, part.turned)
        low, high = float(turned.points[:, 2].min()), float(turned.points[:, 2].max())
        places = part.stack.pins_mm.tolist() if part.name == "pin" else [(0.0, 0.0)]
        placed += [turned.moved(x, y, top - low) for x, y in places]
        top += high - low + APART_MM
    return placed


def exploded_png(parts: Sequence[Part], meshes: Sequence[Mesh]) -> bytes:
    """The assembly's picture."""
    return meshes_to_png(exploded(parts, meshes), EXPLODED, EXPLODED_PX)


def _in_order(parts: Sequence[Part], meshes: Sequence[Mesh]) -> list[tuple[Part, Mesh]]:
    """Base, pins, then the others."""
    pairs = list(zip(parts, meshes, strict=True))
    pins = [pair for pair in pairs if pair[0].name == "pin"]
    others = [pair for pair in pairs if pair[0].name != "pin"]
    return [others[0], *pins, *others[1:]]
