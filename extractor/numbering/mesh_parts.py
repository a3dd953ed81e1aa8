"""The connected components of the cell mesh, and which of its faces are markers: the start of the numbering."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled

MAX_SAMPLED_FACES = 80  # faces that are sampled to find the orientation of the markers
MIN_SAMPLED_FACES = 4  # of each orientation


@compiled
def connected_components(neighbours, member):  # type: ignore[no-untyped-def]
    """The connected components of a graph.

    Args:
        neighbours: (N, K) int32, -1 for none.
        member: (N,) bool, the nodes of the graph.

    Returns:
        (N,) int32, the component of each member, counted from 0; -1 for the others.
    """
    part = np.full(member.shape[0], -1, np.int32)
    stack = np.empty(member.shape[0], np.int32)
    count = 0
    for first in range(member.shape[0]):
        if not member[first] or part[first] >= 0:
            continue
        part[first] = count
        stack[0], height = first, 1
        while height > 0:
            height -= 1
            i = stack[height]
            for k in range(neighbours.shape[1]):
                j = neighbours[i, k]
                if j >= 0 and member[j] and part[j] < 0:
                    part[j] = count
                    stack[height] = j
                    height += 1
        count += 1
    return part


@compiled
def _faces_by_component(neighbours, orientation):  # type: ignore[no-untyped-def]
    """The faces, component by component, the largest first, and the index at which each component begins."""
    part = connected_components(neighbours, orientation != 0)
    sizes = np.zeros(part.max() + 1 if part.shape[0] > 0 else 0, np.int64)
    for i in part:
        if i >= 0:
            sizes[i] += 1
    largest = np.argsort(-sizes, kind="mergesort")  # stable, for components of equal size
    begin, filled = np.zeros(sizes.shape[0] + 1, np.int64), np.empty(sizes.shape[0], np.int64)
    for k in range(sizes.shape[0]):
        filled[largest[k]] = begin[k]
        begin[k + 1] = begin[k] + sizes[largest[k]]
    faces = np.empty(begin[-1], np.int64)
    for f in range(part.shape[0]):
        if part[f] >= 0:
            faces[filled[part[f]]] = f
            filled[part[f]] += 1
    return faces, begin


def largest_components(mesh: CellMesh, count: int) -> list[NDArray[np.intp]]:
    """The faces of each of the ``count`` largest connected components of the mesh, the largest first."""
    faces, begin = _faces_by_component(mesh.neighbours, mesh.orientation)
    return [faces[begin[i] : begin[i + 1]] for i in range(min(count, len(begin) - 1))]


@compiled
def most_central_face(center, faces, members, blocked):  # type: ignore[no-untyped-def]
    """The face without a blocked cell that is nearest to the middle of its component, or -1; rims are often damaged.

    Args:
        center: (N, 2) px; faces: (F, 3) cells. members: the component's faces. blocked: (N,) bool.
    """
    x, y = 0.0, 0.0
    for f in members:
        for k in range(3):
            x += center[faces[f, k], 0]
            y += center[faces[f, k], 1]
    x, y = x / members.shape[0], y / members.shape[0]  # three times the mean, as below
    best, nearest = -1, np.inf
    for f in members:
        a, b, c = faces[f]
        if blocked[a] or blocked[b] or blocked[c]:
            continue
        dx = center[a, 0] + center[b, 0] + center[c, 0] - x
        dy = center[a, 1] + center[b, 1] + center[c, 1] - y
        if dx * dx + dy * dy < nearest:
            best, nearest = f, dx * dx + dy * dy
    return best


@compiled
def _marker_turn_by_brightness(image, center, faces, orientation):  # type: ignore[no-untyped-def]
    """The orientation of the brighter faces; 0 if too few lie in the image."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    every = max(1, int(np.count_nonzero(orientation)) // MAX_SAMPLED_FACES)
    brightness, color = np.empty((2, orientation.shape[0] // every + 1)), np.zeros(3)
    number_of, count = 0, [0, 0]
    for f in range(orientation.shape[0]):
        if orientation[f] == 0:
            continue
        number_of += 1
        if number_of % every != 0:
            continue
        x, y = 0.0, 0.0
        for k in range(3):
            x += center[faces[f, k], 0] / 3
            y += center[faces[f, k], 1] / 3
        nearest = np.inf
        for k in range(3):
            nearest = min(nearest, np.hypot(center[faces[f, k], 0] - x, center[faces[f, k], 1] - y))
        if fill_patch_mean(flat, height, width, x, y, 0.12 * nearest, color):
            side = 1 if orientation[f] > 0 else 0
            brightness[side, count[side]] = color.sum()
            count[side] += 1
    if min(count) < MIN_SAMPLED_FACES:
        return 0
    return 1 if np.median(brightness[1, : count[1]]) > np.median(brightness[0, : count[0]]) else -1


def marker_turns(image: NDArray[np.uint8], cells: Cells, mesh: CellMesh) -> list[int]:
    """The possible orientations of the faces that are markers, +1 or -1, the likelier first.

    Markers are brighter than black cells.
    """
    front = int(_marker_turn_by_brightness(image, cells.center_px, mesh.faces, mesh.orientation))
    return [front] if front != 0 else [1, -1]
