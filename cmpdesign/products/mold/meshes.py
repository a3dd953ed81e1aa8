"""The product "mesh": STL of every part and silicone layer, GLB and 3MF of mold and pad, pictures, job sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.files.images import to_png
from cmpdesign.layout.checks import Finding
from cmpdesign.layout.layout import Layout
from cmpdesign.libraries import extra, require_libraries
from cmpdesign.products.mesh.glb import meshes_to_glb
from cmpdesign.products.mesh.stl import mesh_to_stl
from cmpdesign.products.mesh.three_mf import meshes_to_3mf
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh
from cmpdesign.products.mold.checks.findings import check_mold, require_no_errors
from cmpdesign.products.mold.finish import MoldError
from cmpdesign.products.mold.job_sheet import bill_of_materials, process_sheet
from cmpdesign.products.mold.made_pad import made_pad
from cmpdesign.products.mold.pad import pad_meshes
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.pictures import mold_pictures
from cmpdesign.products.mold.processes import results_of_parts
from cmpdesign.products.mold.solids.loops import bounding_boxes
from cmpdesign.products.mold.solids.slab_shells import make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.solids.tessellate import chorded_slab, tessellate_solid
from cmpdesign.products.mold.stack.stack import MoldStack, make_stack
from cmpdesign.products.process_sheet.html import sheet_to_html
from cmpdesign.products.process_sheet.pdf import sheet_to_pdf
from cmpdesign.products.process_sheet.steps import materials_csv
from cmpdesign.products.registry import PreparedProduct, ProductFiles

FOLDER = "mesh"
# Tolerance of a mesh's volume, as a share: of flat-sided solids, and of smooth crowns and pins (error of chords).
EXACT_TOLERANCE, SMOOTH_TOLERANCE = 1e-9, 5e-3
# Gap between parts in the files of the whole mold.
APART_MM = 5.0
# Opacity of the clear silicone layers.
OPACITY = {"base": 0.35, "cover": 0.35}


def prepare_meshes(design: Design, layout: Layout) -> PreparedProduct:
    """The triangle meshes of the mold's parts (as printed) and of the pad's silicone layers, and the pad as cast.

    Raises:
        DesignError: the mold cannot be made.
    """
    require_libraries("cad", "OCP", "trimesh", "lib3mf", "scipy", "reportlab")
    stack = make_stack(design, layout)
    findings = check_mold(stack)
    require_no_errors(findings)
    return PreparedProduct(partial(_make_meshes, design, layout, stack, findings), made_pad(layout, stack))


def _make_meshes(
    design: Design, layout: Layout, stack: MoldStack, findings: Sequence[Finding]
) -> ProductFiles:
    """Make the files.

    Raises:
        MoldError: a mesh is open, inconsistently wound or of another volume than computed.
    """
    figures: dict[str, Any] = {}
    parts = make_parts(stack)
    meshes: dict[str, PartMesh] = results_of_parts(f"{__name__}:mesh_named_parts", design, layout, parts)
    mold = [_add_checked_figures(f"mold/{name}", *mesh, figures) for name, mesh in meshes.items()]
    pad = [
        _add_checked_figures(f"pad/{mesh.name}", mesh, volume_mm3, EXACT_TOLERANCE, figures)
        for mesh, volume_mm3 in pad_meshes(stack)
    ]
    files: dict[str, str | bytes] = {f"{FOLDER}/mold-{mesh.name}.stl": mesh_to_stl(mesh) for mesh in mold}
    files |= {f"{FOLDER}/pad-{mesh.name}.stl": mesh_to_stl(mesh) for mesh in pad}
    laid_out = place_side_by_side(stack, mold)
    files[f"{FOLDER}/mold.glb"] = meshes_to_glb(laid_out)
    files[f"{FOLDER}/mold.3mf"] = meshes_to_3mf(laid_out, f"{design.name} mold", is_one_piece=False)
    files[f"{FOLDER}/pad.glb"] = meshes_to_glb(pad, OPACITY)
    files[f"{FOLDER}/pad.3mf"] = meshes_to_3mf(pad, f"{design.name} pad", is_one_piece=True)
    pictures = mold_pictures(parts, mold)
    pngs = {name: to_png(picture) for name, picture in pictures.items()}
    files |= {f"{FOLDER}/pictures/{name}.png": png for name, png in pngs.items()}
    sheet = process_sheet(design.name, stack, parts, findings)
    files[f"{FOLDER}/job-sheet.html"] = sheet_to_html(sheet, "pictures")
    files[f"{FOLDER}/job-sheet.pdf"] = sheet_to_pdf(sheet, pngs)
    files[f"{FOLDER}/materials.csv"] = materials_csv(bill_of_materials(stack, parts))
    return ProductFiles(files, figures, tuple(findings), pictures)


class PartMesh(NamedTuple):
    """A triangle mesh, its volume in closed form, and the tolerance of the mesh's volume as a share."""

    mesh: TriangleMesh
    volume_mm3: float
    tolerance: float


def mesh_named_parts(design: Design, layout: Layout, names: Sequence[str]) -> Iterator[PartMesh]:
    """The triangle meshes of the parts of these names, one after the other."""
    parts = {part.name: part for part in make_parts(make_stack(design, layout))}
    for name in names:
        yield make_part_mesh(parts[name])


def make_part_mesh(part: Part) -> PartMesh:
    """The triangle mesh of a part in the part's own frame."""
    if part.slab is None or part.crown in ("raised", "hollow"):
        return PartMesh(
            tessellate_solid(part.name, part.color, part.solid), part.volume_mm3, SMOOTH_TOLERANCE
        )
    slab = chorded_slab(part.slab)
    if part.crown:
        from cmpdesign.products.mold.shapes.dished_solids import (
            dished_plate_solid,
            dished_sheet_solid,
            dished_volume_mm3,
        )

        build = dished_plate_solid if part.crown == "plate" else dished_sheet_solid
        volume = dished_volume_mm3(slab, part.dish, part.crown)
        return PartMesh(
            tessellate_solid(part.name, part.color, build(slab, part.dish)), volume, EXACT_TOLERANCE
        )
    solid = make_slab_solid(slab)
    return PartMesh(tessellate_solid(part.name, part.color, solid), slab_volume_mm3(slab), EXACT_TOLERANCE)


def _add_checked_figures(
    name: str, mesh: TriangleMesh, volume_mm3: float, tolerance: float, figures: dict[str, Any]
) -> TriangleMesh:
    """Check a mesh with trimesh, and add its figures to ``figures``; the mesh.

    Raises:
        MoldError: see ``prepare_meshes``.
    """
    with extra("cad"):
        import trimesh

    body = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
    error = abs(float(mesh.volume_mm3()) / volume_mm3 - 1)
    if not body.is_watertight or not body.is_winding_consistent or error > tolerance:
        raise MoldError(
            f"mesh: {name}: watertight {body.is_watertight}, winding consistent "
            f"{body.is_winding_consistent}, volume "
            f"off by {error:.2g}, limit {tolerance:g}; this is a fault of cmpdesign, please report it"
        )
    figures[name] = {
        "triangles": len(mesh.triangles),
        "volume_mm3": round(mesh.volume_mm3(), 6),
        "analytic_mm3": round(volume_mm3, 6),
    }
    return mesh


def place_side_by_side(stack: MoldStack, meshes: Sequence[TriangleMesh]) -> list[TriangleMesh]:
    """The meshes four in a row, each standing on z = 0."""
    low, high = bounding_boxes([stack.block])[0]
    spacing = high - low + APART_MM
    placed = []
    for number, mesh in enumerate(meshes):
        row, column = divmod(number, 4)
        place = np.array([column, -row]) * spacing
        placed.append(mesh.moved(float(place[0]), float(place[1]), -float(mesh.points[:, 2].min())))
    return placed
