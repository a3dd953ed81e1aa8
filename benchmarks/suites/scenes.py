"""The scenes of stated figures of accuracy, and the checkerboard for other detectors in the same scenes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import RED, WHITE
from cmpdesign.scene import Camera, Optics, Plain, Press, Scene, Sensor, Twist, composed, standard_scene
from cmpdesign.scene import standard_layout as built_layout
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.standard import INKS, STANDARD_LAYERS, STANDARD_SIZE
from extractor import Extractor, Reference, parse_layout
from extractor.presets import Preset

WRONG_SHARE = 0.3  # of the shortest edge; a marker with a larger error is wrong
TILT_DEG = 35.0
SCENE_KINDS = ("flat", "tilt", "bulge", "twist")
SURFACES = {
    "bulge": composed(Press(radius_mm=5.0, depth_mm=1.2)),
    "twist": composed(Twist(radius_mm=5.0, angle_deg=18.0)),
}
STANDARD_BLUR_PX, STANDARD_PITCH_PX = 1.0, 20.0
Response = Literal["srgb", "linear"] | float
BOARD_LAYERS = 10  # 21 x 21 squares


@dataclass(frozen=True)
class SceneCase:
    """A pattern and its imaging conditions. Lengths in px of the image, noise in grey levels of the encoded image."""

    pattern: str = "honeycomb"
    kind: str = "flat"
    blur_px: float = STANDARD_BLUR_PX
    noise: float = 2.0
    pitch_px: float = STANDARD_PITCH_PX
    layers: int = STANDARD_LAYERS
    response: Response = "srgb"

    @property
    def name(self) -> str:
        """The pattern's name; for honeycomb patterns the kind of scene, or the changed parameter of a flat scene."""
        if self.pattern != "honeycomb":
            return self.pattern
        if self.kind == "flat" and self.blur_px != STANDARD_BLUR_PX:
            return f"blur {self.blur_px:g} px"
        if self.kind == "flat" and self.pitch_px != STANDARD_PITCH_PX:
            return f"pitch {self.pitch_px:g} px"
        return self.kind

    def scene(self, layout: Layout | None = None) -> Scene:
        """The case's scene, of its pattern or of another layout."""
        tilt_deg = TILT_DEG if self.kind == "tilt" else 0.0
        return replace(
            standard_scene(layout or standard_layout(self.pattern, self.layers)),
            camera=Camera(self.pitch_px, rotation_deg=7.3, tilt_deg=tilt_deg, tilt_axis_deg=30.0),
            surface=SURFACES.get(self.kind),
            optics=Optics(self.blur_px),
            sensor=Sensor(noise=self.noise, response=self.response),
        )

    def board(self, plain: bool = True) -> Scene:
        """A checkerboard of the same edge length under the same conditions, in white surroundings.

        ``plain``: black and white only; else with the square pattern's red cell.
        """
        return replace(self.scene(checkerboard_layout(plain)), background=Plain(INKS["white"]))


standard_layout = cache(built_layout)


@cache
def cached_reference(pattern: str, layers: int) -> Reference:
    return parse_layout(layout_to_json(standard_layout(pattern, layers)))


def make_extractor(reference: Reference, preset: Preset, response: Response) -> Extractor:
    """The extractor for pictures with a response."""
    return Extractor(reference, preset, response)


def cached_extractor(case: SceneCase, preset: Preset = "balanced") -> Extractor:
    return make_extractor(cached_reference(case.pattern, case.layers), preset, case.response)


@cache
def checkerboard_layout(plain: bool) -> Layout:
    """The square pattern without its black border, because detectors of checkerboards need white around the board."""
    layout = build_layout(load_design("square", {"layers": str(BOARD_LAYERS), "pitch_mm": "1.0"}))
    color = layout.cell_color.copy()
    if plain:
        color[color == RED] = WHITE
    low, high = layout.marker_xy_mm.min(axis=0), layout.marker_xy_mm.max(axis=0)
    outline = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    return replace(layout, cell_color=color, outline_mm=outline, border_mm=0.0)


def inner_markers(layout: Layout) -> NDArray[np.bool_]:
    """(M,) bool: the markers with all their gridlines, six in a triangular pattern, four in the board."""
    row, column = layout.marker_layer, layout.marker_index
    if layout.cell_corners.shape[1] == 3:
        return np.asarray(row < row.max())
    return np.asarray((row > 0) & (row < row.max()) & (column > 0) & (column < column.max()))


def shortest_edges(layout: Layout, true_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) px: the shortest edge at each marker; to places that are not known, NaN, there is none."""
    ends = true_px[layout.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shortest = np.full(len(true_px), np.inf)
    for side in (0, 1):
        np.fmin.at(shortest, layout.edges[:, side], length)
    return shortest


def bound_rms_px(scene: Scene, *choices: NDArray[np.bool_]) -> list[float]:
    """The exact Cramer-Rao bound of sets of markers, RMS per axis in px, without markers that are not visible."""
    trace = np.einsum("mii->m", exact_bound(scene, size=STANDARD_SIZE))
    return [float(np.sqrt(np.nanmean(trace[chosen]) / 2)) for chosen in choices]
