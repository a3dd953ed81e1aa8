"""What is weighed of a silicone, how it is mixed and cured, and the lines of a process sheet that say so."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.materials.silicones import Silicone
from cmpdesign.products.process_sheet.steps import NeededMaterial, Table

# Less than a gram of either part cannot be weighed to a percent on a scale of 0.01 g.
MIN_PART_G = 1.0
# A tenth of a gram of an additive is weighed to a tenth on this scale.
MIN_ADDITIVE_G = 0.1
ROOM_DEG_C = 23
# Temperature at which a tool's parts begin to yield, degrees Celsius: usual glass transitions of PLA, PETG and of
# standard resins, less 10; metals stand every cure.
WARMEST_DEG_C = {"fdm-pla": 50.0, "fdm-petg": 65.0, "sla-resin": 60.0}


@dataclass(frozen=True)
class Weighing:
    """What is weighed for one layer or color, g.

    Attributes:
        name: the layer or color.
        silicone: its silicone.
        cast_g: mass that the cavities hold.
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


def weigh(name: str, silicone: Silicone, volume_mm3: float, *, dough: bool = False) -> Weighing:
    """What is weighed to fill a volume; a layer with the name of a color has pigment, a dough retarder and thickener.

    A mixture is the cast mass and the losses, but at least so much that the smaller part weighs ``MIN_PART_G``
    and every additive ``MIN_ADDITIVE_G``.
    """
    cast_g = volume_mm3 * silicone.density_g_cm3.value / 1000
    pigment = silicone.pigment_percent.value / 100 if name in COLORS else 0.0
    retarder = silicone.retarder_percent.value / 100 if dough else 0.0
    thickener = silicone.thickener_percent.value / 100 if dough else 0.0
    a, b = silicone.parts_a_b.value
    wanted_g = cast_g * (1 + silicone.loss_percent.value / 100) / (1 + pigment + retarder + thickener)
    added = [MIN_ADDITIVE_G / share for share in (pigment, retarder, thickener) if share]
    both_g = max(wanted_g, MIN_PART_G * (a + b) / min(a, b), *added)
    a_g, b_g = both_g * a / (a + b), both_g * b / (a + b)
    return Weighing(name, silicone, cast_g, a_g, b_g, pigment * both_g, retarder * both_g, thickener * both_g)


def silicone_materials(mixes: Iterable[Weighing]) -> list[NeededMaterial]:
    """The lines of the bill of materials: parts A and B by silicone, additives by layer."""
    masses: dict[tuple[str, str], float] = {}
    for one in mixes:
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
    return [NeededMaterial(item, use, mass_g, "g") for (item, use), mass_g in masses.items() if mass_g > 0]


def mixing_checks(mix: Weighing) -> tuple[str, ...]:
    """The actions of weighing, mixing and degassing."""
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
        f"Degas: {mix.silicone.degas_min.stated('min')} under vacuum.",
    )


def mix_tables(mix: Weighing, tool: str = "") -> tuple[Table, Table]:
    """What is weighed and why, and the cure in parts of a tool."""
    silicone = mix.silicone
    a, b = silicone.parts_a_b.value
    masses = (
        ("cast", f"{mix.cast_g:.4f} g", f"density {silicone.density_g_cm3.stated('g/cm3')}"),
        ("part A", f"{mix.a_g:.2f} g", f"A : B = {a:g} : {b:g}{silicone.parts_a_b.mark}"),
        ("part B", f"{mix.b_g:.2f} g", ""),
        ("pigment paste", f"{mix.pigment_g:.2f} g", f"{silicone.pigment_percent.stated('%')} of A and B"),
        ("retarder", f"{mix.retarder_g:.2f} g", f"{silicone.retarder_percent.stated('%')} of A and B"),
        ("thickener", f"{mix.thickener_g:.2f} g", f"{silicone.thickener_percent.stated('%')} of A and B"),
        ("mixture", f"{mix.mix_g:.2f} g", f"losses {silicone.loss_percent.stated('%')}, and at least "
         f"{MIN_PART_G:g} g of a part, {MIN_ADDITIVE_G:g} g of an additive"),
    )  # fmt: skip
    used = tuple(row for row in masses if row[1] != "0.00 g")
    return Table((mix.name, "mass", "why"), used), cure_table(silicone, tool)


def cure_table(silicone: Silicone, tool: str = "") -> Table:
    """The cure at room temperature and at the temperatures of the file, each with what the parts stand."""
    warmest = WARMEST_DEG_C.get(tool, math.inf)
    rows = [(f"{ROOM_DEG_C} °C", silicone.cure_h.stated("h"), "")]
    for deg_c, hours in silicone.warm_cure.value:
        note = "" if deg_c <= warmest else f"not in these parts: {tool} yields above {warmest:g} °C"
        rows.append((f"{deg_c:g} °C", f"{hours:g} h{silicone.warm_cure.mark}", note))
    head = (f"cure of {silicone.name}", f"time; pot life {silicone.pot_life_min.stated('min')}", "")
    return Table(head, tuple(rows))
