"""The product "mesh": STL of every part and layer, GLB and 3MF of mold and pad, pictures, job sheet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.files.images import to_png
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mesh.glb import meshes_to_glb
from cmpdesign.products.mesh.stl import mesh_to_stl
from cmpdesign.products.mesh.three_mf import meshes_to_3mf
from cmpdesign.products.mesh.triangles import Mesh
from cmpdesign.products.mold.checks import check_mold, refuse_impossible
from cmpdesign.products.mold.finish import MoldError
from cmpdesign.products.mold.job_sheet import job_sheet
from cmpdesign.products.mold.pad import pad_meshes
from cmpdesign.products.mold.parts import Part, parts_of
from cmpdesign.products.mold.pictures import mold_pictures
from cmpdesign.products.mold.solids.loops import boxes_of
from cmpdesign.products.mold.solids.shells import slab_solid, slab_volume_mm3
from cmpdesign.products.mold.solids.tessellate import chorded, mesh_of_solid
from cmpdesign.products.mold.stack.stack import Stack, stack_of
from cmpdesign.products.registry import Made

FOLDER = "mesh"
# A flat-sided mesh has its volume in closed form; smooth crowns and pins are met within the chords' error.
EXACT, SMOOTH = 1e-9, 5e-3
APART_MM = 5.0
OPACITY = {"base": 0.35, "cover": 0.35}


def make_meshes(design: Design, layout: Layout) -> Made:
    """Meshes of the mold's parts (as they are printed) and of the pad's layers.

    Raises:
        DesignError: what cannot be made.
        MoldError: a mesh that is open, twisted or of another volume than computed.
    """
    stack = stack_of(design, layout)
    findings = check_mold(stack)
    refuse_impossible(findings)
    figures: dict[str, Any] = {}
    parts = parts_of(stack)
    mold = [_checked(f"mold/{part.name}", *part_mesh(part), figures) for part in parts]
    pad = [_checked(f"pad/{mesh.name}", mesh, volume, EXACT, figures) for mesh, volume in pad_meshes(stack)]
    files: dict[str, str | bytes] = {f"{FOLDER}/mold-{mesh.name}.stl": mesh_to_stl(mesh) for mesh in mold}
    files |= {f"{FOLDER}/pad-{mesh.name}.stl": mesh_to_stl(mesh) for mesh in pad}
    laid_out = side_by_side(stack, mold)
    files[f"{FOLDER}/mold.glb"] = meshes_to_glb(laid_out)
    files[f"{FOLDER}/mold.3mf"] = meshes_to_3mf(laid_out, f"{design.name} mold")
    files[f"{FOLDER}/pad.glb"] = meshes_to_glb(pad, OPACITY)
    files[f"{FOLDER}/pad.3mf"] = meshes_to_3mf(pad, f"{design.name} pad")
    pictures = mold_pictures(parts, mold)
    files |= {f"{FOLDER}/pictures/{name}.png": to_png(picture) for name, picture in pictures.items()}
    files[f"{FOLDER}/job-sheet.html"] = job_sheet(design.name, stack, parts, findings)
    return Made(files, figures, tuple(findings), pictures)


def part_mesh(part: Part) -> tuple[Mesh, float, float]:
    """A part's mesh, the volume that it must have, and how nearly."""
    if part.slab is None or part.crown in ("raised", "hollow"):
        return mesh_of_solid(part.name, part.color, part.solid), part.volume_mm3, SMOOTH
    slab = chorded(part.slab)
    if part.crown:
        from cmpdesign.products.mold.shapes.dished import dished_plate, dished_sheet, dished_volume_mm3

        build = dished_plate if part.crown == "plate" else dished_sheet
        volume = dished_volume_mm3(slab, part.dish, part.crown)
        return mesh_of_solid(part.name, part.color, build(slab, part.dish)), volume, EXACT
    return mesh_of_solid(part.name, part.color, slab_solid(slab)), slab_volume_mm3(slab), EXACT


def _checked(name: str, mesh: Mesh, volume: float, tolerance: float, figures: dict[str, Any]) -> Mesh:
    """The mesh, checked by trimesh; its figures are added."""
    import trimesh

    body = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
    error = abs(float(mesh.volume_mm3()) / volume - 1)
    if not body.is_watertight or not body.is_winding_consistent or error > tolerance:
        raise MoldError(
            f"mesh: {name}: watertight {body.is_watertight}, winding consistent "
            f"{body.is_winding_consistent}, volume "
            f"off by {error:.2g}, limit {tolerance:g}; this is a fault of cmpdesign, please report it"
        )
    figures[name] = {
        "triangles": len(mesh.triangles),
        "volume_mm3": round(mesh.volume_mm3(), 6),
        "analytic_mm3": round(volume, 6),
    }
    return mesh


def side_by_side(stack: Stack, meshes: Sequence[Mesh]) -> list[Mesh]:
    """The parts on a plate, four in a row, each standing on z = 0."""
    low, high = boxes_of([stack.block])[0]
    step = high - low + APART_MM
    placed = []
    for number, mesh in enumerate(meshes):
        row, column = divmod(number, 4)
        at = np.array([column, -row]) * step
        placed.append(mesh.moved(float(at[0]), float(at[1]), -float(mesh.points[:, 2].min())))
    return placed
