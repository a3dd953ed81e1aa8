"""The product "mold": a STEP file for every part and one of all steps, each part checked first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmpdesign.design.design import Design
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.mold.checks import (
    boss_volume_mm3,
    check_mold,
    facet_sag_mm,
    moat_to_pin_mm,
    plate_web_mm,
    require_no_errors,
)
from cmpdesign.products.mold.finish import finish_parts
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack, make_stack
from cmpdesign.products.mold.step.assembly import Assembly, PartPlace, assembly_to_step
from cmpdesign.products.registry import ProductFiles

FOLDER = "mold"
# Free space between the steps of the assembly.
OPERATION_SPACING_MM = 10.0
BASE_OPERATION = "1-base"


def make_mold(design: Design, layout: Layout) -> ProductFiles:
    """Every part's STEP file and the assembly's.

    Raises:
        DesignError: what cannot be made, before any solid is built.
        MoldError: a solid that is open, invalid or of another volume than computed.
    """
    stack = make_stack(design, layout)
    findings = check_mold(stack)
    require_no_errors(findings)
    parts = make_parts(stack)
    made = finish_parts(design, layout, parts)
    steps = {name: part.step for name, part in made.items()}
    files: dict[str, str | bytes] = {f"{FOLDER}/{name}.step": step for name, step in steps.items()}
    files[f"{FOLDER}/assembly.step"] = assembly_to_step(make_assembly(stack, parts), steps)
    summary = {"parts": {name: part.figures for name, part in made.items()}, **mold_figures(stack)}
    return ProductFiles(files, summary, tuple(findings))


def mold_figures(stack: MoldStack) -> dict[str, Any]:
    """What is mixed and poured, and the clearances."""
    pad = [_layer_volume_mm3(stack, layer) for layer in range(3)]
    fillings = {COLORS[color]: boss_volume_mm3(stack, color) for color in stack.colors}
    pours = {
        SILICONE_LAYERS[0]: pad[0],
        "black": pad[1] - sum(fillings.values()),
        **fillings,
        SILICONE_LAYERS[2]: pad[2],
    }
    web, plate = plate_web_mm(stack)
    return {
        "scale": {
            layer: round(s.scale, 9) for layer, s in zip(SILICONE_LAYERS, stack.silicones, strict=True)
        },
        "thickness_mm": {
            layer: round(t, 6) for layer, t in zip(SILICONE_LAYERS, stack.thickness_mm, strict=True)
        },
        "parting_z_mm": [round(z, 6) for z in (stack.z_base_mm, stack.z_marker_mm, stack.z_cover_mm)],
        "pour_mm3": {name: round(volume, 3) for name, volume in pours.items()},
        "clearance_mm": {
            "pin to hole, each side": stack.options.clearance_mm / 2,
            "stencil to cavity, each side": stack.options.clearance_mm,
            "moat to pin hole": round(moat_to_pin_mm(stack), 6),
            f"between bosses of one plate ({plate})": round(web, 6),
            # Below zero: flat tips press a crowned base layer.
            "boss tips to base layer, at least": -round(facet_sag_mm(stack), 6) + 0.0,
        },
    }


def _layer_volume_mm3(stack: MoldStack, layer: int) -> float:
    from cmpdesign.products.mold.solids.loops import frustum_volume_mm3

    volume = frustum_volume_mm3(*stack.edges(layer), stack.thickness_mm[layer])
    return volume


def make_assembly(stack: MoldStack, parts: Sequence[Part]) -> Assembly:
    """One group a step of the work, side by side along x; in each, the parts lie where they are used."""
    by_name = {part.name: part for part in parts}
    width = float(stack.block.points[:, 0].max() - stack.block.points[:, 0].min()) + OPERATION_SPACING_MM
    groups = []
    for number, (name, members) in enumerate(operations_of(stack).items()):
        x = number * width
        places = [_place_part(by_name[member], x, name) for member in members]
        for index, (pin_x, pin_y) in enumerate(stack.pins_mm.tolist(), start=1):
            pin = by_name["pin"]
            places.append(PartPlace("pin", f"{name}-pin-{index}", (x + pin_x, pin_y, pin.z_mm)))
        groups.append(Assembly(name, places))
    return Assembly("assembly", (), groups)


def _place_part(part: Part, x: float, step: str) -> PartPlace:
    # Over the base alone, the lid lies a frame and a cover lower than over the finished pad.
    z = part.stack.z_base_mm if (part.name, step) == ("lid", BASE_OPERATION) else part.z_mm
    return PartPlace(part.name, f"{step}-{part.name}", (x, 0.0, z), part.turned)


def operations_of(stack: MoldStack) -> dict[str, tuple[str, ...]]:
    """The steps of the work, and the parts that lie on each other in each."""
    steps: dict[str, tuple[str, ...]] = {BASE_OPERATION: ("base", "lid")}
    for color in stack.colors:
        name = COLORS[color]
        steps[f"{len(steps) + 1}-emboss-{name}"] = ("base", "frame", f"boss-{name}")
        steps[f"{len(steps) + 1}-fill-{name}"] = ("base", "frame", f"stencil-{name}")
    steps[f"{len(steps) + 1}-cover"] = ("base", "frame", "cover", "lid")
    return steps
