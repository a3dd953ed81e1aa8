"""The plan of a data set: a TOML file with designs, distributions and a number of frames; checked before any work."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from cmpdesign import __version__
from cmpdesign.data.folder import Prepared, plan_digest
from cmpdesign.data.frames.distributions import Source, check_distributions, draw
from cmpdesign.data.frames.inputs import take_inputs
from cmpdesign.data.records import (
    FORMAT_FRAMES,
    MAX_DESIGNS,
    MAX_FRAMES,
    MAX_FRAMES_A_SHARD,
    ImageTable,
    MarkersTable,
)
from cmpdesign.design.design import load_design
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.layout_json import layout_to_json, pattern_digest
from cmpdesign.inputs.documents import read_toml, require_plain_values
from cmpdesign.inputs.names import Line, Name
from cmpdesign.inputs.records import Record
from cmpdesign.inputs.validation import validation_message
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.reading.read_layout import read_layout
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.files.scene_file import scene_from_document

TRIALS = 32  # documents that are drawn and checked, without solving or drawing, before the work begins
NOT_IN_SCENE = {
    "seed": "every frame has its own seed",
    "sequence": "every frame of a data set is one picture",
}


class PlanError(CmpDesignError, ValueError):
    """A plan that cannot be carried out."""


class PlanTable(Record):
    """A whole plan."""

    name: Name = ""
    description: Line = ""
    frames: int = Field(ge=1, le=MAX_FRAMES)
    frames_a_shard: int = Field(1000, ge=1, le=MAX_FRAMES_A_SHARD)
    seed: int = Field(0, ge=0)
    designs: list[str] = Field(min_length=1, max_length=MAX_DESIGNS)
    weights: list[float] | None = None
    largest_strain: float | None = Field(
        None, gt=0, description="Contacts of a larger strain are drawn anew; null: no limit."
    )
    image: ImageTable = Field(default_factory=lambda: ImageTable.model_validate({}))
    markers: MarkersTable = Field(default_factory=lambda: MarkersTable.model_validate({}))
    scene: dict[str, Any]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.frames % self.frames_a_shard:
            more = -(-self.frames // self.frames_a_shard) * self.frames_a_shard
            raise ValueError(
                f"frames is {self.frames}; it must be a multiple of frames_a_shard, {self.frames_a_shard}, "
                f"as in {more}, so that a data set can grow"
            )
        for name, reason in NOT_IN_SCENE.items():
            if name in self.scene:
                raise ValueError(f"scene.{name} is not allowed in a plan: {reason}; leave it out")
        sensor = self.scene.get("sensor")
        if isinstance(sensor, Mapping) and self.image.kind == "jpeg":
            for key in {"jpeg_quality", "bits"} & sensor.keys():
                if sensor[key] != 8:
                    raise ValueError(
                        f'scene.sensor.{key} is not allowed with image.kind = "jpeg", which compresses 8 bits; '
                        'leave it out, or take image.kind = "png"'
                    )
        return self


@dataclass(frozen=True, eq=False)
class NamedLayout:
    """A design of a plan and its layout."""

    name: str
    layout: Layout


def prepare_plan(path: str | Path, inputs_from: Sequence[str | Path] = ()) -> Prepared:
    """Read and check a plan: designs, distributions, and scenes of some draws, without solving or drawing.

    Args:
        path: the TOML file.
        inputs_from: folders, beside the plan's own, whose height maps and pictures the plan may name.

    Raises:
        CmpDesignError: a value that cannot be carried out; the message names the file and the key.
    """
    path = Path(path)
    document = read_toml(path)
    try:
        table = PlanTable.model_validate(document)
    except ValidationError as error:
        raise PlanError(f"{path}: {validation_message(error, PlanTable)}") from None
    try:
        check_distributions(design_choice(table.designs, table.weights), "designs")
        check_distributions(table.scene, "scene")
    except CmpDesignError as error:
        raise PlanError(f"{path}: {error}") from None
    layouts = [_read_design(name, path.parent) for name in table.designs]
    _require_different_names(layouts, path)
    if table.markers.read:
        _require_readable(layouts, path)
    require_plain_values(table.scene, f"{path}: scene", finite=True)
    scene, inputs = take_inputs(table.scene, path, inputs_from)
    _try_scenes(table.scene, [each.layout for each in layouts], path)
    files = {f"layouts/{each.name}.json": layout_to_json(each.layout).encode() for each in layouts} | inputs
    plan = _plan_document(table, scene, layouts, inputs)
    return Prepared(plan | {"digest": plan_digest(plan)}, files)


def design_choice(designs: Sequence[Any], weights: Sequence[float] | None) -> dict[str, Any]:
    """The distribution of a frame's design: its place among the designs."""
    choice: dict[str, Any] = {"choice": list(range(len(designs)))}
    return choice if weights is None else choice | {"weights": list(weights)}


def _plan_document(
    table: PlanTable, scene: Mapping[str, Any], layouts: list[NamedLayout], inputs: Mapping[str, bytes]
) -> dict[str, Any]:
    """The object of plan.json, without its digest."""
    return {
        "format": FORMAT_FRAMES,
        "version": 1,
        "made_with": f"cmpdesign {__version__}",
        "name": table.name,
        "description": table.description,
        "frames": table.frames,
        "frames_a_shard": table.frames_a_shard,
        "seed": table.seed,
        "image": table.image.model_dump(),
        "markers": table.markers.model_dump(),
        "designs": [
            {"name": each.name, "layout": f"layouts/{each.name}.json", "digest": pattern_digest(each.layout)}
            for each in layouts
        ],
        "weights": table.weights,
        "largest_strain": table.largest_strain,
        "inputs": {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()},
        "scene": scene,
    }


def _read_design(name: str, folder: Path) -> NamedLayout:
    """A template, a design file, or a layout file; paths start at the plan's folder."""
    path = folder / name
    if path.suffix == ".json":
        return NamedLayout(path.stem, read_layout(path))
    has_file = bool(path.suffix) or len(Path(name).parts) > 1
    return NamedLayout(path.stem, build_layout(load_design(path if has_file else name)))


def _require_different_names(layouts: list[NamedLayout], path: Path) -> None:
    names = [each.name for each in layouts]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise PlanError(f"{path}: designs has two designs of the name {twice}; rename one of the files")


def _require_readable(layouts: list[NamedLayout], path: Path) -> None:
    for each in layouts:
        if each.layout.cell_corners.shape[1] != 3:
            raise PlanError(
                f"{path}: the design {each.name} has no triangles and cannot be read; leave it out, or set "
                "markers.read = false"
            )


class _Ends:
    """Draws one end of every range."""

    def __init__(self, value: float) -> None:
        self._value = value

    def random(self) -> float:
        return self._value

    def standard_normal(self) -> float:
        return 6 * self._value - 3


def _try_scenes(scene: Mapping[str, Any], layouts: list[Layout], path: Path) -> None:
    """Check the scenes at both ends of all ranges, and of some draws."""
    rng = np.random.default_rng(0)
    sources: list[Source] = [_Ends(0.0), _Ends(1.0 - 2**-53), *[rng] * TRIALS]
    for number, source in enumerate(sources):
        drawn = draw(scene, source)
        if not isinstance(drawn, dict):
            raise PlanError(f"{path}: scene is no table in a draw; give a table, or a choice of tables")
        try:
            scene_from_document(drawn, path, layouts[number % len(layouts)])
        except SceneError as error:
            raise PlanError(f"{error} (in a scene that the plan can draw)") from None
