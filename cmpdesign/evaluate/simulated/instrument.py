"""A pattern on a simulated sensor: the camera's picture, and the markers read from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.evaluate.simulated.conditions import ImagingConditions, mean_conditions
from cmpdesign.evaluate.simulated.sensor import SimulatedSensor, parse_sensor
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout

if TYPE_CHECKING:
    from cmpdesign.scene import Rendered
    from extractor import Markers, Reference
    from extractor.presets import Preset
    from extractor.space.camera import View
    from extractor.space.reconstruction import Reconstructor

Points = NDArray[np.float64]
# Assumed deviation of the square pattern's corners, whose reader states no covariance.
SQUARE_SIGMA_PX = 0.1
REST_SEED = 0


@dataclass(frozen=True, eq=False)
class Instrument:
    """A sensor with one pattern and one reader.

    Attributes:
        sensor: the simulated sensor.
        layout: the pattern, with its outline's middle at the origin, the cameras' target.
        reader: "contours" or "saddles" for a square pattern, "colors" for a triangular one.
        preset: the extractor's preset, for a triangular pattern.
    """

    sensor: SimulatedSensor
    layout: Layout
    reader: str
    preset: Preset = "balanced"

    @cached_property
    def reference(self) -> Reference:
        """The same pattern as the extractor's layout."""
        from cmpdesign.files.layout_json import layout_to_json
        from extractor.layout.layout_file import parse_layout

        parsed = parse_layout(layout_to_json(self.layout_as_designed))
        return replace(parsed, xy_mm=self.layout.marker_xy_mm, outline_mm=self.layout.outline_mm)

    @cached_property
    def layout_as_designed(self) -> Layout:
        """The layout with marker 0 at the origin."""
        return _shift_layout(self.layout, -self.layout.marker_xy_mm[0])

    @property
    def half_window_mm(self) -> float:
        """Half the larger side of the pattern."""
        return 0.5 * max(self.layout.size_mm)

    @property
    def pitch_mm(self) -> float:
        """The layout's pitch."""
        return float(self.layout.parameters["pitch_mm"])

    @cached_property
    def edge_px(self) -> float:
        """The median length of the edges in the picture at rest."""
        flat = np.column_stack([self.layout.marker_xy_mm, np.zeros(len(self.layout.marker_xy_mm))])
        ends = [view.project(flat)[self.layout.edges] for view in self.sensor.rig.views]
        return float(np.median([np.linalg.norm(end[:, 1] - end[:, 0], axis=1) for end in ends]))

    def picture(
        self, conditions: ImagingConditions, seed: int, surface: Callable[[Points], Points] | None = None
    ) -> Rendered:
        """The camera's picture, with its truth.

        Args:
            conditions: light, blur, noise and dirt.
            seed: the picture's seed.
            surface: (N, 2) mm to (N, 3) mm; None: flat.
        """
        from cmpdesign.scene import Optics, Scene, Sensor, render

        scene = Scene(
            layout=self.layout,
            camera=self.sensor.cameras,
            surface=surface,
            medium=self.sensor.medium,
            light=conditions.light,
            optics=Optics(conditions.blur_px),
            sensor=Sensor(noise=conditions.noise, response=self.sensor.response),
            damage=conditions.damage,
            seed=seed,
        )
        return render(scene, size=self.sensor.size_px)

    def read(self, image: NDArray[Any]) -> tuple[Markers, ...]:
        """The markers view by view, in the frame of the whole image."""
        from extractor.space.views import crop_to_view

        found = []
        for view, read in zip(self.sensor.rig.views, self._readers, strict=True):
            origin = view.area_px[:2] if view.area_px else (0, 0)
            found.append(read(crop_to_view(image, view)).moved((float(origin[0]), float(origin[1]))))
        return tuple(found)

    @cached_property
    def reconstructor(self) -> Reconstructor:
        """A reconstructor with poses from a picture at rest, under mean conditions and with its own noise."""
        from extractor.space.reconstruction import Reconstructor
        from extractor.space.rig import Rig

        rest = self.read(self.picture(mean_conditions(self.sensor.table.conditions), REST_SEED).image)
        views = [
            replace(view, R_camera_from_layout=None, t_camera_from_layout_mm=None)
            for view in self.sensor.rig.views
        ]
        return Reconstructor(self.reference, Rig(tuple(views)), rest)

    @cached_property
    def _readers(self) -> list[Callable[[NDArray[Any]], Markers]]:
        if self.reader == "colors":
            from extractor import Extractor

            # a design may have its front or its back towards the sensor
            extract = Extractor(self.reference, self.preset, self.sensor.response, "either").extract
            return [extract] * len(self.sensor.rig.views)
        return [_make_square_reader(self, view) for view in self.sensor.rig.views]


def _make_square_reader(instrument: Instrument, view: View) -> Callable[[NDArray[Any]], Markers]:
    """A square pattern's reader for one view; the direction of the rows is known from the picture at rest."""
    from cmpdesign.evaluate.square.contour_reader import SquareReader
    from cmpdesign.evaluate.square.saddle_reader import SaddleReader

    step_mm = instrument.pitch_mm
    cross = np.array([[0, 0, 0], [step_mm, 0, 0], [0, -step_mm, 0]])
    middle_px, right_px, down_px = view.project(cross)
    axes = np.array([right_px - middle_px, down_px - middle_px])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    kind = SaddleReader if instrument.reader == "saddles" else SquareReader
    reader = kind(instrument.layout, instrument.edge_px, axes, instrument.sensor.response)
    return lambda image: markers_from_places(reader.read(image), instrument.layout)


def markers_from_places(xy_px: Points, layout: Layout) -> Markers:
    """The extractor's result type for positions (M, 2) px, NaN where lost."""
    from extractor.result import Markers, Reason, VirtualStatus

    known = np.isfinite(xy_px[:, 0])
    share = ((np.arange(layout.virtual_per_edge) + 1) / (layout.virtual_per_edge + 1))[:, None]
    start, end = (xy_px[layout.edges[:, side], None] for side in (0, 1))
    virtual = start * (1 - share) + end * share
    covariance = np.where(known[:, None, None], np.eye(2) * SQUARE_SIGMA_PX**2, np.nan)
    weight = (1 - share) ** 2 + share**2
    virtual_covariance = np.where(np.isfinite(virtual)[..., None], weight[..., None] * np.eye(2), np.nan)
    status = np.where(np.isfinite(virtual[..., 0]), VirtualStatus.INTERPOLATED, VirtualStatus.LOST)
    return Markers(
        xy_px=xy_px,
        cov_px2=covariance,
        status=known.astype(np.uint8),
        virtual_xy_px=virtual,
        virtual_cov_px2=SQUARE_SIGMA_PX**2 * virtual_covariance,
        virtual_status=status.astype(np.uint8),
        mirrored=None,
        reason=None if known.any() else Reason.REFERENCE_LOST,
        timings_ms=MappingProxyType({}),
    )


def centre_layout(layout: Layout) -> Layout:
    """The layout moved so that the middle of its outline lies at the origin."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    return _shift_layout(layout, -0.5 * (low + high))


def _shift_layout(layout: Layout, by_mm: Points) -> Layout:
    """The layout moved by (2,) mm, rounded to 1e-9 mm."""
    return replace(
        layout,
        marker_xy_mm=np.round(layout.marker_xy_mm + by_mm, 9) + 0.0,
        outline_mm=np.round(layout.outline_mm + by_mm, 9) + 0.0,
    )


@lru_cache(maxsize=8)
def instrument_for_method(sensor_text: str, method: str, preset: Preset = "balanced") -> Instrument:
    """The instrument of a method: "square", "square_saddles" or "multicolor", with the sensor's own patterns."""
    sensor = parse_sensor(sensor_text)
    pattern = sensor.pattern("multicolor" if method.startswith("multicolor") else "square")
    design = Design.model_validate(dict(pattern))
    return instrument_for_design(sensor, design, preset, saddles=method == "square_saddles")


def instrument_for_design(
    sensor: SimulatedSensor, design: Design, preset: Preset = "balanced", *, saddles: bool = False
) -> Instrument:
    """A design on a sensor, with the reader for its cells."""
    layout = centre_layout(build_layout(design))
    if layout.cell_corners.shape[1] == 3:
        return Instrument(sensor, layout, "colors", preset)
    return Instrument(sensor, layout, "saddles" if saddles else "contours", preset)
