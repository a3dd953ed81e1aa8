"""A scene becomes an image and its ground truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout import BLACK
from cmpdesign.scene.camera import homography, is_mirrored, pitch_mm, project
from cmpdesign.scene.coverage import Engine, coverage
from cmpdesign.scene.damage import Blob, Damage, Scratch, bled, missing
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.light import gain
from cmpdesign.scene.optics import point_spread
from cmpdesign.scene.paths import Segments, join, segments
from cmpdesign.scene.scene import Scene
from cmpdesign.scene.sensor import Sensor, expose
from cmpdesign.scene.surface import points_to_check, require_no_fold
from cmpdesign.scene.truth import Truth

Points = NDArray[np.float64]
Planes = NDArray[np.float32]

# Everything random has a stream of its own, so that one part's change leaves the others as they were.
BACKGROUND, MISSING, BLEED, NOISE = range(4)


@dataclass(frozen=True, eq=False)
class Rendered:
    """An image (H, W, 3) BGR, uint8 (uint16 for a 16-bit sensor), and its truth."""

    image: NDArray[np.uint8] | NDArray[np.uint16]
    truth: Truth


@dataclass(frozen=True, eq=False)
class View:
    """The way from the layout to the image: ``image_from_layout`` maps (N, 2) mm to px."""

    image_from_layout: Callable[[Points], Points]
    h: NDArray[np.float64]
    curved: bool


def render(scene: Scene, *, size: tuple[int, int] = (640, 480), engine: Engine = "compiled") -> Rendered:
    """Draw a scene; ``size`` is (width, height) in px.

    Raises:
        SceneError: the surface folds, a part lies behind the camera, or a value is out of range.
    """
    if min(size) < 1:
        raise SceneError(f"size is {size[0]} x {size[1]}; it must be at least 1 x 1 px")
    view = look(scene, size)
    gone = missing_cells(scene)
    planes = _pattern(scene, view, gone, size, engine)
    if scene.damage and (scene.damage.blobs or scene.damage.scratches):
        planes = _with_dirt(planes, scene.damage, scene.blur_px, view, size, engine)
    if scene.light:
        planes = planes * gain(scene.light, size)
    for glare in scene.damage.glare if scene.damage else ():
        planes = planes + glare.plane(size)
    image = expose(scene.sensor or Sensor(), planes, _rng(scene, NOISE))
    return Rendered(image, _truth(scene, view, gone, size))


def render_truth(scene: Scene, *, size: tuple[int, int] = (640, 480)) -> Truth:
    """The truth of ``render`` without its image."""
    return _truth(scene, look(scene, size), missing_cells(scene), size)


def look(scene: Scene, size: tuple[int, int]) -> View:
    """The scene's map from layout to image.

    Raises:
        SceneError: the surface folds.
    """
    layout, surface = scene.layout, scene.surface
    h = homography(scene.camera, layout, size)
    if surface is None:
        return View(lambda xy_mm: project(h, xy_mm), h, curved=False)
    checked = points_to_check(layout.marker_xy_mm, layout.cell_corners)
    require_no_fold(surface, checked, 1e-4 * pitch_mm(layout))
    return View(lambda xy_mm: project(h, surface(xy_mm)), h, curved=True)


def _rng(scene: Scene, stream: int) -> np.random.Generator:
    return np.random.default_rng([scene.seed, stream])


def missing_cells(scene: Scene) -> NDArray[np.bool_]:
    """(C,) bool: the cells that fell out of this scene's pattern."""
    if scene.damage is None:
        return np.zeros(len(scene.layout.cell_color), dtype=np.bool_)
    return missing(scene.damage, scene.layout, _rng(scene, MISSING))


def _pattern(
    scene: Scene, view: View, gone: NDArray[np.bool_], size: tuple[int, int], engine: Engine
) -> Planes:
    """Ground over background, inks over ground: (3, H, W), B, G, R, blurred."""
    layout = scene.layout
    drawn = np.flatnonzero((layout.cell_color != BLACK) & ~gone)
    polygons = layout.marker_xy_mm[layout.cell_corners[drawn]]
    bleed_mm = scene.damage.bleed_mm if scene.damage else 0.0
    if bleed_mm:
        polygons = bled(polygons, bleed_mm, _rng(scene, BLEED))
    ground = segments(layout.outline_mm[None], view.image_from_layout, view.curved)
    cells = segments(polygons, view.image_from_layout, view.curved)

    # Planes: B, G, R over black, the ground, and where inks may overlap also their sum.
    black = _bgr(scene.ink(BLACK))
    over_black = np.array([_bgr(scene.ink(color)) - black for color in layout.cell_color[drawn]]).reshape(
        -1, 3
    )
    values = np.zeros((1 + len(drawn), 5 if bleed_mm else 4))
    values[0, 3] = 1.0
    values[1:, :3] = over_black
    if bleed_mm:
        values[1:, 4] = 1.0
    covered = coverage(join([ground, cells]), values, size, point_spread(scene.blur_px), engine)

    inks, ground_share = covered[:3], covered[3]
    if bleed_mm:
        inks = inks / np.maximum(covered[4], 1.0)
    behind = _blurred(scene.background.planes(size, _rng(scene, BACKGROUND)), scene.blur_px)
    black_plane = black.astype(np.float32)[:, None, None]
    return np.asarray(inks + behind + ground_share * (black_plane - behind), dtype=np.float32)


def _bgr(rgb: tuple[float, float, float]) -> NDArray[np.float64]:
    return np.asarray(rgb[::-1], dtype=np.float64)


def _blurred(planes: Planes, blur_px: float) -> Planes:
    """The background is a picture, not a shape: an ordinary blur does."""
    if blur_px == 0 or not any(planes.strides[1:]):
        return planes
    import cv2

    return np.stack([cv2.GaussianBlur(plane, (0, 0), blur_px) for plane in planes])


def _with_dirt(
    planes: Planes, damage: Damage, blur_px: float, view: View, size: tuple[int, int], engine: Engine
) -> Planes:
    """Blobs and scratches over the pattern; where they overlap, they mix."""
    spots: list[Blob | Scratch] = [*damage.blobs, *damage.scratches]
    outlines: list[Segments] = [
        segments(spot.polygon()[None], view.image_from_layout, view.curved) for spot in spots
    ]
    values = np.array([[*spot.rgb[::-1], 1.0] for spot in spots])
    covered = coverage(join(outlines), values, size, point_spread(blur_px), engine)
    overlap = np.maximum(covered[3], 1.0)
    return np.asarray(planes * (1 - covered[3] / overlap) + covered[:3] / overlap, dtype=np.float32)


def _truth(scene: Scene, view: View, gone: NDArray[np.bool_], size: tuple[int, int]) -> Truth:
    layout = scene.layout
    marker_xy_px = view.image_from_layout(layout.marker_xy_mm)
    inside = np.all((marker_xy_px >= -0.5) & (marker_xy_px < np.asarray(size) - 0.5), axis=1)
    damaged = gone | (_covered(scene, view, _cell_samples(scene)).mean(axis=1) >= 0.5)
    touching = np.zeros(len(marker_xy_px), dtype=np.bool_)
    touching[layout.cell_corners[(layout.cell_color != BLACK) & ~damaged]] = True
    hidden = _covered(scene, view, layout.marker_xy_mm[:, None])[:, 0]

    m = layout.virtual_per_edge
    share = (np.arange(1, m + 1) / (m + 1))[:, None]
    ends = layout.marker_xy_mm[layout.edges][:, :, None]
    virtual_mm = ends[:, 0] * (1 - share) + ends[:, 1] * share
    return Truth(
        marker_xy_px=marker_xy_px,
        visible=inside & touching & ~hidden,
        virtual_xy_px=view.image_from_layout(virtual_mm.reshape(-1, 2)).reshape(len(layout.edges), m, 2),
        cell_visible=inside[layout.cell_corners].all(axis=1) & ~damaged,
        mirrored=is_mirrored(scene.camera, layout),
        H=None if view.curved else view.h,
    )


def _cell_samples(scene: Scene) -> Points:
    """(C, samples, 2) mm: every cell's centre, and points towards its corners and sides."""
    corners = scene.layout.marker_xy_mm[scene.layout.cell_corners]
    centre = corners.mean(axis=1, keepdims=True)
    rim = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)
    return np.concatenate([centre, centre + 0.6 * (rim - centre)], axis=1)


def _covered(scene: Scene, view: View, xy_mm: Points) -> NDArray[np.bool_]:
    """Which of the points (N, n, 2) mm lie under dirt or glare."""
    covered = np.zeros(xy_mm.shape[:2], dtype=np.bool_)
    if scene.damage is None:
        return covered
    spots: list[Blob | Scratch] = [*scene.damage.blobs, *scene.damage.scratches]
    for spot in spots:
        covered |= spot.covers(xy_mm)
    if scene.damage.glare:
        xy_px = view.image_from_layout(xy_mm.reshape(-1, 2)).reshape(xy_mm.shape)
        for glare in scene.damage.glare:
            covered |= glare.covers(xy_px)
    return covered
