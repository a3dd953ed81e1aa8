"""Rendering of a scene to an image and its ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.files.atomic import write_file
from cmpdesign.files.images import encode_image
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene.camera.plain import pitch_mm
from cmpdesign.scene.drawing.coverage import Engine, draw_coverage
from cmpdesign.scene.drawing.encoding import encode_planes
from cmpdesign.scene.drawing.occlusion import update_hidden_parts
from cmpdesign.scene.drawing.paths import join_segments, project_polygons
from cmpdesign.scene.drawing.relief import seen_polygons
from cmpdesign.scene.drawing.view import SceneView, scene_views
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.damage import Blob, Damage, Scratch, bleed_polygons, sample_missing_cells
from cmpdesign.scene.parts.light import light_gain
from cmpdesign.scene.parts.optics import make_point_spread
from cmpdesign.scene.parts.sensor import Sensor, expose_sensor
from cmpdesign.scene.scene import Scene
from cmpdesign.scene.truth import Truth, save_truth
from extractor.image.response import decode_values

Points = NDArray[np.float64]
Planes = NDArray[np.float32]

# Every random part has its own stream, so that a change of one part does not affect the others.
BACKGROUND_STREAM, MISSING_STREAM, BLEED_STREAM, NOISE_STREAM = range(4)


@dataclass(frozen=True, eq=False)
class Rendered:
    """An image (H, W, 3) BGR, uint8 (uint16 for a 16-bit sensor), its truth, and warnings of doubtful parts."""

    image: NDArray[np.uint8] | NDArray[np.uint16]
    truth: Truth
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"<Rendered: {width} x {height} px, {self.truth}, {len(self.warnings)} warnings>"

    def _repr_png_(self) -> bytes:
        """The image, for notebooks."""
        return encode_image(self.image, Path("a.png"))

    def save(self, path: str | Path, truth: str | Path | None = None) -> None:
        """Write the image in the format of the file's ending, and the truth as .npz where a file is given.

        Raises:
            CmpDesignError: an ending of no image format, or of one with fewer bits; nothing is written.
            OutputError: a file cannot be written.
        """
        content = encode_image(self.image, Path(path))
        if truth is not None:
            save_truth(self.truth, truth)
        write_file(path, content)


def render(scene: Scene, *, size: tuple[int, int] = (640, 480), engine: Engine = "compiled") -> Rendered:
    """Draw a scene.

    Where several views share the image, pixels outside all views are dark.

    Args:
        scene: the scene.
        size: the image's (width, height) px.
        engine: "compiled" (C++) or the equivalent "numpy".

    Raises:
        SceneError: the surface folds, a part lies behind a camera or turns away from it, or a value is out of range.
    """
    views = _checked_views(scene, size)
    missing = missing_cell_mask(scene)
    background = _blur_planes(_background_light(scene, size), scene.blur_px)
    parts = [_draw_view(scene, view, missing, background, engine) for view in views]
    planes = _assemble_views(views, parts, size)
    if scene.light:
        planes = planes * light_gain(scene.light, size)
    for glare in scene.damage.glare if scene.damage else ():
        planes = planes + glare.plane(size)
    sensor = scene.sensor or Sensor()
    image = expose_sensor(sensor, encode_planes(sensor, planes, engine), _noise_rng(scene))
    warnings = (*scene.warnings, *(view.warning for view in views if view.occlusion))
    return Rendered(image, _make_truth(scene, views, missing), warnings)


def render_truth(scene: Scene, *, size: tuple[int, int] = (640, 480)) -> Truth:
    """The truth of ``render`` without its image."""
    return _make_truth(scene, _checked_views(scene, size), missing_cell_mask(scene))


def _checked_views(scene: Scene, size: tuple[int, int]) -> tuple[SceneView, ...]:
    if min(size) < 1:
        raise SceneError(f"size is {size[0]} x {size[1]}; it must be at least 1 x 1 px")
    return scene_views(scene, size)


def _assemble_views(views: tuple[SceneView, ...], parts: list[Planes], size: tuple[int, int]) -> Planes:
    if len(parts) == 1 and parts[0].shape[1:] == size[::-1]:
        return parts[0]
    planes = np.zeros((3, size[1], size[0]), dtype=np.float32)
    for view, part in zip(views, parts, strict=True):
        planes[view.window] = part
    return planes


def _draw_view(
    scene: Scene, view: SceneView, missing: NDArray[np.bool_], background: Planes, engine: Engine
) -> Planes:
    """(3, height, width): one view's part of the image."""
    planes = _draw_pattern(scene, view, missing, background[view.window], engine)
    if scene.damage and (scene.damage.blobs or scene.damage.scratches):
        return _cover_with_dirt(scene, planes, scene.damage, view, engine)
    return planes


def _stream_rng(scene: Scene, stream: int) -> np.random.Generator:
    return np.random.default_rng([scene.seed, stream])


def _noise_rng(scene: Scene) -> np.random.Generator:
    """The noise's stream, different in every frame of a sequence. All other random parts do not change."""
    return np.random.default_rng(
        [scene.seed, NOISE_STREAM, scene.frame] if scene.frame else [scene.seed, NOISE_STREAM]
    )


def missing_cell_mask(scene: Scene) -> NDArray[np.bool_]:
    """(C,) bool: the missing cells of this scene."""
    if scene.damage is None:
        return np.zeros(len(scene.layout.cell_color), dtype=np.bool_)
    return sample_missing_cells(scene.damage, scene.layout, _stream_rng(scene, MISSING_STREAM))


def _draw_pattern(
    scene: Scene, view: SceneView, missing: NDArray[np.bool_], background: Planes, engine: Engine
) -> Planes:
    """(3, height, width) B, G, R, blurred: ground over background, inks over ground."""
    layout = scene.layout
    seen = np.flatnonzero((layout.cell_color != BLACK) & ~missing)
    polygons = layout.colored_outlines_mm[~missing[layout.colored_cells]]
    bleed_mm = scene.damage.bleed_mm if scene.damage else 0.0
    if bleed_mm:
        polygons = bleed_polygons(polygons, bleed_mm, _stream_rng(scene, BLEED_STREAM))
    height_mm = layout.cell_height_mm
    if height_mm:
        polygons = seen_polygons(view, polygons, height_mm)
    overlaps = bool(bleed_mm or height_mm)
    # Planes: B, G, R over black, the ground, and where cells overlap the sum of the inks' coverage.
    black = _light_bgr(scene, scene.ink(BLACK))
    inks = {
        color: _light_bgr(scene, scene.ink(color)) - black for color in np.unique(layout.cell_color[seen])
    }
    over_black = np.array([inks[color] for color in layout.cell_color[seen]]).reshape(-1, 3)
    values = np.zeros((1 + len(seen), 5 if overlaps else 4))
    values[0, 3] = 1.0
    values[1:, :3] = over_black
    if overlaps:
        values[1:, 4] = 1.0
    covered = _draw_polygons(view, [layout.outline_mm[None], polygons], values, scene.blur_px, engine)

    colored, ground_share = covered[:3], covered[3]
    if overlaps:
        colored = colored / np.maximum(covered[4], 1.0)
    behind = background if any(background.strides[1:]) else background[:, :1, :1]
    drawn = np.asarray(colored, dtype=np.float32)
    drawn += behind
    drawn += ground_share * (black.astype(np.float32)[:, None, None] - behind)
    return drawn


def _draw_polygons(
    view: SceneView, polygons_mm: list[Points], values: Points, blur_px: float, engine: Engine
) -> Planes:
    """(planes, height, width): the sum of polygons of the layout in a view's area, without hidden parts.

    Args:
        view: the view.
        polygons_mm: arrays (K, n, 2) of counter-clockwise polygons.
        values: (polygons, planes) the value that each polygon adds to each plane.
        blur_px: the optics' blur.
        engine: see ``draw_coverage``.
    """
    spread, occlusion = make_point_spread(blur_px), view.occlusion
    segments = join_segments(
        [project_polygons(part, view.area_from_layout, view.curved) for part in polygons_mm]
    )
    planes = draw_coverage(segments, values, view.area[2:], spread, engine, view.orientation)
    if occlusion is not None:
        flat_segments = join_segments(
            [project_polygons(part, occlusion.texels_from_layout, False) for part in polygons_mm]
        )
        texture = draw_coverage(flat_segments, values, occlusion.texture_size, make_point_spread(0.0), engine)
        update_hidden_parts(planes, occlusion, texture, blur_px)
    return planes


def _light_bgr(scene: Scene, rgb: tuple[float, float, float]) -> NDArray[np.float64]:
    """(3,) the light, channels B, G, R, of a color as a picture shows this color."""
    return decode_values(np.asarray(rgb[::-1], dtype=np.float64), _light_of_values(scene))


def _light_of_values(scene: Scene) -> NDArray[np.float64]:
    return (scene.sensor or Sensor()).light_of_values()


def _background_light(scene: Scene, size: tuple[int, int]) -> Planes:
    """(3, height, width) the background's light; one color is a view of three numbers."""
    planes = scene.background.planes(size, _stream_rng(scene, BACKGROUND_STREAM))
    if any(planes.strides[1:]):
        return decode_values(planes, _light_of_values(scene)).astype(np.float32)
    light = decode_values(planes[:, :1, :1], _light_of_values(scene)).astype(np.float32)
    return np.broadcast_to(light, planes.shape)


def _blur_planes(planes: Planes, blur_px: float) -> Planes:
    """The background after a Gaussian blur of its pixels; it has no exact shapes."""
    if blur_px == 0 or not any(planes.strides[1:]):
        return planes
    import cv2

    return np.stack([cv2.GaussianBlur(plane, (0, 0), blur_px) for plane in planes])


def _cover_with_dirt(scene: Scene, planes: Planes, damage: Damage, view: SceneView, engine: Engine) -> Planes:
    """Planes with blobs and scratches over the pattern; where they overlap, their colors are averaged."""
    spots: list[Blob | Scratch] = [*damage.blobs, *damage.scratches]
    values = np.array([[*_light_bgr(scene, spot.rgb), 1.0] for spot in spots])
    covered = _draw_polygons(view, [spot.polygon()[None] for spot in spots], values, scene.blur_px, engine)
    overlap = np.maximum(covered[3], 1.0)
    return np.asarray(planes * (1 - covered[3] / overlap) + covered[:3] / overlap, dtype=np.float32)


def _make_truth(scene: Scene, views: tuple[SceneView, ...], missing: NDArray[np.bool_]) -> Truth:
    """The truth; with a leading axis of views if the camera is a tuple."""
    layout, surface = scene.layout, views[0].xyz_from_layout
    xyz = surface(layout.marker_xy_mm), surface(layout.virtual_xy_mm.reshape(-1, 2))
    parts = [_view_truth(scene, view, missing, *xyz) for view in views]
    columns = {name: [part[name] for part in parts] for name in parts[0]}
    several = isinstance(scene.camera, tuple)
    flat = [view.homography for view in views if view.homography is not None]
    return Truth(
        **{name: np.stack(values) if several else values[0] for name, values in columns.items()},
        mirrored=np.array([view.mirrored for view in views]) if several else views[0].mirrored,
        H=None if len(flat) < len(views) else np.stack(flat) if several else flat[0],
        marker_xyz_mm=xyz[0],
        virtual_xyz_mm=xyz[1].reshape(*layout.virtual_xy_mm.shape[:2], 3),
    )


def _view_truth(
    scene: Scene, view: SceneView, missing: NDArray[np.bool_], marker_xyz_mm: Points, virtual_xyz_mm: Points
) -> dict[str, NDArray[Any]]:
    """The fields of the truth that differ from view to view."""
    layout, step_mm = scene.layout, 1e-4 * pitch_mm(scene.layout)
    marker_xy_px = view.project(marker_xyz_mm)
    inside = view.contains(marker_xy_px)
    samples = _cell_samples(scene)
    cell_hidden = view.is_hidden(samples.reshape(-1, 2), step_mm).reshape(samples.shape[:2])
    damaged = missing | ((_is_covered(scene, view, samples) | cell_hidden).mean(axis=1) >= 0.5)
    touching = np.zeros(len(marker_xy_px), dtype=np.bool_)
    touching[layout.cell_corners[(layout.cell_color != BLACK) & ~damaged]] = True
    hidden = _is_covered(scene, view, layout.marker_xy_mm[:, None])[:, 0]
    hidden |= view.is_hidden(layout.marker_xy_mm, step_mm)
    return {
        "marker_xy_px": marker_xy_px,
        "visible": inside & touching & ~hidden,
        "virtual_xy_px": view.project(virtual_xyz_mm).reshape(layout.virtual_xy_mm.shape),
        "cell_visible": inside[layout.cell_corners].all(axis=1) & ~damaged,
    }


def _cell_samples(scene: Scene) -> Points:
    """(C, samples, 2) mm: every cell's centre, and points towards its corners and sides."""
    corners = scene.layout.marker_xy_mm[scene.layout.cell_corners]
    centre = corners.mean(axis=1, keepdims=True)
    rim = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)
    return np.concatenate([centre, centre + 0.6 * (rim - centre)], axis=1)


def _is_covered(scene: Scene, view: SceneView, xy_mm: Points) -> NDArray[np.bool_]:
    """(N, n) bool: which of the points (N, n, 2) mm lie under dirt or glare."""
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
