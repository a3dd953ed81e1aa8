"""Machines and materials: TOML files in which every value has a source, or the word "assumed"."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from cmpdesign.design.quantities import Length, LengthOrZero
from cmpdesign.design.templates import templates_folder
from cmpdesign.errors import DesignError, InputError
from cmpdesign.inputs.documents import read_toml
from cmpdesign.inputs.files import path_exists
from cmpdesign.inputs.names import Line, Name, nearest_name
from cmpdesign.inputs.validation import validation_message
from cmpdesign.products.materials.sourced import Sourced, StrictModel, assumed

Model = TypeVar("Model", bound=BaseModel)
Positive = Annotated[float, Field(gt=0, le=1e6)]
Percent = Annotated[float, Field(gt=0, le=100)]
Lean = Annotated[float, Field(gt=-45, lt=45)]
Count = Annotated[int, Field(ge=1, le=200, strict=True)]


class Machine(StrictModel):
    """A laser machine; ``s_max`` is the S word of full power (GRBL's $30)."""

    name: Name
    kind: Literal["co2", "diode", "fibre", "uv"]
    power_w: Sourced[Positive]
    bed_width_mm: Sourced[Length]
    bed_height_mm: Sourced[Length]
    spot_mm: Sourced[Length]
    s_max: Sourced[Positive]
    speed_max_mm_s: Sourced[Positive]
    travel_mm_s: Sourced[Positive]
    acceleration_mm_s2: Sourced[Positive]


class Settings(StrictModel):
    """The settings of one machine for one material.

    Kerf is the full width at the front: ``kerf_x_mm`` of cuts along y, ``kerf_y_mm`` of cuts along x. The settings of
    pockets are needed for jobs with mode = "pocket" only.
    """

    kerf_x_mm: Sourced[Length]
    kerf_y_mm: Sourced[Length]
    taper_deg: Sourced[Lean]
    cut_power_percent: Sourced[Percent]
    cut_speed_mm_s: Sourced[Positive]
    cut_passes: Sourced[Count]
    pocket_power_percent: Sourced[Percent] | None = None
    pocket_speed_mm_s: Sourced[Positive] | None = None
    pocket_depth_per_pass_mm: Sourced[Length] | None = None


class Material(StrictModel):
    """A silicone sheet, with the settings of each machine that can carve it.

    ``chemistry`` is that of the sheet; ``fill_silicone`` names the silicone that fills the cavities, or its TOML file.
    """

    name: Name
    thickness_mm: Sourced[Length]
    minimum_web_mm: Sourced[LengthOrZero]
    chemistry: Sourced[Literal["platinum", "tin"]] = assumed("platinum")
    fill_silicone: Sourced[Line] = assumed("ecoflex-00-30")
    fill: Line
    cure: Line
    fumes: Line
    on: Mapping[Name, Settings]


def machines() -> dict[str, Path]:
    """The TOML file of every machine template, by name."""
    return {path.stem: path for path in sorted((templates_folder() / "machines").glob("*.toml"))}


def materials() -> dict[str, Path]:
    """The TOML file of every material template, by name."""
    return {path.stem: path for path in sorted((templates_folder() / "materials").glob("*.toml"))}


def load_machine(name_or_path: str) -> Machine:
    """Load a machine template by name, or a machine from a TOML file.

    Raises:
        DesignError: unknown machine, or a file that does not describe a machine.
    """
    return _load_file(Machine, name_or_path, machines(), "machine")


def load_material(name_or_path: str) -> Material:
    """Load a material template by name, or a material from a TOML file.

    Raises:
        DesignError: unknown material, or a file that does not describe a material.
    """
    return _load_file(Material, name_or_path, materials(), "material")


def settings_on(material: Material, machine_name: str) -> Settings:
    """The material's settings on a machine; the name of a machine's TOML file is its stem.

    Raises:
        DesignError: the material has no settings for this machine.
    """
    name = Path(machine_name).stem if machine_name.endswith(".toml") else machine_name
    if name not in material.on:
        raise DesignError(
            f"laser.machine = {name!r}: the material {material.name!r} has no settings for this machine, only for "
            f"{', '.join(material.on)}; choose one of these, another material, or add [on.{name}] to its file"
        )
    return material.on[name]


def _load_file(model: type[Model], name_or_path: str, known: Mapping[str, Path], kind: str) -> Model:
    path = known.get(name_or_path, Path(name_or_path))
    if not path_exists(path):
        raise DesignError(
            f"laser.{kind} = {name_or_path!r}: no such {kind}{nearest_name(name_or_path, known)}; there are "
            f"{', '.join(known)}, or give a TOML file"
        )
    try:
        return model.model_validate(read_toml(path))
    except InputError as error:
        raise DesignError(f"laser.{kind}: {error}") from None
    except ValidationError as error:
        raise DesignError(f"laser.{kind}: {path}: {validation_message(error, model)}") from None
