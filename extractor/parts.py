"""The connected parts of a mesh, and which of its faces are markers: what the numbering starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .mesh import Mesh
from .sampling import sample_patch

WITNESSES = 80  # faces that say which turn is that of the markers


@compiled
def connected(neighbours, member):  # type: ignore[no-untyped-def]
    """(N,) int32, counted from 0, the connected part that each ``member`` (N,) bool belongs to, by its ``neighbours``
    (N, K), -1 for none; -1 for what is no member."""
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


def largest_parts(mesh: Mesh, count: int) -> list[NDArray[np.intp]]:
    """The faces of each of the largest connected parts of the mesh, the largest first."""
    part = connected(mesh.neighbours, mesh.turn != 0)
    sizes = np.bincount(part[part >= 0])
    return [np.flatnonzero(part == i) for i in np.argsort(-sizes, kind="stable")[:count]]


@compiled
def innermost(center, faces, members, blocked):  # type: ignore[no-untyped-def]
    """The sound face nearest to the middle of its part of the mesh, or -1: rims are often damaged."""
    x, y = 0.0, 0.0
    for f in members:
        for k in range(3):
            x += center[faces[f, k], 0]
            y += center[faces[f, k], 1]
    x, y = x / members.shape[0], y / members.shape[0]  # of sums over three, as below
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
def _brightness(image, center, faces, turn, every):  # type: ignore[no-untyped-def]
    """(F // every + 1, 2): the turn of every n-th face and its middle's brightness, NaN outside the image."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    out, color = np.full((turn.shape[0] // every + 1, 2), np.nan), np.zeros(3)
    number_of = 0
    for f in range(turn.shape[0]):
        if turn[f] == 0:
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
        if sample_patch(flat, height, width, x, y, 0.12 * nearest, color):
            row = number_of // every - 1
            out[row, 0], out[row, 1] = turn[f], color.sum()
    return out


def fronts(image: NDArray[np.uint8], cells: Cells, mesh: Mesh) -> list[int]:
    """The turn of the faces that are markers, the likelier first: black cells are darker than where cells meet."""
    every = max(1, int((mesh.turn != 0).sum()) // WITNESSES)
    turn, brightness = _brightness(image, cells.center_px, mesh.faces, mesh.turn, every).T
    plus, minus = brightness[turn == 1], brightness[turn == -1]
    if len(plus) < 4 or len(minus) < 4:
        return [1, -1]
    return [1] if np.median(plus) > np.median(minus) else [-1]
