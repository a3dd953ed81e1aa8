"""Triangle meshes of solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh
from cmpdesign.products.mold.solids.loops import Loop, Points, chorded_pair
from cmpdesign.products.mold.solids.slab_shells import Feature, Slab

# Largest distance and angle between curved faces and their triangles.
DEFLECTION_MM = 0.01
DEFLECTION_RAD = 0.1
# Neighbouring faces evaluate a common point to within the kernel's tolerance (1e-7 mm); every edge is longer than this.
MERGE_TOLERANCE_MM = 1e-5


def chorded_slab(slab: Slab) -> Slab:
    """The slab with arcs replaced by chords: a polyhedron, whose triangle mesh is exact."""
    bottom, top = chorded_pair(*slab.outlines)
    return replace(
        slab,
        outer=bottom,
        outer_top=None if slab.outer_top is None else top,
        through=[chorded_pair(*pair) for pair in slab.through],
        features=[_chorded_feature(feature) for feature in slab.features],
        many=[_chorded_feature(feature) for feature in slab.many],
        many_through=[chorded_pair(*pair) for pair in slab.many_through],
    )


def _chorded_feature(feature: Feature) -> Feature:
    root, tip = chorded_pair(feature.root, feature.tip)
    island = None if feature.island is None else chorded_pair(*feature.island)
    return Feature(root, tip, feature.height_mm, island)


def tessellate_solid(name: str, color: str, solid: Any) -> TriangleMesh:
    """The triangle mesh of a solid (TopoDS_Solid), exact on flat faces; neighbouring faces share their vertices."""
    with extra("cad"):
        from OCP.BRepMesh import BRepMesh_IncrementalMesh
        from OCP.TopAbs import TopAbs_ShapeEnum

    from cmpdesign.products.mold.solids.measure import subshapes

    BRepMesh_IncrementalMesh(solid, DEFLECTION_MM, False, DEFLECTION_RAD, False)
    points: list[tuple[float, float, float]] = []
    corners: list[tuple[int, int, int]] = []
    for face in subshapes(solid, TopAbs_ShapeEnum.TopAbs_FACE):
        _add_face_triangles(face, points, corners)
    return merge_vertices(name, color, np.array(points), np.array(corners))


def _add_face_triangles(
    face: Any, points: list[tuple[float, float, float]], corners: list[tuple[int, int, int]]
) -> None:
    with extra("cad"):
        from OCP.BRep import BRep_Tool
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopLoc import TopLoc_Location
        from OCP.TopoDS import TopoDS

    location = TopLoc_Location()
    triangulation = BRep_Tool.Triangulation_s(TopoDS.Face(face), location)
    transformation = location.Transformation()
    first = len(points) - 1
    for number in range(1, triangulation.NbNodes() + 1):
        node = triangulation.Node(number).Transformed(transformation)
        points.append((node.X(), node.Y(), node.Z()))
    is_reversed = face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
    for number in range(1, triangulation.NbTriangles() + 1):
        a, b, c = triangulation.Triangle(number).Get()
        corners.append(
            (first + a, first + c, first + b) if is_reversed else (first + a, first + b, first + c)
        )


def merge_vertices(name: str, color: str, points: Points, corners: NDArray[np.int64]) -> TriangleMesh:
    """Merge points within ``MERGE_TOLERANCE_MM`` to one vertex; triangles that become flat are left out.

    Args:
        name, color: name and color of the triangle mesh.
        points: (P, 3) mm.
        corners: (T, 3) int64 numbers of points.
    """
    with extra("cad"):
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

    a, b = cKDTree(points).query_pairs(MERGE_TOLERANCE_MM, output_type="ndarray").T
    adjacency = coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(len(points), len(points)))
    _, number = connected_components(adjacency, directed=False)
    _, first = np.unique(number, return_index=True)
    triangles = number[corners]
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    return TriangleMesh(name, color, points[first], triangles[~flat].astype(np.int64))


class Frustum(NamedTuple):
    """A convex frustum between two outlines of m straight sides.

    Attributes:
        lower, upper: the outlines in plan.
        lower_z, upper_z: (m,) heights of their points, mm.
    """

    lower: Loop
    lower_z: Points
    upper: Loop
    upper_z: Points


def frusta_mesh(name: str, color: str, frusta: Sequence[Frustum]) -> TriangleMesh:
    """The triangle mesh of frusta."""
    points, triangles, first = [], [], 0
    for frustum in frusta:
        m = len(frustum.lower.points)
        points.append(np.column_stack([frustum.lower.points, frustum.lower_z]))
        points.append(np.column_stack([frustum.upper.points, frustum.upper_z]))
        i, after = np.arange(m), (np.arange(m) + 1) % m
        fan = np.stack([np.zeros(m - 2, dtype=np.int64), i[1:-1], i[2:]], axis=1)
        sides = np.concatenate(
            [np.stack([i, after, m + after], axis=1), np.stack([i, m + after, m + i], axis=1)]
        )
        triangles += [first + fan[:, ::-1], first + m + fan, first + sides]
        first += 2 * m
    return TriangleMesh(name, color, np.concatenate(points), np.concatenate(triangles))
