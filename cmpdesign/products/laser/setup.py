"""What a job is made with: the options, completed from the machine's and the material's files."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cmpdesign.design.laser_options import LaserOptions
from cmpdesign.products.laser.library import (
    Machine,
    Material,
    Settings,
    load_machine,
    load_material,
    settings_on,
)

# Without a spacing of their own, lines and rings lie half of the bottom's kerf apart, so that no ridge can
# stay.
HATCH_SHARE = 0.5
SMALLEST_MM = 0.001


@dataclass(frozen=True)
class LaserSetup:
    """Everything about machine, material and way of carving; lengths in mm.

    Attributes:
        options: as the design gives them.
        machine, material: from their files.
        kerf_x_mm, kerf_y_mm: at the front, of cuts that run in y and in x.
        taper_deg: lean of each wall.
        depth_mm: of the cavities.
        power_percent, speed_mm_s, repeats: of the cells' passes.
        cut_power_percent, cut_speed_mm_s, cut_repeats: of holes and outline, which always go through.
        hatch_mm: spacing of a pocket's lines or rings.
        minimum_web_mm: the narrowest wall that holds.
        assumed: names of the values in use whose source begins with "assumed".
    """

    options: LaserOptions
    machine: Machine
    material: Material
    kerf_x_mm: float
    kerf_y_mm: float
    taper_deg: float
    depth_mm: float
    power_percent: float
    speed_mm_s: float
    repeats: int
    cut_power_percent: float
    cut_speed_mm_s: float
    cut_repeats: int
    hatch_mm: float
    minimum_web_mm: float
    assumed: tuple[str, ...]


def complete_setup(options: LaserOptions) -> LaserSetup:
    """The options with what the machine's and the material's files add.

    Raises:
        DesignError: an unknown machine or material, or one that does not carve the other.
    """
    machine, material = load_machine(options.machine), load_material(options.material)
    found = settings_on(material, options.machine)
    kerf_x_mm = options.kerf_mm or options.kerf_x_mm or found.kerf_x_mm.value
    kerf_y_mm = options.kerf_mm or options.kerf_y_mm or found.kerf_y_mm.value
    depth_mm = options.depth_mm or material.thickness_mm.value
    taper_deg = found.taper_deg.value if options.taper_deg is None else options.taper_deg
    bottom_mm = min(kerf_x_mm, kerf_y_mm) - 2 * depth_mm * math.tan(math.radians(taper_deg))
    pocket = options.mode == "pocket"
    layers = math.ceil(depth_mm / found.pocket_depth_per_pass_mm.value - 1e-9)
    web_mm = options.minimum_web_mm
    return LaserSetup(
        options=options,
        machine=machine,
        material=material,
        kerf_x_mm=kerf_x_mm,
        kerf_y_mm=kerf_y_mm,
        taper_deg=taper_deg,
        depth_mm=depth_mm,
        power_percent=options.power_percent
        or (found.pocket_power_percent if pocket else found.cut_power_percent).value,
        speed_mm_s=options.speed_mm_s or (found.pocket_speed_mm_s if pocket else found.cut_speed_mm_s).value,
        repeats=options.passes or (layers if pocket else found.cut_passes.value),
        cut_power_percent=found.cut_power_percent.value,
        cut_speed_mm_s=found.cut_speed_mm_s.value,
        cut_repeats=found.cut_passes.value,
        hatch_mm=options.hatch_mm or math.floor(1e4 * HATCH_SHARE * max(bottom_mm, SMALLEST_MM)) / 1e4,
        minimum_web_mm=material.minimum_web_mm.value if web_mm is None else web_mm,
        assumed=_assumed_values(options, material, found),
    )


def _assumed_values(options: LaserOptions, material: Material, found: Settings) -> tuple[str, ...]:
    """Values from the files that nobody measured and no option overrides."""
    kind = "pocket" if options.mode == "pocket" else "cut"
    steps = "pocket_depth_per_pass_mm" if options.mode == "pocket" else "cut_passes"
    given = {
        "kerf_x_mm": options.kerf_mm or options.kerf_x_mm,
        "kerf_y_mm": options.kerf_mm or options.kerf_y_mm,
        "taper_deg": options.taper_deg,
        f"{kind}_power_percent": options.power_percent,
        f"{kind}_speed_mm_s": options.speed_mm_s,
        steps: options.passes,
    }
    names = [
        name
        for name, value in given.items()
        if value is None and getattr(found, name).source.startswith("assumed")
    ]
    if options.minimum_web_mm is None and material.minimum_web_mm.source.startswith("assumed"):
        names.append("minimum_web_mm")
    if options.depth_mm is None and material.thickness_mm.source.startswith("assumed"):
        names.append("thickness_mm")
    return tuple(names)
