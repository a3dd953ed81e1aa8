"""Occlusion: where a steep surface turns away from the camera, parts of it hide other parts.

``coverage`` adds every cell with the sign of its facing. Where the surface turns away and back again, three sheets lie
over a pixel, with the signs +1, -1 and +1. Their sum is right only if they have the same color. Therefore the areas
around back-facing parts are drawn again from small triangles, at ``SAMPLES_PER_PX`` x ``SAMPLES_PER_PX`` points per
pixel, with colors from a texture: a flat drawing of the layout. The correction is the nearest sheet's color less the
signed sum of all sheets. Everywhere else the correction is 0, and the image stays exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene.camera.plain import pitch_mm
from cmpdesign.scene.drawing.patches import ground_patches, subdivide_triangle
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.optics import REACH_SIGMA, box_gaussian

Points = NDArray[np.float64]
Planes = NDArray[np.float32]

COARSE_PARTS, FINE_PARTS = 4, 16  # parts of a patch's side: for the search, and for the drawing
SUSPECT_AREA_SHARE = (
    0.35  # of the median facing area per layout area: patches below this share are searched with fine parts
)
MAX_BACKFACING_SHARE = 0.1  # largest share of the pattern that may turn away
TILE_PX, SAMPLES_PER_PX = 32, 8
TEXELS_PER_PITCH = 64
MAX_TEXTURE_PX = 2048
DEPTH_SHARE = 0.02  # of the pitch: sheets with a smaller difference of depth count as one


class OcclusionResidual(NamedTuple):
    """The correction of a tile's samples.

    Attributes:
        row, column: the first sample.
        values: (planes, rows, columns) the nearest sheet's value less the signed sum of all sheets.
    """

    row: int
    column: int
    values: Points


@dataclass(frozen=True, eq=False)
class Occlusion:
    """The small triangles around the back-facing parts of a surface, in one view.

    Attributes:
        xyd: (T, 3, 3) float64: x and y in px of the view's area, depth in mm.
        corners_mm: (T, 3, 2) float64, layout frame.
        facing: (T,) float64, 1 towards the camera, -1 away.
        tiles: (K, 2) int64 px, top left corners of the tiles of ``TILE_PX`` with back-facing parts.
        share: share of the pattern's area that turns away.
        place_mm: (2,) centre of the largest back-facing triangle, layout frame.
        tolerance_mm: depths with a smaller difference count as the same sheet.
        origin_mm: (2,) the centre of the texture's first texel, layout frame.
        texel_mm: the side of a texel.
    """

    xyd: Points
    corners_mm: Points
    facing: Points
    tiles: NDArray[np.int64]
    share: float
    place_mm: Points
    tolerance_mm: float
    origin_mm: Points
    texel_mm: float

    def texels_from_layout(self, xy_mm: Points) -> Points:
        """Map (..., 2) mm to texels of the texture; (0, 0) is the centre of the first texel."""
        return np.asarray((xy_mm - self.origin_mm) / self.texel_mm)

    @property
    def texture_size(self) -> tuple[int, int]:
        """Width and height of the texture that holds all small triangles."""
        width, height = np.ceil(self.texels_from_layout(self.corners_mm).max(axis=(0, 1))).astype(int) + 1
        return int(width), int(height)


def find_occlusion(
    layout: Layout, project: Callable[[Points], Points], sign: float, area_size: tuple[int, int]
) -> Occlusion | None:
    """The occlusion in a view; None where the surface faces the camera everywhere.

    Args:
        layout: the pattern.
        project: maps (N, 2) mm to (N, 3): x, y in px of the view's area, depth in mm.
        sign: sign of the map's Jacobian determinant where the surface faces the camera.
        area_size: width and height of the area, px.

    Raises:
        SceneError: more than a tenth of the pattern turns away.
    """
    ground = ground_patches(layout)
    coarse = _project_subdivided(ground, project, COARSE_PARTS)
    facing = sign * _signed_areas(coarse) / _signed_areas(_subdivided_corners_mm(ground, COARSE_PARTS))
    suspects = np.asarray((facing < SUSPECT_AREA_SHARE * np.median(facing)).any(axis=1))
    if not suspects.any():
        return None
    suspect_patches = ground[suspects]
    fine, fine_mm = (
        _project_subdivided(suspect_patches, project, FINE_PARTS),
        _subdivided_corners_mm(suspect_patches, FINE_PARTS),
    )
    is_back = sign * _signed_areas(fine) < 0
    if not is_back.any():
        return None
    areas_mm = _signed_areas(fine_mm)
    share = float(areas_mm[is_back].sum() / _signed_areas(ground).sum())
    position = fine_mm[is_back].mean(axis=1)[np.argmax(areas_mm[is_back])]
    if share > MAX_BACKFACING_SHARE:
        raise SceneError(
            f"{100 * share:.0f} % of the pattern turn away from the camera, among others at ({position[0]:.3g}, "
            f"{position[1]:.3g}) mm; at most {100 * MAX_BACKFACING_SHARE:.0f} % can be drawn: take a "
            f"smaller displacement, "
            "a larger radius or a camera that looks more steeply"
        )
    tiles = _touched_tiles(fine[is_back], area_size)
    patches = ground[_is_near_tiles(coarse, tiles)]
    xyd = _project_subdivided(patches, project, FINE_PARTS)
    corners_mm = _subdivided_corners_mm(patches, FINE_PARTS).reshape(-1, 3, 2)
    origin_mm = corners_mm.min(axis=(0, 1))
    span_mm = float((corners_mm.max(axis=(0, 1)) - origin_mm).max())
    return Occlusion(
        xyd=xyd.reshape(-1, 3, 3),
        corners_mm=corners_mm,
        facing=np.sign(sign * _signed_areas(xyd)).ravel(),
        tiles=tiles,
        share=share,
        place_mm=position,
        tolerance_mm=DEPTH_SHARE * pitch_mm(layout),
        origin_mm=origin_mm,
        texel_mm=max(pitch_mm(layout) / TEXELS_PER_PITCH, span_mm / MAX_TEXTURE_PX),
    )


def _subdivided_corners_mm(ground: Points, parts: int) -> Points:
    """(P, parts^2, 3, 2) mm: the corners of the small triangles of patches (P, 3, 2)."""
    barycentric, triangles = subdivide_triangle(parts)
    return np.asarray((barycentric @ ground)[:, triangles])


def _project_subdivided(ground: Points, project: Callable[[Points], Points], parts: int) -> Points:
    """(P, parts^2, 3, 3): x, y in px and depth in mm of the corners of the small triangles of patches (P, 3, 2)."""
    barycentric, triangles = subdivide_triangle(parts)
    nodes = barycentric @ ground
    projected = project(nodes.reshape(-1, 2))
    return np.asarray(projected.reshape(*nodes.shape[:2], 3)[:, triangles])


def _signed_areas(triangles: Points) -> Points:
    """(...) signed areas of triangles (..., 3, 2 or more)."""
    a, b = (triangles[..., i, :2] - triangles[..., 0, :2] for i in (1, 2))
    return np.asarray(0.5 * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]))


def _touched_tiles(triangles: Points, area_size: tuple[int, int]) -> NDArray[np.int64]:
    """(K, 2) px: corners of the tiles inside the area that overlap the boxes of triangles (n, 3, 3)."""
    last = (np.asarray(area_size) - 1) // TILE_PX
    low = np.floor((triangles[..., :2].min(axis=1) + 0.5) / TILE_PX).astype(np.int64)
    high = np.floor((triangles[..., :2].max(axis=1) + 0.5) / TILE_PX).astype(np.int64)
    touched = np.zeros((last[1] + 1, last[0] + 1), dtype=np.bool_)
    for left, top, right, bottom in np.unique(
        np.hstack([np.maximum(low, 0), np.minimum(high, last)]), axis=0
    ):
        touched[top : bottom + 1, left : right + 1] = True
    rows, columns = np.nonzero(touched)
    return np.stack([columns, rows], axis=-1) * TILE_PX


def _is_near_tiles(coarse: Points, tiles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(P,) bool: patches whose coarse nodes' box, with a margin, overlaps one of the tiles."""
    flat = np.ascontiguousarray(np.moveaxis(coarse[..., :2], -1, 0)).reshape(2, len(coarse), -1)
    low, high = flat.min(axis=2).T, flat.max(axis=2).T
    margin = 0.25 * (high - low).max(axis=1, initial=0.0, keepdims=True) + 2
    near = np.zeros(len(coarse), dtype=np.bool_)
    for tile in tiles:
        near |= ((high + margin >= tile - 0.5) & (low - margin <= tile + TILE_PX - 0.5)).all(axis=1)
    return near


def update_hidden_parts(planes: Planes, occlusion: Occlusion, texture: Planes, blur_px: float) -> None:
    """Correct the planes (n, height, width) of an area, drawn by ``coverage``, in place.

    Args:
        planes: the signed sums.
        occlusion: the view's occlusion.
        texture: (n, height, width) the same sums for the flat layout, of ``occlusion.texture_size``.
        blur_px: the optics' blur.
    """
    from cmpdesign._native import occlusion as native

    uv = occlusion.texels_from_layout(occlusion.corners_mm)
    height, width = planes.shape[1:]
    reach = int(np.ceil(REACH_SIGMA * blur_px + 1)) if blur_px else 0
    offset = (np.arange(TILE_PX * SAMPLES_PER_PX) + 0.5) / SAMPLES_PER_PX - 0.5
    x, y = (np.ascontiguousarray(occlusion.xyd[..., axis].T) for axis in (0, 1))
    low_x, high_x, low_y, high_y = x.min(axis=0), x.max(axis=0), y.min(axis=0), y.max(axis=0)
    for left, top in occlusion.tiles:
        near = (high_x >= left - 0.5) & (low_x <= left + TILE_PX - 0.5)
        near &= (high_y >= top - 0.5) & (low_y <= top + TILE_PX - 0.5)
        residual = OcclusionResidual(
            *native.occlusion_residual(
                occlusion.xyd[near],
                uv[near],
                occlusion.facing[near],
                texture,
                left,
                top,
                TILE_PX,
                SAMPLES_PER_PX,
            )
        )
        if not residual.values.size:
            continue
        y = top + offset[residual.row : residual.row + residual.values.shape[1]]
        x = left + offset[residual.column : residual.column + residual.values.shape[2]]
        rows = np.arange(max(int(y[0]) - reach, 0), min(int(y[-1]) + 2 + reach, height))
        columns = np.arange(max(int(x[0]) - reach, 0), min(int(x[-1]) + 2 + reach, width))
        down, across = (
            _pixel_response(rows[:, None] - y, blur_px),
            _pixel_response(columns[:, None] - x, blur_px),
        )
        window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        planes[:, *window] += (down @ residual.values @ across.T).astype(np.float32)


def _pixel_response(distance: Points, blur_px: float) -> Points:
    """The weight of a sample in a pixel at a distance in px along one axis."""
    if blur_px == 0:
        return (np.abs(distance) < 0.5) / SAMPLES_PER_PX
    return box_gaussian(distance, blur_px) / SAMPLES_PER_PX


def is_hidden(occlusion: Occlusion, xyd: Points, facing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) bool: which points lie behind another part of the surface, or face away.

    Args:
        occlusion: the view's occlusion.
        xyd: (N, 3) x and y in px of the area, depth in mm.
        facing: (N,) the surface faces the camera at the point.
    """
    from cmpdesign._native import occlusion as native

    tile = np.floor((xyd[:, :2] + 0.5) / TILE_PX) * TILE_PX
    in_tile = (tile[:, None] == occlusion.tiles).all(axis=2).any(axis=1)
    hidden = ~facing
    by_x = np.flatnonzero(in_tile)[np.argsort(xyd[in_tile, 0], kind="stable")]
    nearest = native.nearest_depth(occlusion.xyd, xyd[by_x])
    hidden[by_x] |= xyd[by_x, 2] > nearest + occlusion.tolerance_mm
    return hidden
