"""3MF by the consortium's lib3mf, in mm: triangle meshes, each of its own material, in one piece or as several.

A slicer puts every object on the plate alone; the parts of one object keep their places to each other.
"""

from __future__ import annotations

import ctypes
import io
import uuid
import zipfile
from collections.abc import Sequence
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

# The library's identifiers and the package's dates differ from run to run by default. These follow from names.
_NAMESPACE = uuid.UUID("6f9a3c1e-6f0e-5f5b-9d54-6d6f6c64cafe")
_SLICER_CONFIG = "/Metadata/Slic3r_PE_model.config"
_SLICER_RELATION = "http://schemas.prusa3d.com/slic3r/model-config"
_DATE = (1980, 1, 1, 0, 0, 0)


def meshes_to_3mf(meshes: Sequence[TriangleMesh], title: str, *, is_one_piece: bool) -> bytes:
    """Format triangle meshes as a 3MF package; the same bytes for the same meshes.

    Args:
        meshes: the meshes.
        title: name of the package, and of the object that they make together.
        is_one_piece: the meshes are parts of one object; else each is an object that may be moved alone.

    Raises:
        RuntimeError: lib3mf reports a mesh that is not closed or not consistently wound.
    """
    with extra("cad"):
        import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    model.SetBuildUUID(_name_uuid(f"{title}/build"))
    model.GetMetaDataGroup().AddMetaData("", "Title", title, "xs:string", True)
    materials = model.AddBaseMaterialGroup()
    unmoved = lib3mf.get_wrapper().GetIdentityTransform()
    pieces = [meshes] if is_one_piece else [[mesh] for mesh in meshes]
    for number, piece in enumerate(pieces):
        name = title if is_one_piece else piece[0].name
        part = _add_object(lib3mf, model, materials, name, piece)
        model.AddBuildItem(part, unmoved).SetUUID(_name_uuid(f"{title}/item/{number}"))
        if is_one_piece:
            _add_slicer_parts(model, part.GetResourceID(), title, piece)
    writer = model.QueryWriter("3mf")
    writer.SetStrictModeActive(True)
    return _canonical_package(bytes(writer.WriteToBuffer()))


def _add_object(lib3mf: Any, model: Any, materials: Any, name: str, meshes: Sequence[TriangleMesh]) -> Any:
    """One object of closed meshes, whose triangles have the materials of their meshes."""
    part = model.AddMeshObject()
    part.SetName(name)
    part.SetUUID(_name_uuid(f"object/{name}"))
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    points = np.concatenate([mesh.points for mesh in meshes]).astype(np.float32)
    corners = np.concatenate(
        [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]
    ).astype(np.uint32)
    vertices = (lib3mf.Position * len(points))()
    triangles = (lib3mf.Triangle * len(corners))()
    ctypes.memmove(vertices, points.ctypes.data, points.nbytes)
    ctypes.memmove(triangles, corners.ctypes.data, corners.nbytes)
    part.SetGeometry(vertices, triangles)
    kinds = []
    for mesh in meshes:
        red, green, blue = (int(mesh.color[i : i + 2], 16) for i in (1, 3, 5))
        material = materials.AddMaterial(mesh.name, lib3mf.Color(red, green, blue, 255))
        kind = lib3mf.TriangleProperties(materials.GetResourceID(), (ctypes.c_uint32 * 3)(*[material] * 3))
        kinds += [kind] * len(mesh.triangles)
    part.SetObjectLevelProperty(kinds[0].ResourceID, kinds[0].PropertyIDs[0])
    if len(meshes) > 1:
        part.SetAllTriangleProperties(kinds)
    if not part.IsManifoldAndOriented():
        raise RuntimeError(f"{name}: the mesh is not closed or its triangles disagree about outside")
    return part


def _add_slicer_parts(model: Any, number: int, title: str, meshes: Sequence[TriangleMesh]) -> None:
    """The parts of an object by ranges of triangles, as PrusaSlicer writes and reads them.

    PrusaSlicer takes components apart and lays them side by side; it reads materials of triangles as one part.
    """
    ends = np.cumsum([len(mesh.triangles) for mesh in meshes]).tolist()
    root = ElementTree.Element("config")
    whole = ElementTree.SubElement(root, "object", id=str(number), instances_count="1")
    ElementTree.SubElement(whole, "metadata", type="object", key="name", value=title)
    for extruder, (mesh, end) in enumerate(zip(meshes, ends, strict=True), 1):
        first = end - len(mesh.triangles)
        volume = ElementTree.SubElement(whole, "volume", firstid=str(first), lastid=str(end - 1))
        for key, value in (("name", mesh.name), ("volume_type", "ModelPart"), ("extruder", str(extruder))):
            ElementTree.SubElement(volume, "metadata", type="volume", key=key, value=value)
    model.AddCustomContentType("config", "text/xml")
    attachment = model.AddAttachment(_SLICER_CONFIG, _SLICER_RELATION)
    attachment.ReadFromBuffer(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _name_uuid(name: str) -> str:
    return str(uuid.uuid5(_NAMESPACE, name))


def _canonical_package(package: bytes) -> bytes:
    """The package with the same entries in the same order and a fixed date."""
    result = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(package)) as old, zipfile.ZipFile(result, "w") as new:
        for name in old.namelist():
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            new.writestr(info, old.read(name))
    return result.getvalue()


class Object3mf(NamedTuple):
    """One item of a build, which slicers place as a whole: (3,) corners of its box in mm, materials in their order."""

    name: str
    triangles: int
    materials: list[str]
    low_mm: NDArray[np.float64]
    high_mm: NDArray[np.float64]


def read_3mf(package: bytes) -> list[Object3mf]:
    """Read the items of a package's build with lib3mf in strict mode.

    Raises:
        RuntimeError: strict mode gives a warning.
    """
    with extra("cad"):
        import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer(package)
    if reader.GetWarningCount():
        raise RuntimeError(f"lib3mf: {reader.GetWarning(0)}")
    items, found = model.GetBuildItems(), []
    while items.MoveNext():
        part = model.GetMeshObjectByID(items.GetCurrent().GetObjectResourceID())
        points = np.array([list(vertex.Coordinates) for vertex in part.GetVertices()])
        kinds = dict.fromkeys(
            (kind.ResourceID, kind.PropertyIDs[0]) for kind in part.GetAllTriangleProperties()
        )
        names = [model.GetBaseMaterialGroupByID(group).GetName(index) for group, index in kinds]
        low, high = points.min(axis=0), points.max(axis=0)
        found.append(Object3mf(part.GetName(), part.GetTriangleCount(), names, low, high))
    return found
