"""The files that a plan names beside its shards: layouts, height maps, pictures. Their digests are in the plan."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.errors import InputError
from cmpdesign.files.layout_json import pattern_digest
from cmpdesign.inputs.files import read_file
from cmpdesign.reading.read_layout import layout_from_reference
from extractor import Reference, load_layout


def named_layouts(folder: Path, plan: Mapping[str, Any]) -> dict[str, Reference]:
    """The layouts by the designs' names; of an extraction one layout with the name "".

    Raises:
        InputError: a layout is not the plan's.
        extractor.LayoutError: a layout cannot be read.
    """
    if "designs" not in plan:
        return {"": _named_layout(folder, plan["layout"]["file"], plan["layout"]["digest"])}
    return {
        about["name"]: _named_layout(folder, about["layout"], about["digest"]) for about in plan["designs"]
    }


def _named_layout(folder: Path, name: str, digest: str) -> Reference:
    reference = load_layout(folder / name)
    if pattern_digest(layout_from_reference(reference)) != digest:
        raise _changed(folder / name)
    return reference


def check_inputs(folder: Path, plan: Mapping[str, Any]) -> None:
    """Compare height maps and pictures with the plan's digests.

    Raises:
        InputError: a file is missing, or is not the plan's.
    """
    for name, digest in plan.get("inputs", {}).items():
        if hashlib.sha256(read_file(folder / name)).hexdigest() != digest:
            raise _changed(folder / name)


def check_named_files(folder: Path, plan: Mapping[str, Any]) -> None:
    """Compare all files that a plan names with the plan; errors as for ``named_layouts`` and ``check_inputs``."""
    named_layouts(folder, plan)
    check_inputs(folder, plan)


def _changed(path: Path) -> InputError:
    return InputError(
        f"{path} was changed: its digest is not the plan's; delete the file, and the command that made the data set "
        "writes it again"
    )
