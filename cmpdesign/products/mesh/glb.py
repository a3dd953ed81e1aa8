"""GLB (binary glTF 2.0): named, colored triangle meshes in metres, y up, as defined by the format."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_METRES = 1e-3


def meshes_to_glb(meshes: Sequence[TriangleMesh], opacity: dict[str, float] | None = None) -> bytes:
    """Format triangle meshes as GLB, each with its own node, mesh and material.

    Args:
        meshes: in mm.
        opacity: mesh name -> 0 (clear) to 1 (opaque, the default).

    Returns:
        The bytes of the file.
    """
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "cmpdesign"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh.name, "mesh": number} for number, mesh in enumerate(meshes)],
        "meshes": [],
        "materials": [_glb_material(mesh, (opacity or {}).get(mesh.name, 1.0)) for mesh in meshes],
        "accessors": [],
        "bufferViews": [],
    }
    data = b""
    for number, mesh in enumerate(meshes):
        data += _add_mesh(document, number, mesh, len(data))
    document["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _add_mesh(document: dict[str, Any], number: int, mesh: TriangleMesh, offset: int) -> bytes:
    """Add a mesh to the document; the mesh's binary data, which begin at ``offset`` bytes."""
    points = (mesh.points[:, [0, 2, 1]] * (_METRES, _METRES, -_METRES)).astype("<f4")
    indices = mesh.triangles.astype("<u4")
    view, sizes = 2 * number, (points.nbytes, indices.nbytes)
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": offset, "byteLength": sizes[0], "target": _VERTICES},
        {"buffer": 0, "byteOffset": offset + sizes[0], "byteLength": sizes[1], "target": _INDICES},
    ]
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    document["accessors"] += [
        {
            "bufferView": view,
            "componentType": _FLOAT,
            "count": len(points),
            "type": "VEC3",
            "min": low,
            "max": high,
        },
        {"bufferView": view + 1, "componentType": _UINT, "count": indices.size, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": view}, "indices": view + 1, "material": number}
    document["meshes"].append({"name": mesh.name, "primitives": [primitive]})
    return points.tobytes() + indices.tobytes()


def _glb_material(mesh: TriangleMesh, opacity: float) -> dict[str, Any]:
    rgb = [(int(mesh.color[i : i + 2], 16) / 255) ** 2.2 for i in (1, 3, 5)]
    material: dict[str, Any] = {
        "name": mesh.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(round(value, 6) for value in rgb), opacity],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.6,
        },
    }
    if opacity < 1:
        material["alphaMode"] = "BLEND"
    return material
