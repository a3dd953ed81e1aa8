"""The process sheet of a mold: what to weigh, the operations in order with their parts, and the bill of materials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cmpdesign.layout.checks import Finding
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.library import Sourced
from cmpdesign.products.mold.make import mold_figures, pad_sizes_mm
from cmpdesign.products.mold.parts import Part
from cmpdesign.products.mold.stack.silicones import Silicone
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack
from cmpdesign.products.process_sheet.steps import Material, ProcessSheet, Step, Table, materials_table

# Less than a gram of either part cannot be weighed to a percent on a scale of 0.01 g.
LEAST_PART_G = 1.0
# A tenth of a gram of an additive is weighed to a tenth on this scale.
LEAST_ADDITIVE_G = 0.1
ROOM_DEG_C = 23
# Temperature at which a tool's parts begin to yield, degrees Celsius: usual glass transitions of PLA, PETG and of
# standard resins, less 10; metals stand every cure.
WARMEST_DEG_C = {"fdm-pla": 50.0, "fdm-petg": 65.0, "sla-resin": 60.0}
_ASSUMED = " *"
_FOOTNOTE = (
    "* assumed. The value is a field of the silicone's file: copy templates/silicones/NAME.toml, change the value and "
    "its source, and name the file in the design (mold.base_silicone, marker_silicone, cover_silicone)."
)


@dataclass(frozen=True)
class Weighing:
    """What is weighed for one layer or color, g.

    Attributes:
        name: the layer or color.
        silicone: its silicone.
        cast_g: mass that the cavity holds.
        a_g, b_g: parts A and B.
        pigment_g, retarder_g, thickener_g: additives; 0 where there are none.
    """

    name: str
    silicone: Silicone
    cast_g: float
    a_g: float
    b_g: float
    pigment_g: float
    retarder_g: float
    thickener_g: float

    @property
    def mix_g(self) -> float:
        """Mass of the whole mixture."""
        return self.a_g + self.b_g + self.pigment_g + self.retarder_g + self.thickener_g


def weighings(stack: MoldStack) -> tuple[Weighing, ...]:
    """What is weighed, in the order of pouring.

    A mixture is the cast mass and the losses, but at least so much that the smaller part weighs ``LEAST_PART_G``
    and every additive ``LEAST_ADDITIVE_G``.
    """
    base, marker, cover = stack.silicones
    of_layer = {SILICONE_LAYERS[0]: base, SILICONE_LAYERS[2]: cover}
    return tuple(
        _weighing(name, of_layer.get(name, marker), volume_mm3)
        for name, volume_mm3 in mold_figures(stack)["pour_mm3"].items()
    )


def _weighing(name: str, silicone: Silicone, volume_mm3: float) -> Weighing:
    cast_g = volume_mm3 * silicone.density_g_cm3.value / 1000
    pigment = silicone.pigment_percent.value / 100 if name in COLORS else 0.0
    is_dough = name == COLORS[BLACK]
    retarder = silicone.retarder_percent.value / 100 if is_dough else 0.0
    thickener = silicone.thickener_percent.value / 100 if is_dough else 0.0
    a, b = silicone.parts_a_b.value
    wanted_g = cast_g * (1 + silicone.loss_percent.value / 100) / (1 + pigment + retarder + thickener)
    added = [LEAST_ADDITIVE_G / share for share in (pigment, retarder, thickener) if share]
    both_g = max(wanted_g, LEAST_PART_G * (a + b) / min(a, b), *added)
    a_g, b_g = both_g * a / (a + b), both_g * b / (a + b)
    return Weighing(name, silicone, cast_g, a_g, b_g, pigment * both_g, retarder * both_g, thickener * both_g)


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


def bill_of_materials(stack: MoldStack, parts: Sequence[Part]) -> tuple[Material, ...]:
    """All that the mold and one pad need."""
    masses: dict[tuple[str, str], float] = {}
    for one in weighings(stack):
        amounts: dict[str, float] = {
            f"{one.silicone.name}, part A": one.a_g,
            f"{one.silicone.name}, part B": one.b_g,
            f"pigment paste, {one.name}": one.pigment_g,
            "retarder": one.retarder_g,
            "thickener (thixotropic agent)": one.thickener_g,
        }
        for item, mass_g in amounts.items():
            use = "silicone layers" if ", part " in item else f"{one.name} layer"
            masses[item, use] = masses.get((item, use), 0.0) + mass_g
    silicone = [Material(item, use, mass_g, "g") for (item, use), mass_g in masses.items() if mass_g > 0]
    tool = stack.options.tool
    made = [
        Material(f"mold part {one.name}", f"made of {tool}", 1, "piece") for one in parts if one.name != "pin"
    ]
    return (
        *silicone,
        *made,
        Material(f"dowel pin, {stack.pin_diameter_mm:g} mm", "register of the parts", 4, "piece"),
        Material("screw M3", "jack screws that lift lid and plates", 2, "piece"),
        Material("release agent, isopropanol, cups, gloves", "consumables", 1, "set"),
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
            *_mixing_checks(mix),
            "Pour it into the base.",
            "Lower the lid on from one side.",
            "What is too much leaves through the vents and over the land into the moat.",
            "Cure level, as the table says.",
            "Lift the lid with the two jack screws (M3).",
        ),
        _mix_tables(stack, mix),
        pictures=("base-above", "lid-below"),
    )


def _black_step(stack: MoldStack, mix: Weighing) -> Step:
    pot_life = _stated(mix.silicone.pot_life_min, "min")
    spread = (
        "Spread it over the dome; the plates shape it."
        if stack.crown
        else "Draw it off flush with the frame."
    )
    return Step(
        "Black layer: a dough for the bosses",
        (
            "Lay the frame on the base.",
            *_mixing_checks(mix),
            spread,
            f"Emboss all colors while it is a dough; without retarder the pot life is {pot_life}.",
        ),
        _mix_tables(stack, mix),
        pictures=("frame-above", "base-above"),
    )


def _color_step(stack: MoldStack, mix: Weighing) -> Step:
    level = "Wipe along the dome with a soft card." if stack.crown else "Draw off flush."
    return Step(
        f"Color: {mix.name}",
        (
            f"Press the plate boss-{mix.name} down until it lies on the frame: its bosses stand on the base layer.",
            "Let the dough set; lift the plate straight up by its jack screws.",
            *_mixing_checks(mix),
            f"Lay stencil-{mix.name} on, and wipe the {mix.name} silicone through it.",
            "Put under vacuum until bubbles have left, and wipe again.",
            f"Lift the stencil. {level}",
        ),
        _mix_tables(stack, mix),
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
        (_cure_table(stack, marker),),
        warnings,
    )


def _cover_step(stack: MoldStack, mix: Weighing) -> Step:
    return Step(
        f"Protective layer: {mix.silicone.name}",
        (
            "Lay the cover frame on.",
            *_mixing_checks(mix),
            "Pour the protective layer, and close with the lid.",
            "Cure as the table says.",
        ),
        _mix_tables(stack, mix),
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


def _mixing_checks(mix: Weighing) -> tuple[str, ...]:
    added = [
        f"{mass_g:.2f} g of {what}"
        for what, mass_g in (
            (f"{mix.name} pigment paste", mix.pigment_g),
            ("retarder", mix.retarder_g),
            ("thickener", mix.thickener_g),
        )
        if mass_g
    ]
    return (
        f"Weigh {mix.a_g:.2f} g of A" + (f" and {', '.join(added)}, and stir." if added else "."),
        f"Add {mix.b_g:.2f} g of B, and stir for 2 minutes, the wall and floor of the cup, too.",
        f"Degas: {_stated(mix.silicone.degas_min, 'min')} under vacuum.",
    )


def _mix_tables(stack: MoldStack, mix: Weighing) -> tuple[Table, ...]:
    silicone = mix.silicone
    a, b = silicone.parts_a_b.value
    masses = (
        ("cast", f"{mix.cast_g:.4f} g", f"density {_stated(silicone.density_g_cm3, 'g/cm3')}"),
        ("part A", f"{mix.a_g:.2f} g", f"A : B = {a:g} : {b:g}{_mark(silicone.parts_a_b)}"),
        ("part B", f"{mix.b_g:.2f} g", ""),
        ("pigment paste", f"{mix.pigment_g:.2f} g", f"{_stated(silicone.pigment_percent, '%')} of A and B"),
        ("retarder", f"{mix.retarder_g:.2f} g", f"{_stated(silicone.retarder_percent, '%')} of A and B"),
        ("thickener", f"{mix.thickener_g:.2f} g", f"{_stated(silicone.thickener_percent, '%')} of A and B"),
        ("mixture", f"{mix.mix_g:.2f} g", f"losses {_stated(silicone.loss_percent, '%')}, and at least "
         f"{LEAST_PART_G:g} g of a part, {LEAST_ADDITIVE_G:g} g of an additive"),
    )  # fmt: skip
    used = tuple(row for row in masses if row[1] != "0.00 g")
    return Table((mix.name, "mass", "why"), used), _cure_table(stack, silicone)


def _cure_table(stack: MoldStack, silicone: Silicone) -> Table:
    """The cure at room temperature and at the temperatures of the file, each with what the parts stand."""
    warmest = WARMEST_DEG_C.get(stack.options.tool, math.inf)
    rows = [(f"{ROOM_DEG_C} °C", _stated(silicone.cure_h, "h"), "")]
    for deg_c, hours in silicone.warm_cure.value:
        note = (
            ""
            if deg_c <= warmest
            else f"not in these parts: {stack.options.tool} yields above {warmest:g} °C"
        )
        rows.append((f"{deg_c:g} °C", f"{hours:g} h{_mark(silicone.warm_cure)}", note))
    head = (f"cure of {silicone.name}", f"time; pot life {_stated(silicone.pot_life_min, 'min')}", "")
    return Table(head, tuple(rows))


def _stated(sourced: Sourced[Any], unit: str) -> str:
    return f"{sourced.value:g} {unit}{_mark(sourced)}"


def _mark(sourced: Sourced[Any]) -> str:
    return _ASSUMED if sourced.source.startswith("assumed") else ""
