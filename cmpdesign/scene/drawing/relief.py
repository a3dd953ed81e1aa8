"""Cells above or below the black, as a camera sees them: the seen part of each cell in the layout's plane.

A wall has the color of what stands higher: walls of raised cells show their ink, walls of recessed cells are black. So
the face and the walls of a raised cell are seen, and of a recessed cell the floor, through its opening. Walls are lit
like faces, and nothing throws a shadow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import equal_length_outlines
from cmpdesign.scene.drawing.view import SceneView

Points = NDArray[np.float64]
STEP_SHARE = 1e-4  # of the height: step of the derivatives


def seen_polygons(view: SceneView, polygons_mm: Points, height_mm: float) -> Points:
    """The seen parts of cells.

    Args:
        view: a view with a camera in space.
        polygons_mm: (K, n, 2) convex outlines in the plane of the black, counter-clockwise.
        height_mm: of the cells over the black, towards the camera; negative: recessed.

    Returns:
        (K, m, 2) counter-clockwise; cells of which nothing is seen are points.
    """
    import shapely

    flat = polygons_mm.reshape(-1, 2)
    moved = (flat + parallax_mm(view, flat, height_mm)).reshape(polygons_mm.shape)
    cells, faces = (
        shapely.convex_hull(shapely.polygons(polygons_mm)),
        shapely.convex_hull(shapely.polygons(moved)),
    )
    raised = height_mm > 0
    seen = shapely.convex_hull(shapely.union(cells, faces)) if raised else shapely.intersection(cells, faces)
    rings = shapely.get_exterior_ring(shapely.orient_polygons(seen))
    found = [shapely.get_coordinates(ring)[:-1] for ring in rings]
    hidden = polygons_mm[:, :1].repeat(3, axis=1)
    return equal_length_outlines([ring if len(ring) else hidden[i] for i, ring in enumerate(found)])


def parallax_mm(view: SceneView, xy_mm: Points, height_mm: float) -> Points:
    """(N, 2): where points (N, 2) at a height over the surface are seen in the layout's plane, less where they are."""
    step_mm = STEP_SHARE * abs(height_mm)
    east, north = np.array([step_mm, 0.0]), np.array([0.0, step_mm])
    space = [view.xyz_from_layout(xy_mm + by) for by in (east, -east, north, -north)]
    normal = np.cross(space[0] - space[1], space[2] - space[3])
    normal *= (-1.0 if view.mirrored else 1.0) / np.linalg.norm(normal, axis=1, keepdims=True)
    off_px = view.project(view.xyz_from_layout(xy_mm) + height_mm * normal) - view.image_from_layout(xy_mm)
    image = [view.project(xyz) for xyz in space]
    derivative = np.stack([image[0] - image[1], image[2] - image[3]], axis=2) / (2 * step_mm)
    return np.asarray(np.linalg.solve(derivative, off_px[:, :, None])[..., 0])
