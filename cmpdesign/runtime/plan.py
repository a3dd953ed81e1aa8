"""What a running sensor computes, by its file and the wanted outputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

from cmpdesign.inputs.cameras import CameraSettings
from cmpdesign.inputs.files import path_exists
from cmpdesign.inputs.names import nearest_name
from cmpdesign.inputs.sources import SourceKind, name_sources
from cmpdesign.sensor.sensor_file import SensorFile
from cmpdesign.sensor.tables import SensorError
from cmpdesign.tracking.jobs.force_readers import contact_reader, contact_tracker
from cmpdesign.tracking.sources import Reading, open_named, split_list

if TYPE_CHECKING:
    from collections.abc import Callable

    from cmpdesign.tracking.sources import FrameSource
    from extractor import ContactTracker, Markers, Reference, ShapeTracker, Tracker, ViewExtractor
    from extractor.contact import ContactReader

OUTPUTS = ("markers", "virtual", "shape", "contact")


@dataclass(frozen=True, eq=False)
class CameraPlan:
    """A camera or another source.

    Attributes:
        name: for messages.
        identity: the same for two names of one camera.
        open: opens it.
    """

    name: str
    identity: str
    open: Callable[[], FrameSource]


@dataclass(frozen=True, eq=False)
class SensorPlan:
    """The work of a sensor.

    Attributes:
        name: of the sensor: its file's name without the ending.
        file: the sensor file.
        layout: the pad; without virtual markers, if these are not wanted.
        contact: reads forces; None: not wanted.
        has_shape: the surface is read, as that of several views is.
        cameras: one for all views, or one for each.
    """

    name: str
    file: SensorFile
    layout: Reference
    contact: ContactReader | None
    has_shape: bool
    cameras: tuple[CameraPlan, ...]

    @cached_property
    def _views(self) -> ViewExtractor:
        from extractor import ViewExtractor

        return ViewExtractor(self.layout, self.file.rig, "accurate", cast(Any, self.file.table.response))

    def first_tracker(self, image: Any) -> Tracker | ContactTracker | ShapeTracker | None:
        """The tracker for which the pattern is at rest in an image; None where a view does not show the pattern.

        Args:
            image: one image, or one for each camera.
        """
        if not self.has_shape:
            return self.tracker(None)
        found = self._views.extract(image)
        return self.tracker(found) if all(markers.found for markers in found) else None

    def tracker(self, rest: Sequence[Markers] | None) -> Tracker | ContactTracker | ShapeTracker:
        """A new tracker.

        Args:
            rest: the markers of each view at rest; None: those of the first frame, not for a surface.

        Raises:
            PoseError: views that cannot be placed by the markers at rest.
        """
        from extractor import Reconstructor, ShapeTracker, Tracker
        from extractor.space.views import side_shown

        response = cast(Any, self.file.table.response)
        if self.has_shape:
            reconstructor = Reconstructor(self.layout, self.file.rig, rest)
            return ShapeTracker(reconstructor, response=response, contact=self.contact)
        alone, side = None if rest is None else rest[0], side_shown(self.layout, self.file.rig.views[0])
        tracker = Tracker(self.layout, rest=alone, response=response, side=side)
        if self.contact is None:
            return tracker
        return contact_tracker(tracker, self.file.path, self.contact, alone)


def plan_of(file: SensorFile, outputs: Iterable[str] | None) -> SensorPlan:
    """The work of a sensor.

    Args:
        file: names camera, layout, and for forces the gel.
        outputs: of ``OUTPUTS``; None: all that the file allows, without virtual markers.

    Raises:
        SensorError: the file lacks what an output needs, its rig was calibrated with another pad, or there is no such
            output.
        SourceError: no such camera, or several.
    """
    from extractor import load_layout

    table, views = file.table, len(file.rig.views)
    wanted = set(_allowed(file) if outputs is None else outputs)
    for name in sorted(wanted - set(OUTPUTS)):
        raise SensorError(
            f"{file.path}: there is no output {name!r}{nearest_name(name, OUTPUTS)}; there are {', '.join(OUTPUTS)}"
        )
    if "shape" in wanted and views < 2:
        raise SensorError(f"{file.path} has {views} [[view]]; shape needs two or more: leave shape out")
    gel = file.gel if "contact" in wanted else None
    if "contact" in wanted and gel is None:
        raise SensorError(
            f"{file.path}: [elastomer] names no gel, which contact needs: cmpdesign calibrate gel, or leave contact out"
        )
    if not table.camera.source:
        raise SensorError(
            f'{file.path}: [camera] names no source; give the camera\'s number or name: source = "0"'
        )
    layout = load_layout(file.layout)
    file.require_layout(layout)
    if "virtual" not in wanted:
        layout = replace(layout, virtual_per_edge=0)
    return SensorPlan(
        file.path.stem,
        file,
        layout,
        None if gel is None else contact_reader(gel, file.path, layout),
        views > 1,
        _cameras(file, views),
    )


def _allowed(file: SensorFile) -> list[str]:
    has = {"markers": True, "shape": len(file.rig.views) > 1, "contact": file.gel is not None}
    return [name for name, is_possible in has.items() if is_possible]


def _cameras(file: SensorFile, views: int) -> tuple[CameraPlan, ...]:
    """The cameras; files are named relative to the sensor file."""
    names = split_list(file.table.camera.source)
    if len(names) not in (1, views):
        raise SensorError(
            f"{file.path}: [camera] source names {len(names)} cameras for {views} [[view]]; give one for all views, or "
            "one for each"
        )
    return tuple(_camera(file, name.strip()) for name in names)


def _camera(file: SensorFile, name: str) -> CameraPlan:
    beside = file.path.parent / name
    (source,) = name_sources([str(beside) if path_exists(beside) else name])
    how = Reading(camera=file.table.camera_settings if source.kind is SourceKind.CAMERA else CameraSettings())
    identity = source.address or ", ".join(str(path.resolve()) for path in source.paths)
    return CameraPlan(source.name, identity, partial(open_named, source, how))
