"""A chain becomes a picture and its truth.

The pattern is drawn with exact coverage, through the lens's geometry and its sharp point spread, in linear light. All
further stages work on this light.

The true position of a marker is the designed position, mapped through the pose, the distortion and the green channel.
Errors of the pad (shifted colors, scattered, rounded or bled corners) do not move the truth: they count as errors of
the reader. The chromatic aberration displaces red and blue in opposite directions about green. Motion is centred: the
truth is the position in the middle of the exposure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.development import balance_gains, develop
from benchmarks.suites.camera.lens import lens_map, spread_light
from benchmarks.suites.camera.pad import cell_polygons_mm, colored_cells
from benchmarks.suites.camera.parts import SIZE_PX, Chain, Inks
from benchmarks.suites.camera.sensor import expose
from benchmarks.suites.camera.surrounds import surround_planes
from benchmarks.suites.scenes import standard_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.scene import Camera
from cmpdesign.scene.camera.plain import camera_homography, project_by_homography
from cmpdesign.scene.drawing.coverage import draw_coverage
from cmpdesign.scene.drawing.paths import join_segments, project_polygons
from cmpdesign.scene.parts.light import light_gain
from cmpdesign.scene.parts.optics import make_point_spread

Points = NDArray[np.float64]
Planes = NDArray[np.float32]
PAD_STREAM, SURROUND_STREAM, NOISE_STREAM = range(3)
CHANNELS = (0, 1, 2)  # B, G, R


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """A picture and its truth.

    Attributes:
        image: (H, W, 3) uint8 BGR.
        layout: the designed pattern.
        marker_xy_px: (M, 2) float64, the true positions.
        visible: (M,) bool: inside the image, and a corner of a colored or white cell.
    """

    image: NDArray[np.uint8]
    layout: Layout
    marker_xy_px: Points
    visible: NDArray[np.bool_]


def shoot(chain: Chain) -> CameraPicture:
    """The picture of a chain."""
    lamps = light_gain(chain.lamps, SIZE_PX)
    # the camera's exposure fits the strongest channel of the mean light
    mean_light = lamps.mean(axis=(1, 2), dtype=np.float64)
    light = radiance(chain) * (lamps / np.float32(mean_light.max()))
    light = spread_light(light, chain.lens)
    gains = balance_gains(chain.development, mean_light / mean_light.max())
    exposed = expose(light, chain.sensor, gains, _stream(chain, NOISE_STREAM))
    layout = standard_layout(chain.pose.pattern, chain.pose.layers, chain.pose.code)
    marker_xy_px = image_map(chain, None)(layout.marker_xy_mm)
    inside = (marker_xy_px >= -0.5) & (marker_xy_px < np.array(SIZE_PX) - 0.5)
    return CameraPicture(
        develop(exposed, chain.development), layout, marker_xy_px, inside.all(axis=1) & layout.present
    )


def radiance(chain: Chain) -> Planes:
    """(3, H, W) float32, channels B, G, R: the reflectance behind every pixel, blurred by the sharp lens."""
    background = surround_planes(chain.surround, _stream(chain, SURROUND_STREAM))
    if any(background.strides[1:]):
        background = np.stack([cv2.GaussianBlur(plane, (0, 0), chain.lens.blur_px) for plane in background])
    if chain.lens.aberration_px:
        drawn = [_draw_channels(chain, background, (channel,)) for channel in CHANNELS]
        return np.concatenate(drawn)
    return _draw_channels(chain, background, CHANNELS)


def image_map(chain: Chain, channel: int | None) -> Callable[[Points], Points]:
    """The map from the layout (N, 2) mm to the image (N, 2) px, in a channel or in the truth's (None)."""
    pose = chain.pose
    camera = Camera(pose.pitch_px, pose.roll_deg, pose.tilt_deg, pose.tilt_axis_deg, pose.centre_px)
    homography = camera_homography(camera, standard_layout(pose.pattern, pose.layers, pose.code), SIZE_PX)
    through_lens = lens_map(chain.lens, channel)
    return lambda xy_mm: through_lens(project_by_homography(homography, xy_mm))


def _draw_channels(chain: Chain, background: Planes, channels: tuple[int, ...]) -> Planes:
    """(len(channels), H, W): the channels that share one geometry."""
    layout = standard_layout(chain.pose.pattern, chain.pose.layers, chain.pose.code)
    inks = _ink_table(chain.inks)[:, channels]
    black = inks[COLORS.index("black")]
    polygons = cell_polygons_mm(layout, chain.pad, chain.pose.pitch_px, _stream(chain, PAD_STREAM))
    # planes: the ground's coverage, the sum of the cells' coverage, the cells' light over black
    values = np.zeros((1 + len(polygons), 2 + len(channels)))
    values[0, 0] = values[1:, 1] = 1.0
    values[1:, 2:] = inks[layout.cell_color[colored_cells(layout)]] - black
    mapped, curved = image_map(chain, channels[0]), bool(chain.lens.distortion)
    segments = join_segments(
        [project_polygons(part, mapped, curved) for part in (layout.outline_mm[None], polygons)]
    )
    drawn = draw_coverage(segments, values, SIZE_PX, make_point_spread(chain.lens.blur_px))
    # where cells overlap, their light is averaged
    colored = drawn[2:] / np.maximum(drawn[1], 1.0)
    behind = background[list(channels)]
    ground = black.astype(np.float32)[:, None, None]
    return np.asarray(colored + behind + drawn[0] * (ground - behind), dtype=np.float32)


def _ink_table(inks: Inks) -> NDArray[np.float64]:
    """(colors, 3) reflectances B, G, R by the layout's numbers of colors."""
    by_name = {field.name: getattr(inks, field.name) for field in fields(inks)}
    return np.array([by_name[name][::-1] for name in COLORS])


def _stream(chain: Chain, stream: int) -> np.random.Generator:
    return np.random.default_rng([chain.seed, stream])
