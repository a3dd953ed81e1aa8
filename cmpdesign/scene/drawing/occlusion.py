"""Where a steep surface turns away from the camera, parts of it hide others: who lies before whom.

``coverage`` adds every cell with the sign of its facing. Where the surface turns away and back again, three sheets lie
over a pixel, +1, -1 and +1, and their sum is right only if they have the same color. So the places where a part turns
away are drawn again from small triangles, at ``SAMPLES_PER_PX`` x ``SAMPLES_PER_PX`` points a pixel, in the colors
of a flat picture
of the layout: the nearest sheet's color less the signed sum of all sheets is what is missing there. Everywhere else it
is 0, and the image stays exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene.camera.plain import pitch_mm
from cmpdesign.scene.drawing.patches import ground_patches, subdivide_triangle
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.optics import REACH_SIGMA, box_gaussian

Points = NDArray[np.float64]
Planes = NDArray[np.float32]

COARSE_PARTS, FINE_PARTS = 4, 16  # parts of a patch's side: to look for folds, and to draw them
SUSPECT_AREA_SHARE = 0.35  # of the median facing area per layout area: below, it is looked at more closely
MAX_BACKFACING_SHARE = 0.1  # of the pattern that may turn away
TILE_PX, SAMPLES_PER_PX = 32, 8
TEXELS_PER_PITCH = 64  # of the flat picture, to a pitch
MAX_TEXTURE_PX = 2048
DEPTH_SHARE = 0.02  # of the pitch: sheets nearer to each other count as one


@dataclass(frozen=True, eq=False)
class Occlusion:
    """The small triangles around the places where a surface turns away, in one view.

    Attributes:
        xyd: (T, 3, 3) float64: x and y in px of the view's area, depth in mm.
        corners_mm: (T, 3, 2) float64, in the layout.
        facing: (T,) float64, 1 towards the camera, -1 away.
        tiles: (K, 2) int64, corners of the tiles of ``TILE_PX`` that hold such places.
        share: of the pattern's area that turns away.
        place_mm: (2,) where, in the layout.
        tolerance_mm: depths that differ by less count as the same sheet.
        origin_mm: (2,) the centre of the flat picture's first texel, in the layout.
        texel_mm: of the flat picture.
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
        """(..., 2) mm to texels of the flat picture; (0, 0) is the centre of its first."""
        return np.asarray((xy_mm - self.origin_mm) / self.texel_mm)

    @property
    def texture_size(self) -> tuple[int, int]:
        """Width and height of the flat picture that holds all small triangles."""
        width, height = np.ceil(self.texels_from_layout(self.corners_mm).max(axis=(0, 1))).astype(int) + 1
        return int(width), int(height)


def find_occlusion(
    layout: Layout, seen: Callable[[Points], Points], sign: float, area_size: tuple[int, int]
) -> Occlusion | None:
    """The folds of a view; None where the surface faces the camera everywhere.

    Args:
        layout: the pattern.
        seen: (N, 2) mm to (N, 3): x, y in px of the view's area, depth in mm.
        sign: of the map's Jacobian determinant where the surface faces the camera.
        area_size: width and height of the area, px.

    Raises:
        SceneError: more than a tenth of the pattern turns away.
    """
    ground = ground_patches(layout)
    coarse = _project_subdivided(ground, seen, COARSE_PARTS)
    facing = sign * _signed_areas(coarse) / _signed_areas(_subdivided_corners_mm(ground, COARSE_PARTS))
    suspects = np.asarray((facing < SUSPECT_AREA_SHARE * np.median(facing)).any(axis=1))
    if not suspects.any():
        return None
    close = ground[suspects]
    fine, fine_mm = _project_subdivided(close, seen, FINE_PARTS), _subdivided_corners_mm(close, FINE_PARTS)
    away = sign * _signed_areas(fine) < 0
    if not away.any():
        return None
    areas_mm = _signed_areas(fine_mm)
    share = float(areas_mm[away].sum() / _signed_areas(ground).sum())
    place = fine_mm[away].mean(axis=1)[np.argmax(areas_mm[away])]
    if share > MAX_BACKFACING_SHARE:
        raise SceneError(
            f"{100 * share:.0f} % of the pattern turn away from the camera, among others at ({place[0]:.3g}, "
            f"{place[1]:.3g}) mm; at most {100 * MAX_BACKFACING_SHARE:.0f} % can be drawn: take a "
            f"smaller displacement, "
            "a larger radius or a camera that looks more steeply"
        )
    tiles = _touched_tiles(fine[away], area_size)
    around = ground[_is_near_tiles(coarse, tiles)]
    xyd = _project_subdivided(around, seen, FINE_PARTS)
    corners_mm = _subdivided_corners_mm(around, FINE_PARTS).reshape(-1, 3, 2)
    origin_mm = corners_mm.min(axis=(0, 1))
    span_mm = float((corners_mm.max(axis=(0, 1)) - origin_mm).max())
    return Occlusion(
        xyd=xyd.reshape(-1, 3, 3),
        corners_mm=corners_mm,
        facing=np.sign(sign * _signed_areas(xyd)).ravel(),
        tiles=tiles,
        share=share,
        place_mm=place,
        tolerance_mm=DEPTH_SHARE * pitch_mm(layout),
        origin_mm=origin_mm,
        texel_mm=max(pitch_mm(layout) / TEXELS_PER_PITCH, span_mm / MAX_TEXTURE_PX),
    )


def _subdivided_corners_mm(ground: Points, parts: int) -> Points:
    """(P, parts^2, 3, 2) mm: the small triangles' corners."""
    at, small = subdivide_triangle(parts)
    return np.asarray((at @ ground)[:, small])


def _project_subdivided(ground: Points, seen: Callable[[Points], Points], parts: int) -> Points:
    """(P, parts^2, 3, 3): x, y in px and depth in mm of the small triangles' corners."""
    at, small = subdivide_triangle(parts)
    nodes = at @ ground
    mapped = seen(nodes.reshape(-1, 2))
    return np.asarray(mapped.reshape(*nodes.shape[:2], 3)[:, small])


def _signed_areas(triangles: Points) -> Points:
    """(...) signed areas of triangles (..., 3, 2 or more)."""
    a, b = (triangles[..., i, :2] - triangles[..., 0, :2] for i in (1, 2))
    return np.asarray(0.5 * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]))


def _touched_tiles(away: Points, area_size: tuple[int, int]) -> NDArray[np.int64]:
    """(K, 2) the tiles inside the area that triangles (n, 3, 3) reach into."""
    last = (np.asarray(area_size) - 1) // TILE_PX
    low = np.floor((away[..., :2].min(axis=1) + 0.5) / TILE_PX).astype(np.int64)
    high = np.floor((away[..., :2].max(axis=1) + 0.5) / TILE_PX).astype(np.int64)
    touched = np.zeros((last[1] + 1, last[0] + 1), dtype=np.bool_)
    for left, top, right, bottom in np.unique(
        np.hstack([np.maximum(low, 0), np.minimum(high, last)]), axis=0
    ):
        touched[top : bottom + 1, left : right + 1] = True
    rows, columns = np.nonzero(touched)
    return np.stack([columns, rows], axis=-1) * TILE_PX


def _is_near_tiles(coarse: Points, tiles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(P,) which patches, as far as their coarse nodes tell, reach into or near one of the tiles."""
    flat = np.ascontiguousarray(np.moveaxis(coarse[..., :2], -1, 0)).reshape(2, len(coarse), -1)
    low, high = flat.min(axis=2).T, flat.max(axis=2).T
    margin = 0.25 * (high - low).max(axis=1, initial=0.0, keepdims=True) + 2
    found = np.zeros(len(coarse), dtype=np.bool_)
    for tile in tiles:
        found |= ((high + margin >= tile - 0.5) & (low - margin <= tile + TILE_PX - 0.5)).all(axis=1)
    return found


def update_hidden_parts(planes: Planes, folds: Occlusion, texture: Planes, blur_px: float) -> None:
    """Correct an area's planes (n, height, width), made by ``coverage``, in place.

    Args:
        planes: the signed sums.
        folds: of the view.
        texture: (n, height, width) the same sums for the flat layout, of ``folds.texture_size``.
        blur_px: the optics' blur.
    """
    from cmpdesign.scene.drawing.occlusion_compiled import occlusion_residual

    uv = folds.texels_from_layout(folds.corners_mm)
    height, width = planes.shape[1:]
    reach = int(np.ceil(REACH_SIGMA * blur_px + 1)) if blur_px else 0
    offset = (np.arange(TILE_PX * SAMPLES_PER_PX) + 0.5) / SAMPLES_PER_PX - 0.5
    x, y = (np.ascontiguousarray(folds.xyd[..., axis].T) for axis in (0, 1))
    low_x, high_x, low_y, high_y = x.min(axis=0), x.max(axis=0), y.min(axis=0), y.max(axis=0)
    for left, top in folds.tiles:
        near = (high_x >= left - 0.5) & (low_x <= left + TILE_PX - 0.5)
        near &= (high_y >= top - 0.5) & (low_y <= top + TILE_PX - 0.5)
        row, column, missing = occlusion_residual(
            folds.xyd[near], uv[near], folds.facing[near], texture, left, top, TILE_PX, SAMPLES_PER_PX
        )
        if not missing.size:
            continue
        _, tall, wide = missing.shape
        y, x = top + offset[row : row + tall], left + offset[column : column + wide]
        rows = np.arange(max(int(y[0]) - reach, 0), min(int(y[-1]) + 2 + reach, height))
        columns = np.arange(max(int(x[0]) - reach, 0), min(int(x[-1]) + 2 + reach, width))
        down, across = (
            _pixel_response(rows[:, None] - y, blur_px),
            _pixel_response(columns[:, None] - x, blur_px),
        )
        window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        planes[:, *window] += (down @ missing @ across.T).astype(np.float32)


def _pixel_response(distance: Points, blur_px: float) -> Points:
    """What a pixel sees of a sample at a distance along one axis."""
    if blur_px == 0:
        return (np.abs(distance) < 0.5) / SAMPLES_PER_PX
    return box_gaussian(distance, blur_px) / SAMPLES_PER_PX


def is_hidden(folds: Occlusion, xyd: Points, facing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) which points, x and y in px of the area and depth in mm, lie behind another part or ``facing`` away."""
    from cmpdesign.scene.drawing.occlusion_compiled import nearest_depth

    tile = np.floor((xyd[:, :2] + 0.5) / TILE_PX) * TILE_PX
    asked = (tile[:, None] == folds.tiles).all(axis=2).any(axis=1)
    behind = ~facing
    rising = np.flatnonzero(asked)[np.argsort(xyd[asked, 0], kind="stable")]
    nearest = nearest_depth(folds.xyd, xyd[rising])
    behind[rising] |= xyd[rising, 2] > nearest + folds.tolerance_mm
    return behind
