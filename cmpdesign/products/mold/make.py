"""The product "mold": a STEP file for every part and one of all operations; each part is checked first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.mold.checks.findings import (
    boss_volume_mm3,
    check_mold,
    facet_sag_mm,
    moat_to_pin_mm,
    plate_web_mm,
    require_no_errors,
)
from cmpdesign.products.mold.finish import finish_parts
from cmpdesign.products.mold.made_pad import made_pad
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.solids.loops import frustum_volume_mm3
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack, make_stack
from cmpdesign.products.mold.step.assembly import Assembly, PartPlace, assembly_to_step
from cmpdesign.products.registry import PreparedProduct, ProductFiles

FOLDER = "mold"
# Gap between the operations in the assembly.
OPERATION_SPACING_MM = 10.0
BASE_OPERATION = "1-base"


def prepare_mold(design: Design, layout: Layout) -> PreparedProduct:
    """The STEP files of every part and of the assembly, and the pad as cast; no solid is built yet.

    Raises:
        DesignError: the mold cannot be made.
    """
    stack = make_stack(design, layout)
    findings = check_mold(stack)
    require_no_errors(findings)

    def make() -> ProductFiles:
        """Build the solids; a ``MoldError`` for one that is open, invalid or of another volume than computed."""
        parts = make_parts(stack)
        finished = finish_parts(design, layout, parts)
        step_files = {name: part.step_file for name, part in finished.items()}
        files: dict[str, str | bytes] = {f"{FOLDER}/{name}.step": data for name, data in step_files.items()}
        files[f"{FOLDER}/assembly.step"] = assembly_to_step(make_assembly(stack, parts), step_files)
        figures = {"parts": {name: part.figures for name, part in finished.items()}, **mold_figures(stack)}
        return ProductFiles(files, figures, tuple(findings))

    return PreparedProduct(make, made_pad(layout, stack))


def mold_figures(stack: MoldStack) -> dict[str, Any]:
    """The figures of a mold for the report: scales, thicknesses, levels, pours and clearances."""
    volumes = [
        frustum_volume_mm3(*stack.edges(silicone_layer), stack.thickness_mm[silicone_layer])
        for silicone_layer in range(3)
    ]
    fillings = {COLORS[color]: boss_volume_mm3(stack, color) for color in stack.colors}
    pours = {
        SILICONE_LAYERS[0]: volumes[0],
        "black": volumes[1] - sum(fillings.values()),
        **fillings,
        SILICONE_LAYERS[2]: volumes[2],
    }
    web, plate = plate_web_mm(stack)
    return {
        "scale": {name: round(s.scale, 9) for name, s in zip(SILICONE_LAYERS, stack.silicones, strict=True)},
        "thickness_mm": {
            name: round(t, 6) for name, t in zip(SILICONE_LAYERS, stack.thickness_mm, strict=True)
        },
        "parting_z_mm": [round(z, 6) for z in (stack.z_base_mm, stack.z_marker_mm, stack.z_cover_mm)],
        "pad_mm": {name: [round(side, 6) for side in size] for name, size in pad_sizes_mm(stack).items()},
        "pour_mm3": {name: round(volume, 3) for name, volume in pours.items()},
        "clearance_mm": {
            "pin to hole, each side": stack.options.clearance_mm / 2,
            "stencil to cavity, each side": stack.options.clearance_mm,
            "moat to pin hole": round(moat_to_pin_mm(stack), 6),
            f"between bosses of one plate ({plate})": round(web, 6),
            # Negative: flat tips of bosses press a crowned base layer.
            "boss tips to base layer, at least": -round(facet_sag_mm(stack), 6) + 0.0,
        },
    }


def pad_sizes_mm(stack: MoldStack) -> dict[str, tuple[float, float]]:
    """Width and height of the cured pad at its back and at the face of its cover: it widens by the draft."""
    faces = {"back": stack.edges(0)[0], "cover": stack.edges(2)[1]}
    scales = {"back": stack.silicones[0].scale, "cover": stack.silicones[2].scale}
    sizes = {name: np.ptp(edge.points, axis=0) / scales[name] for name, edge in faces.items()}
    return {name: (float(size[0]), float(size[1])) for name, size in sizes.items()}


def make_assembly(stack: MoldStack, parts: Sequence[Part]) -> Assembly:
    """One group per operation, side by side along x; in each group the parts lie where the operation uses them."""
    by_name = {part.name: part for part in parts}
    width = float(stack.block.points[:, 0].max() - stack.block.points[:, 0].min()) + OPERATION_SPACING_MM
    groups = []
    for number, (name, members) in enumerate(operations_of(stack).items()):
        x = number * width
        places = [_part_place(by_name[member], x, name) for member in members]
        for index, (pin_x, pin_y) in enumerate(stack.pins_mm.tolist(), start=1):
            pin = by_name["pin"]
            places.append(PartPlace("pin", f"{name}-pin-{index}", (x + pin_x, pin_y, pin.z_mm)))
        groups.append(Assembly(name, places))
    return Assembly("assembly", (), groups)


def _part_place(part: Part, x: float, operation: str) -> PartPlace:
    # Over the base alone, the lid lies lower than over the finished pad, by the frame and the cover.
    z = part.stack.z_base_mm if (part.name, operation) == ("lid", BASE_OPERATION) else part.z_mm
    return PartPlace(part.name, f"{operation}-{part.name}", (x, 0.0, z), part.turned)


def operations_of(stack: MoldStack) -> dict[str, tuple[str, ...]]:
    """The names of the operations in order, each with the parts that lie on each other."""
    operations: dict[str, tuple[str, ...]] = {BASE_OPERATION: ("base", "lid")}
    for color in stack.colors:
        name = COLORS[color]
        operations[f"{len(operations) + 1}-emboss-{name}"] = ("base", "frame", f"boss-{name}")
        operations[f"{len(operations) + 1}-fill-{name}"] = ("base", "frame", f"stencil-{name}")
    operations[f"{len(operations) + 1}-cover"] = ("base", "frame", "cover", "lid")
    return operations
