"""The process sheet of a mold: what to weigh, the operations in order with their parts, and the bill of materials."""

from __future__ import annotations

from collections.abc import Sequence

from cmpdesign.layout.checks import Finding
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.materials.weighing import (
    Weighing,
    cure_table,
    mix_tables,
    mixing_checks,
    silicone_materials,
    weigh,
)
from cmpdesign.products.mold.make import mold_figures, pad_sizes_mm
from cmpdesign.products.mold.parts import Part
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack
from cmpdesign.products.process_sheet.steps import NeededMaterial, ProcessSheet, Step, materials_table

_FOOTNOTE = (
    "* assumed. The value is a field of the silicone's file: copy templates/silicones/NAME.toml, change the value and "
    "its source, and name the file in the design (mold.base_silicone, marker_silicone, cover_silicone)."
)


def weighings(stack: MoldStack) -> tuple[Weighing, ...]:
    """What is weighed, in the order of pouring."""
    base, marker, cover = stack.silicones
    of_layer = {SILICONE_LAYERS[0]: base, SILICONE_LAYERS[2]: cover}
    return tuple(
        weigh(name, of_layer.get(name, marker), volume_mm3, dough=name == COLORS[BLACK])
        for name, volume_mm3 in mold_figures(stack)["pour_mm3"].items()
    )


def process_sheet(
    name: str, stack: MoldStack, parts: Sequence[Part], findings: Sequence[Finding]
) -> ProcessSheet:
    """The pages, whose pictures are those of ``mold_pictures``."""
    mixes = {one.name: one for one in weighings(stack)}
    steps = [
        Step(
            "Buy and make",
            ("All lines of the table are at hand; their part numbers are written in.",),
            (materials_table(bill_of_materials(stack, parts)),),
        ),
        Step(
            "Get ready",
            (
                "Degrease all parts with isopropanol, and let them dry.",
                "Put a drop of each silicone on a part of each material, and see it cure.",
                "Spray release agent on everything but the pins.",
                "Press the four pins into the base: they stand so that no part fits turned.",
            ),
            warnings=tuple(map(str, findings)),
            pictures=("exploded",),
        ),
        _base_step(stack, mixes[SILICONE_LAYERS[0]]),
        _black_step(stack, mixes[COLORS[BLACK]]),
        *(_color_step(stack, mixes[COLORS[color]]) for color in stack.colors),
        _clean_step(stack),
        _cover_step(stack, mixes[SILICONE_LAYERS[2]]),
        _demold_step(),
    ]
    return ProcessSheet(f"Casting {name}", (_side_text(stack),), tuple(steps), _FOOTNOTE)


def bill_of_materials(stack: MoldStack, parts: Sequence[Part]) -> tuple[NeededMaterial, ...]:
    """All that the mold and one pad need."""
    tool = stack.options.tool
    made = [
        NeededMaterial(f"mold part {one.name}", f"made of {tool}", 1, "piece")
        for one in parts
        if one.name != "pin"
    ]
    return (
        *silicone_materials(weighings(stack)),
        *made,
        NeededMaterial(f"dowel pin, {stack.pin_diameter_mm:g} mm", "register of the parts", 4, "piece"),
        NeededMaterial("screw M3", "jack screws that lift lid and plates", 2, "piece"),
        NeededMaterial("release agent, isopropanol, cups, gloves", "consumables", 1, "set"),
    )


def _side_text(stack: MoldStack) -> str:
    """The camera's side, the layer that must be clear, and the widening of the pad."""
    seen = seen_side(stack.layout.mirrored)
    base, _, cover = (silicone.name for silicone in stack.silicones)
    sizes = pad_sizes_mm(stack)
    narrow, wide = (f"{sizes[face][0]:.2f} x {sizes[face][1]:.2f} mm" for face in ("back", "cover"))
    lies = "as designed" if seen == "back" else "turned over"
    return (
        f"The camera sees the pattern's {seen}, through the base layer: {base} must be clear and without pigment; the "
        f"cover ({cover}) may be pigmented. Seen from above, the pattern lies {lies}. Walls have a draft of "
        f"{stack.options.draft_deg:g} degrees, so the pad widens from {narrow} at its back to {wide} at the cover."
    )


def _base_step(stack: MoldStack, mix: Weighing) -> Step:
    return Step(
        f"Base layer: {mix.silicone.name}",
        (
            *mixing_checks(mix),
            "Pour it into the base.",
            "Lower the lid on from one side.",
            "What is too much leaves through the vents and over the land into the moat.",
            "Cure level, as the table says.",
            "Lift the lid with the two jack screws (M3).",
        ),
        mix_tables(mix, stack.options.tool),
        pictures=("base-above", "lid-below"),
    )


def _black_step(stack: MoldStack, mix: Weighing) -> Step:
    pot_life = mix.silicone.pot_life_min.stated("min")
    spread = (
        "Spread it over the dome; the plates shape it."
        if stack.crown
        else "Draw it off flush with the frame."
    )
    return Step(
        "Black layer: a dough for the bosses",
        (
            "Lay the frame on the base.",
            *mixing_checks(mix),
            spread,
            f"Emboss all colors while it is a dough; without retarder the pot life is {pot_life}.",
        ),
        mix_tables(mix, stack.options.tool),
        pictures=("frame-above", "base-above"),
    )


def _color_step(stack: MoldStack, mix: Weighing) -> Step:
    level = "Wipe along the dome with a soft card." if stack.crown else "Draw off flush."
    return Step(
        f"Color: {mix.name}",
        (
            f"Press the plate boss-{mix.name} down until it lies on the frame: its bosses stand on the base layer.",
            "Let the dough set; lift the plate straight up by its jack screws.",
            *mixing_checks(mix),
            f"Lay stencil-{mix.name} on, and wipe the {mix.name} silicone through it.",
            "Put under vacuum until bubbles have left, and wipe again.",
            f"Lift the stencil. {level}",
        ),
        mix_tables(mix, stack.options.tool),
        pictures=(f"boss-{mix.name}-above", f"stencil-{mix.name}-above"),
    )


def _clean_step(stack: MoldStack) -> Step:
    marker, cover = stack.silicones[1], stack.silicones[2]
    warnings = (
        (
            f"{cover.name} may not cure on {marker.name}: {marker.cure} against {cover.cure}; use one chemistry",
        )
        if marker.cure != cover.cure
        else ()
    )
    return Step(
        "Cure and clean the marker layer",
        (
            "Cure the marker layer fully, as the table says: uncured rests inhibit the cover.",
            "Wipe the surface with isopropanol and a cloth without lint; let it dry for 10 minutes.",
            "Look at it through a magnifier: no cell is open, no color lies on another.",
            "Photograph it, and run cmpdesign verify: a fault is easier to mend before the cover is cast.",
        ),
        (cure_table(marker, stack.options.tool),),
        warnings,
    )


def _cover_step(stack: MoldStack, mix: Weighing) -> Step:
    return Step(
        f"Protective layer: {mix.silicone.name}",
        (
            "Lay the cover frame on.",
            *mixing_checks(mix),
            "Pour the protective layer, and close with the lid.",
            "Cure as the table says.",
        ),
        mix_tables(mix, stack.options.tool),
        pictures=("cover-above", "lid-below"),
    )


def _demold_step() -> Step:
    return Step(
        "Demold and try",
        (
            "Take lid, cover and frame off.",
            "Peel the pad from the base, starting at a corner.",
            "Cut the vents' plugs off.",
            "Wash the pad with soap and water, wipe it with isopropanol, and let it dry.",
            "Read it: cmpdesign verify layout.json photo.png",
        ),
        pictures=("base-below",),
    )
