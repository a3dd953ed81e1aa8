"""3MF by the consortium's lib3mf, in mm: one object with its own base material per triangle mesh."""

from __future__ import annotations

import ctypes
import io
import uuid
import zipfile
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cmpdesign.libraries import extra
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

# The library's identifiers and the package's dates differ from run to run by default. These follow from names.
_NAMESPACE = uuid.UUID("6f9a3c1e-6f0e-5f5b-9d54-6d6f6c64cafe")
_DATE = (1980, 1, 1, 0, 0, 0)


def meshes_to_3mf(meshes: Sequence[TriangleMesh], title: str) -> bytes:
    """Format triangle meshes as a 3MF package; the same bytes for the same meshes.

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
    for number, mesh in enumerate(meshes):
        item = _add_object(lib3mf, model, materials, mesh)
        item.SetUUID(_name_uuid(f"{title}/item/{number}"))
    writer = model.QueryWriter("3mf")
    writer.SetStrictModeActive(True)
    return _canonical_package(bytes(writer.WriteToBuffer()))


def _add_object(lib3mf: Any, model: Any, materials: Any, mesh: TriangleMesh) -> Any:
    red, green, blue = (int(mesh.color[i : i + 2], 16) for i in (1, 3, 5))
    material = materials.AddMaterial(mesh.name, lib3mf.Color(red, green, blue, 255))
    part = model.AddMeshObject()
    part.SetName(mesh.name)
    part.SetUUID(_name_uuid(f"object/{mesh.name}"))
    points = np.ascontiguousarray(mesh.points, dtype=np.float32)
    corners = np.ascontiguousarray(mesh.triangles, dtype=np.uint32)
    vertices = (lib3mf.Position * len(points))()
    triangles = (lib3mf.Triangle * len(corners))()
    ctypes.memmove(vertices, points.ctypes.data, points.nbytes)
    ctypes.memmove(triangles, corners.ctypes.data, corners.nbytes)
    part.SetGeometry(vertices, triangles)
    part.SetObjectLevelProperty(materials.GetResourceID(), material)
    if not part.IsManifoldAndOriented():
        raise RuntimeError(f"{mesh.name}: the mesh is not closed or its triangles disagree about outside")
    return model.AddBuildItem(part, lib3mf.get_wrapper().GetIdentityTransform())


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


class ObjectCounts(NamedTuple):
    """The size of one object of a 3MF package."""

    name: str
    vertices: int
    triangles: int


def read_3mf(package: bytes) -> list[ObjectCounts]:
    """Read the objects of a package with lib3mf in strict mode.

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
    objects, found = model.GetMeshObjects(), []
    while objects.MoveNext():
        part = objects.GetCurrentMeshObject()
        found.append(ObjectCounts(part.GetName(), part.GetVertexCount(), part.GetTriangleCount()))
    return found
