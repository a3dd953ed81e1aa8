"""The error that a camera allows per marker, by the exact Cramer-Rao bound of the encoded picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.bounds.gridline_bound import cramer_rao
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.parts.background import Plain
from cmpdesign.scene.parts.optics import Optics
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.scene import Scene

# The exact bound needs a hundred renderings. Therefore the bound of a small pattern, at a whole pitch not above this
# pitch, is used as a factor on the bound of isolated gridlines. The factor falls with the pitch, to 1.05 at 30 px: the
# prediction at larger pitches is too high by less than a tenth.
EXACT_LAYERS, EXACT_PITCH_PX = 3, 20
# With this number of layers, the inner markers have the gridline bound of the inner markers of any larger pattern.
GRIDLINE_LAYERS = 8
# The reader's maps have markers on one side only at the rim. There a gridline moves by a tenth less with its end than
# the straight gridlines of the bound (``extractor.layout.gridline_slopes``), and errors are larger by as much.
RIM_FACTOR = 1.1
Points = NDArray[np.float64]
# A turn at which no gridline lies along a row of pixels.
TURN_DEG = 7.3


@dataclass(frozen=True)
class Imaging:
    """Properties of a camera's picture of the pattern.

    Attributes:
        blur_px: sigma of the Gaussian blur of optics and pixel together.
        noise: standard deviation in 255ths.
    """

    blur_px: float = 1.0
    noise: float = 2.0


class PredictedError(NamedTuple):
    """Standard deviation per axis, px: RMS of the inner markers, and of the outermost layer."""

    inner_px: float
    rim_px: float


@cache
def predict_error(pitch_px: float, imaging: Imaging) -> PredictedError:
    """The smallest error of free markers at a pitch, in an sRGB picture of the default inks with a black border.

    In the outermost layer, the error is that of the reader's curved gridlines.

    Args:
        pitch_px: pixels from marker to marker.
        imaging: blur and noise.
    """
    factor = _exact_over_gridline(min(int(pitch_px), EXACT_PITCH_PX), imaging)
    large = _errors(GRIDLINE_LAYERS, pitch_px, imaging, cramer_rao)
    return PredictedError(large.inner_px * factor.inner_px, RIM_FACTOR * large.rim_px * factor.rim_px)


@cache
def _exact_over_gridline(pitch_px: int, imaging: Imaging) -> PredictedError:
    """The deviations by the exact bound over those by the bound of isolated gridlines."""
    exact, isolated = (_errors(EXACT_LAYERS, pitch_px, imaging, bound) for bound in (exact_bound, cramer_rao))
    return PredictedError(exact.inner_px / isolated.inner_px, exact.rim_px / isolated.rim_px)


def _errors(layers: int, pitch_px: float, imaging: Imaging, bound: Callable[..., Points]) -> PredictedError:
    """RMS deviations of a whole pattern's markers: of the inner half of its layers, and of the outermost."""
    scene, size = _patch(layers, pitch_px, imaging)
    variance_px2 = np.einsum("mii->m", bound(scene, size=size)) / 2
    layer = scene.layout.marker_layer
    inner, rim = variance_px2[layer <= layers // 2], variance_px2[layer == layers]
    return PredictedError(float(np.sqrt(inner.mean())), float(np.sqrt(rim.mean())))


def _patch(layers: int, pitch_px: float, imaging: Imaging) -> tuple[Scene, tuple[int, int]]:
    """A picture that shows a whole pattern, and its size."""
    design = Design.model_validate({"pattern": "honeycomb", "layers": layers, "pitch_mm": 1, "border_mm": 1})
    layout = build_layout(design)
    scene = Scene(
        layout, Camera(pitch_px, TURN_DEG), optics=Optics(imaging.blur_px), sensor=Sensor(noise=imaging.noise)
    )
    side = int(np.ceil(1.05 * pitch_px * float(np.hypot(*layout.size_mm)))) + 8
    return replace(scene, background=Plain(scene.ink(BLACK))), (side, side)
