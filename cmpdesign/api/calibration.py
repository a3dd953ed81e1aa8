"""Calibrations of one sensor: ``calibrate camera``, ``calibrate rig`` and ``calibrate check`` of the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from cmpdesign.api.layouts import reference_from
from cmpdesign.api.workshop import read_pictures
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.watch import tell

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.calibration.camera import CameraCalibration
    from cmpdesign.calibration.rig.calibration import RigCalibration
    from cmpdesign.calibration.rig.check import SensorCheck
    from cmpdesign.layout.layout import Layout as AnyLayout
    from cmpdesign.sensor.sensor_file import SensorFile
    from extractor import LayoutLike, Markers, Reference, Rig, Side
    from extractor.presets import Preset

Response = Literal["srgb", "linear"] | float


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """The result of ``calibrate_camera``.

    Attributes:
        calibration: the camera, its covariance, the verdicts on the pictures.
        response: relation of light and values with which the pictures were read.
        unread: picture -> reason, of the pictures that show no sheet.
        written: the files.
    """

    calibration: CameraCalibration
    response: Response
    unread: dict[str, str]
    written: tuple[Path, ...] = ()


def calibrate_camera(
    layout: LayoutLike | AnyLayout,
    images: str | Path | Sequence[str | Path] | Sequence[NDArray[Any]],
    output: str | Path | None = None,
    *,
    preset: Preset = "balanced",
    response: Response | None = None,
    max_pixels: int = MOST_PIXELS,
) -> CalibratedCamera:
    """Calibrate a camera from pictures of a flat sheet with the pattern, as the command ``calibrate camera`` does.

    >>> camera = cmpdesign.calibrate_camera("layout.json", "sheet/", "camera.toml")
    >>> camera.calibration.camera.focal_px, camera.calibration.ray_px

    Args:
        layout: the sheet's layout: a layout, the path of a layout file, a ``Reference``, or its JSON object.
        images: 3 or more color pictures, better 15: files, folders of files, patterns such as "sheet/*.png", or arrays
            (H, W, 3) BGR.
        output: TOML file to write; OpenCV's and ROS' YAML files and a picture are written beside the file. None: none.
        preset: see ``extractor.Extractor``.
        response: relation of light and values; None: the one under which the pictures agree best.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no camera follows.
        OutputError: a file cannot be written.
    """
    from cmpdesign.calibration.camera import calibrate_points
    from cmpdesign.calibration.pictures import SheetPictures, read_sheets
    from cmpdesign.calibration.response import likely_response
    from extractor import Extractor

    if output is not None and Path(output).suffix.lower() != ".toml":
        raise CmpDesignError(f"{output}: unknown ending of a camera file; expected .toml")
    given = [images] if isinstance(images, str | Path) else images
    names, pictures = read_pictures(given, max_pixels)
    reference = reference_from(layout)

    def read(one: Response | None, wanted: Sequence[str] | None = None) -> SheetPictures:
        extractor = Extractor(reference, preset, one)
        kept = [i for i, name in enumerate(names) if wanted is None or name in wanted]
        some, called = [pictures[i] for i in kept], [names[i] for i in kept]
        return read_sheets(reference, some, called, extractor, partial(tell, unit="pictures"))

    found = read(response)
    if not found.sightings and found.unread:
        name, reason = next(iter(found.unread.items()))
        raise CmpDesignError(
            f"no picture shows the sheet: {name}: {reason}; check that LAYOUT is the sheet's, and look at one picture "
            "with: cmpdesign verify LAYOUT PICTURE"
        )
    calibration = calibrate_points(found.sheet, found.sightings, found.size_px)
    used: Response = response or "srgb"
    if response is None and all(picture.dtype.itemsize == 1 for picture in pictures):
        used, calibration = likely_response(calibration, read)
    result = CalibratedCamera(calibration, used, found.unread)
    return result if output is None else _written(result, Path(output), names)


def calibrate_rig(
    layout: LayoutLike | AnyLayout,
    rig: str | Path,
    rest: str | Path | Sequence[str | Path],
    output: str | Path | None = None,
    *,
    steps: Mapping[float, str | Path] | None = None,
    step_sigma_mm: float = 0.002,
    side: Side = "designed",
    max_pixels: int = MOST_PIXELS,
) -> RigCalibration:
    """Calibrate a sensor's views, window and gel from its pad at rest, as the command ``calibrate rig`` does.

    >>> found = cmpdesign.calibrate_rig("layout.json", "measured.toml", ["rest.png"], "sensor.toml")
    >>> found.held, found.depth_share

    Args:
        layout: the pad's layout: a layout, the path of a layout file, a ``Reference``, or its JSON object.
        rig: rig or sensor file: lenses, the measured [medium] and its [medium_deviation], and where it is known the
            camera's [calibration.camera]. Poses in the file are not used.
        rest: pictures of the pad at rest; of several cameras one for each view, joined by commas.
        output: sensor file to write, beside ``rig``; None: none.
        steps: ways of a flat plate that presses the pattern, mm -> picture.
        step_sigma_mm: standard deviation of a way.
        side: see ``extractor.Extractor``.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no rig follows.
        OutputError: the file cannot be written.
    """
    import numpy as np

    from cmpdesign.calibration.rig.calibration import calibrate_rig_markers
    from cmpdesign.sensor.sensor_file import load_sensor_file

    sensor, reference = load_sensor_file(rig), reference_from(layout)
    if output is not None:
        _require_beside(Path(rig), Path(output))
    given = [rest] if isinstance(rest, str | Path) else list(rest)
    ways = dict(steps or {})
    names = [*map(str, given), *map(str, ways.values())]
    found = _read_views(sensor, reference, sensor.rig.without_poses(), names, side, max_pixels)
    camera = sensor.table.calibration.camera
    calibration = calibrate_rig_markers(
        reference,
        sensor.rig,
        found[: len(given)],
        dict(zip(ways, found[len(given) :], strict=True)),
        camera_cov=np.array(camera.covariance) if camera is not None and camera.covariance else None,
        step_sigma_mm=step_sigma_mm,
    )
    if output is not None:
        from cmpdesign.calibration.outputs.sensor_text import calibrated_text
        from cmpdesign.files.atomic import write_file

        dated = [name for whole in names[: len(given)] for name in whole.split(",")]
        text = calibrated_text(sensor, calibration, len(given), tuple(ways), _date_of(dated))
        write_file(Path(output), text)
    return calibration


def calibrate_check(
    sensor: str | Path,
    images: str | Path | Sequence[str | Path],
    *,
    layout: LayoutLike | AnyLayout | None = None,
    max_pixels: int = MOST_PIXELS,
) -> SensorCheck:
    """Compare pictures of a sensor's pad at rest with its calibration, as the command ``calibrate check`` does.

    >>> found = cmpdesign.calibrate_check("sensor.toml", ["today.png"])
    >>> found.holds, found.misfit, found.likely, found.steps

    Args:
        sensor: the sensor file that ``calibrate rig`` wrote.
        images: pictures of the pad at rest; of several cameras one for each view, joined by commas.
        layout: the pad's layout; None: the one that the file names.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures that show no pattern.
    """
    from cmpdesign.calibration.rig.check import check_markers
    from cmpdesign.sensor.sensor_file import load_sensor_file

    file = load_sensor_file(sensor)
    unplaced = [view.name for view in file.rig.views if not view.placed]
    if unplaced:
        raise CmpDesignError(
            f"{sensor}: view {unplaced[0]!r} has no pose, so that there is nothing to compare; first: cmpdesign "
            "calibrate rig"
        )
    reference = reference_from(file.layout if layout is None else layout)
    names = [str(images)] if isinstance(images, str | Path) else [str(one) for one in images]
    found = _read_views(file, reference, file.rig, names, "designed", max_pixels)
    before = file.table.calibration.rig
    stated = before.rms_px if before is not None and len(before.rms_px) == len(file.rig.views) else ()
    return check_markers(
        reference,
        file.rig,
        found,
        stated_px=dict(zip(file.rig.names, stated, strict=False)),
        scale=before.scale if before is not None else 1.0,
        limit_px=file.table.limits.max_rest_error_px,
    )


def _require_beside(rig: Path, output: Path) -> None:
    if output.suffix.lower() != ".toml":
        raise CmpDesignError(f"{output}: unknown ending of a sensor file; expected .toml")
    if output.resolve() == rig.resolve():
        raise CmpDesignError(
            f"{output} is RIG itself, whose measured values a further calibration needs; choose another name"
        )
    if output.resolve().parent != rig.resolve().parent:
        raise CmpDesignError(
            f"{output}: write the file beside {rig}, since files are named relative to its folder"
        )


def _read_views(
    sensor: SensorFile, reference: Reference, rig: Rig, names: Sequence[str], side: Side, max_pixels: int
) -> list[tuple[Markers, ...]]:
    """The markers of all pictures, view by view; ``rig`` is the sensor's, with or without poses.

    Raises:
        CmpDesignError: a picture in which a view shows no pattern.
    """
    from cmpdesign.files.images import read_image
    from extractor import ViewExtractor
    from extractor.result import SIDE_REASONS

    views = ViewExtractor(reference, rig, "accurate", cast("Any", sensor.table.response), side)
    out = []
    for number, name in enumerate(names):
        pictures = [read_image(Path(part), max_pixels) for part in name.split(",")]
        markers = views.extract(pictures if len(pictures) > 1 else pictures[0])
        for view, one in zip(sensor.rig.views, markers, strict=True):
            if not one.found:
                hint = (
                    f"; check which views are mirrored, or state {parameter('side')}"
                    if one.reason in SIDE_REASONS
                    else ""
                )
                raise CmpDesignError(f"{name}: view {view.name!r} shows no pattern: {one.reason}{hint}")
        out.append(markers)
        tell(number + 1, len(names), unit="pictures")
    return out


def _written(result: CalibratedCamera, output: Path, names: Sequence[str]) -> CalibratedCamera:
    from cmpdesign.calibration.outputs.camera_files import camera_toml, opencv_yaml, ros_yaml
    from cmpdesign.calibration.outputs.ray_picture import ray_picture
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import to_png

    found = result.calibration
    contents: dict[Path, str | bytes] = {
        output: camera_toml(found, result.response, _date_of(names)),
        output.with_suffix(".opencv.yaml"): opencv_yaml(found),
        output.with_suffix(".ros.yaml"): ros_yaml(found),
        output.with_suffix(".png"): to_png(ray_picture(found)),
    }
    for path, content in contents.items():
        write_file(path, content)
    return CalibratedCamera(found, result.response, result.unread, tuple(contents))


def _date_of(names: Sequence[str]) -> str | None:
    """The day on which the newest picture was written, YYYY-MM-DD; None without files."""
    times = [Path(name).stat().st_mtime for name in names if Path(name).is_file()]
    return datetime.fromtimestamp(max(times), UTC).date().isoformat() if times else None
