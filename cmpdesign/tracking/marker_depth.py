"""What a rig file says of the place of the pattern: how far it lies below the touched surface."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.errors import CmpDesignError
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
    document = parse_toml(read_text(path), str(path))
    elastomer = document.get("elastomer", _table(document, "contact").get("elastomer"))
    if not isinstance(elastomer, Mapping):
        return None
    value = elastomer.get("marker_depth_mm", 0.0)
    try:
        depth_mm = parse_length_mm(value)
    except ValueError as error:
        raise CmpDesignError(f"{path}: elastomer.marker_depth_mm: {error}") from None
    if depth_mm < 0:
        raise CmpDesignError(f"{path}: elastomer.marker_depth_mm is {depth_mm:g} mm; expected 0 or more")
    return depth_mm


def _table(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = document.get(name)
    return found if isinstance(found, Mapping) else {}
