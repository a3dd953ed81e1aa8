"""Binary STL, mm: one triangle mesh per file."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER_BYTES = 80


def mesh_to_stl(mesh: TriangleMesh) -> bytes:
    """Format a triangle mesh as binary STL; the header holds the mesh's name."""
    corners = mesh.points[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(len(corners), dtype=_FACET)
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    facets["corners"] = corners
    # Programs read a file that starts with "solid" as the text format.
    header = f"cmpdesign {mesh.name}, mm".encode("ascii", "replace")[:_HEADER_BYTES].ljust(
        _HEADER_BYTES, b"\0"
    )
    return header + np.uint32(len(facets)).tobytes() + facets.tobytes()
