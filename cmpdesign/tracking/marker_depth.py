"""The depth of the pattern below the touched surface, and the elastic layer, from a rig file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.inputs.files import read_text
from cmpdesign.units import parse_length_mm


def read_marker_depth_mm(path: Path) -> float | None:
    """``marker_depth_mm`` in mm of the [elastomer] of a sensor file, or the [contact.elastomer] of a scene file.

    None where the file describes no elastomer, as rig files of views alone. An elastomer without the key has 0.

    Raises:
        InputError: the file cannot be read, or is no TOML.
        CmpDesignError: the depth is no number from 0.
    """
    elastomer = _read_table(path)
    return (
        None
        if elastomer is None
        else _length_mm(path, "marker_depth_mm", elastomer.get("marker_depth_mm", 0.0))
    )


def read_elastomer(path: Path) -> Elastomer:
    """The layer of the same table, for displacements alone: its Young's modulus is 1 MPa.

    Raises:
        InputError: the file cannot be read, or is no TOML.
        CmpDesignError: the file has no such table, or a value is missing or out of range.
    """
    table = _read_table(path)
    if table is None or "thickness_mm" not in table:
        raise CmpDesignError(
            f"{path} has no [elastomer] with thickness_mm, which is needed to compute the touched surface; "
            f"add thickness_mm, marker_depth_mm and poisson, or leave out {parameter('surface')}"
        )
    lengths = {
        name: _length_mm(path, name, table.get(name, 0.0)) for name in ("thickness_mm", "marker_depth_mm")
    }
    poisson = table.get("poisson", 0.5)
    if not isinstance(poisson, int | float) or isinstance(poisson, bool):
        raise CmpDesignError(f"{path}: elastomer.poisson is {poisson!r}; expected a number from 0 to 0.5")
    return Elastomer(lengths["thickness_mm"], 1.0, float(poisson), lengths["marker_depth_mm"])


class ForceConstants(NamedTuple):
    """What forces need of an elastomer beside its Green's matrix.

    Attributes:
        young_mpa, young_sigma_mpa: Young's modulus and its deviation; 0 if not given.
        friction: coefficient of friction; None if not given.
    """

    young_mpa: float
    young_sigma_mpa: float
    friction: float | None


def read_force_constants(path: Path) -> ForceConstants:
    """``young_mpa``, ``young_sigma_mpa`` and ``friction`` of the same table.

    Raises:
        InputError: the file cannot be read, or is no TOML.
        CmpDesignError: the modulus is missing, or a value is no number above 0.
    """
    table = _read_table(path) or {}
    found: dict[str, float] = {}
    for name in ("young_mpa", "young_sigma_mpa", "friction"):
        if name not in table and name != "young_mpa":
            continue
        value = table.get(name)
        good = isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < float("inf")
        if not isinstance(value, int | float) or not good or (value == 0 and name != "young_sigma_mpa"):
            raise CmpDesignError(
                f"{path}: elastomer.{name} is {value!r}; forces need numbers above 0, and Young's modulus in MPa, "
                "as `cmpdesign calibrate force` measures it"
            )
        found[name] = float(value)
    return ForceConstants(found["young_mpa"], found.get("young_sigma_mpa", 0.0), found.get("friction"))


def _length_mm(path: Path, name: str, value: object) -> float:
    try:
        length_mm = parse_length_mm(value)
    except ValueError as error:
        raise CmpDesignError(f"{path}: elastomer.{name}: {error}") from None
    if length_mm < 0:
        raise CmpDesignError(f"{path}: elastomer.{name} is {length_mm:g} mm; expected 0 or more")
    return length_mm


def _read_table(path: Path) -> Mapping[str, Any] | None:
    document = parse_toml(read_text(path), str(path))
    elastomer = document.get("elastomer", _table(document, "contact").get("elastomer"))
    return elastomer if isinstance(elastomer, Mapping) else None


def _table(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = document.get(name)
    return found if isinstance(found, Mapping) else {}
