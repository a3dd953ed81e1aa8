"""Small plans of data sets, and data sets compared byte by byte."""

from __future__ import annotations

from pathlib import Path

from cmpdesign.data.folder import open_folder, write_manifest
from cmpdesign.data.frames.plan import prepare_plan
from cmpdesign.data.shard import make_shard

DESIGN = 'pattern = "honeycomb"\nlayers = 3\npitch_mm = 2.0\nvirtual_per_edge = 1\nmirrored = true\n'
PLAN = """
name = "small"
frames = {frames}
frames_a_shard = {frames_a_shard}
designs = ["small.toml"]

[image]
kind = "{kind}"

[scene]
size_px = [200, 180]

[scene.camera]
pitch_px = {{uniform = [22, 24]}}

[scene.contact]
grid = 64
size_mm = [16, 16]
friction = 0

[scene.contact.elastomer]
thickness_mm = 3
young_mpa = 0.2

[scene.contact.indenter]
choice = [
  {{kind = "ball", radius_mm = {{uniform = [3, 5]}}, centre_mm = [{{uniform = [-2, 2]}}, 0]}},
  {{kind = "cube", side_mm = 4, edge_radius_mm = 0.5}},
]

[scene.contact.motion]
press_mm = {{uniform = [0.1, 0.3]}}

[scene.sensor]
noise = {{whole = [1, 2]}}

[scene.damage]
blobs = {{repeat = {{whole = [0, 2]}}, of = {{centre_mm = [{{uniform = [-3, 3]}}, 0], radius_mm = 0.2}}}}
"""


def write_plan(
    folder: Path, *, frames: int = 4, frames_a_shard: int = 2, kind: str = "png", more: str = ""
) -> Path:
    """Write a plan and its design; the plan's file."""
    (folder / "small.toml").write_text(DESIGN, encoding="utf-8")
    path = folder / "plan.toml"
    text = PLAN.format(frames=frames, frames_a_shard=frames_a_shard, kind=kind) + more
    path.write_text(text, encoding="utf-8")
    return path


def make_serially(plan: Path, folder: Path) -> Path:
    """Make a data set in this process, shard after shard; its folder."""
    prepared = prepare_plan(plan)
    open_folder(folder, prepared)
    for number in range(prepared.shards):
        make_shard(str(folder), number)
    write_manifest(folder)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder by their names in it."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}
