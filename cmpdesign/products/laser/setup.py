"""The setup of a job: the design's options, completed from the files of machine and material."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cmpdesign.design.laser_options import LaserOptions
from cmpdesign.errors import DesignError
from cmpdesign.products.laser.library import (
    Machine,
    Material,
    Settings,
    load_machine,
    load_material,
    settings_on,
)
from cmpdesign.products.materials.sourced import Sourced

# Default spacing of lines and rings, as a share of the kerf at the bottom: no ridge can stay.
HATCH_SHARE = 0.5
# Least kerf at the bottom for the default spacing.
SMALLEST_MM = 0.001


@dataclass(frozen=True)
class LaserSetup:
    """Machine, material and settings of a job; lengths in mm.

    Attributes:
        options: options of the design.
        machine, material: contents of their files.
        kerf_x_mm, kerf_y_mm: kerf at the front, of cuts along y and along x; both 0: paths are not compensated.
        taper_deg: angle of each wall against the beam.
        depth_mm: depth of the cavities.
        power_percent, speed_mm_s, repeats: settings of the passes of cells.
        cut_power_percent, cut_speed_mm_s, cut_repeats: settings of holes and outline, which go through the sheet.
        hatch_mm: spacing of a pocket's lines or rings.
        minimum_web_mm: the narrowest wall that does not break.
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

    @property
    def compensated(self) -> bool:
        """True if paths keep a distance from the outlines; else the paths are the outlines."""
        return self.kerf_x_mm > 0


def complete_setup(options: LaserOptions) -> LaserSetup:
    """Complete the options from the files of machine and material.

    Raises:
        DesignError: an unknown machine or material, or a material without settings for the machine or the mode.
    """
    machine, material = load_machine(options.machine), load_material(options.material)
    settings = settings_on(material, options.machine)
    both_mm = options.kerf_mm
    kerf_x_mm = both_mm if both_mm is not None else options.kerf_x_mm or settings.kerf_x_mm.value
    kerf_y_mm = both_mm if both_mm is not None else options.kerf_y_mm or settings.kerf_y_mm.value
    depth_mm = options.depth_mm or material.thickness_mm.value
    taper_deg = settings.taper_deg.value if options.taper_deg is None else options.taper_deg
    bottom_mm = min(kerf_x_mm, kerf_y_mm) - 2 * depth_mm * math.tan(math.radians(taper_deg))
    web_mm = options.minimum_web_mm
    return LaserSetup(
        options=options,
        machine=machine,
        material=material,
        kerf_x_mm=kerf_x_mm,
        kerf_y_mm=kerf_y_mm,
        taper_deg=taper_deg,
        depth_mm=depth_mm,
        power_percent=options.power_percent or _cell_setting(options, material, "power_percent"),
        speed_mm_s=options.speed_mm_s or _cell_setting(options, material, "speed_mm_s"),
        repeats=options.passes or _cell_repeats(options, material, depth_mm),
        cut_power_percent=settings.cut_power_percent.value,
        cut_speed_mm_s=settings.cut_speed_mm_s.value,
        cut_repeats=settings.cut_passes.value,
        hatch_mm=options.hatch_mm or math.floor(1e4 * HATCH_SHARE * max(bottom_mm, SMALLEST_MM)) / 1e4,
        minimum_web_mm=material.minimum_web_mm.value if web_mm is None else web_mm,
        assumed=_assumed_values(options, material, settings),
    )


def _cell_repeats(options: LaserOptions, material: Material, depth_mm: float) -> int:
    """Passes over the cells."""
    if options.mode != "pocket":
        return settings_on(material, options.machine).cut_passes.value
    return math.ceil(depth_mm / _cell_setting(options, material, "depth_per_pass_mm") - 1e-9)


def _cell_setting(options: LaserOptions, material: Material, name: str) -> float:
    """A setting of the material for the cells in the mode of the job.

    Raises:
        DesignError: the material's file leaves the setting out.
    """
    field = f"{'pocket' if options.mode == 'pocket' else 'cut'}_{name}"
    found: Sourced[float] | None = getattr(settings_on(material, options.machine), field)
    if found is None:
        option = "passes" if name == "depth_per_pass_mm" else name
        raise DesignError(
            f'laser.mode = "{options.mode}": the material {material.name!r} has no {field} for this machine; add '
            f'{field} = {{ value = ..., source = "..." }} to its file, or set laser.{option}'
        )
    return found.value


def _assumed_values(options: LaserOptions, material: Material, settings: Settings) -> tuple[str, ...]:
    """Names of the files' values with an assumed source that no option overrides."""
    kind = "pocket" if options.mode == "pocket" else "cut"
    passes = "pocket_depth_per_pass_mm" if options.mode == "pocket" else "cut_passes"
    given = {
        "kerf_x_mm": options.kerf_x_mm if options.kerf_mm is None else options.kerf_mm,
        "kerf_y_mm": options.kerf_y_mm if options.kerf_mm is None else options.kerf_mm,
        "taper_deg": options.taper_deg,
        f"{kind}_power_percent": options.power_percent,
        f"{kind}_speed_mm_s": options.speed_mm_s,
        passes: options.passes,
    }
    names = [
        name
        for name, value in given.items()
        if value is None and getattr(settings, name).source.startswith("assumed")
    ]
    if options.minimum_web_mm is None and material.minimum_web_mm.source.startswith("assumed"):
        names.append("minimum_web_mm")
    if options.depth_mm is None and material.thickness_mm.source.startswith("assumed"):
        names.append("thickness_mm")
    return tuple(names)
