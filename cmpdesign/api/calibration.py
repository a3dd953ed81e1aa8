"""Calibrations of one sensor: ``calibrate camera``, ``pattern``, ``rig`` and ``check`` of the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from cmpdesign import documents
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import MAX_PIXELS, require_suffix
from cmpdesign.inputs.options import Preset, Response, Side, Written
from cmpdesign.watch import tell, warn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.calibration.camera import CameraCalibration
    from cmpdesign.inputs.cameras import CameraState
    from cmpdesign.sensor.sensor_file import SensorFile
    from extractor import LearntLayout, Markers, Reference, Rig

MAX_WAY_MM = 100  # of a step
# RMS per axis; well above the scatter of a made pad (0.01), below that of a round pattern read as honeycomb (0.2).
MAX_USUAL_SCATTER_PITCHES = 0.1


def calibrate_camera(
    layout: AnyLayout,
    images: str | Path | Sequence[str | Path] | Sequence[NDArray[Any]],
    output: Annotated[str | Path | None, Written(needed=True)] = None,
    *,
    preset: Preset = "balanced",
    response: Response | None = None,
    max_pixels: int = MAX_PIXELS,
) -> documents.calibration.CalibrateCameraDocument:
    """Calibrate a camera: focal lengths, principal point, distortion, with covariances. Take pictures at many tilts.

    >>> camera = cmpdesign.calibrate_camera("layout.json", "sheet/", "camera.toml")
    >>> camera.parameters, camera.ray_px, camera.found.cov

    Args:
        layout: the layout.json of the sheet; or a layout, a ``Reference``, the JSON object of a layout file.
        images: 3 or more color pictures of one flat sheet, better 15, folders, or patterns such as "sheet/*.png"; or
            arrays (H, W, 3) BGR.
        output: camera file to write: .toml, with .opencv.yaml, .ros.yaml and .png beside the file; None: none.
        preset, max_pixels: see ``SequenceOptions``.
        response: response of the camera; with an exponent, light is value ** exponent; None: the one under which the
            pictures agree best.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no camera follows.
        OutputError: a file cannot be written.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.calibration.camera import calibrate_points
    from cmpdesign.calibration.pictures import SheetPictures, read_sheets
    from cmpdesign.calibration.response import likely_response
    from extractor import Extractor

    require_suffix("output", output, ".toml")
    names, pictures = read_pictures(images, max_pixels)
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
    written = () if output is None else _write_camera(calibration, used, Path(output), names)
    view, parameters = calibration.camera, calibration.model.names
    values = view.focal_px + view.centre_px + view.distortion
    deviations = calibration.cov.diagonal() ** 0.5
    unread = [
        {"picture": name, "points": 0, "rms_px": None, "cause": f"not read: {reason}"}
        for name, reason in found.unread.items()
    ]
    return documents.calibration.CalibrateCameraDocument.of(
        calibration,
        written=written,
        response=used,
        size_px=found.size_px,
        model=calibration.model.name,
        scale=calibration.adjusted.base,
        sheet_bend_mm=calibration.bend_mm,
        further_view=calibration.advice.text,
        further_view_ray_px=calibration.advice.ray_px,
        parameters=dict(zip(parameters, values, strict=True)),
        deviations=dict(zip(parameters, deviations.tolist(), strict=True)),
        pictures=[*calibration.pictures, *unread],
    )


def calibrate_pattern(
    layout: AnyLayout,
    images: str | Path | Sequence[str | Path] | Sequence[NDArray[Any]],
    output: Annotated[str | Path | None, Written(needed=True)] = None,
    *,
    preset: Preset = "accurate",
    response: Response | None = None,
    max_pixels: int = MAX_PIXELS,
) -> documents.reading.CalibratePatternDocument:
    """Measure the places of one pad's markers. Read the pad's pictures with the written layout.

    >>> made = cmpdesign.calibrate_pattern("layout.json", "at_rest/", "made.json")
    >>> extractor.Extractor("made.json")                  # reads this pad with its own places

    Args:
        layout: the pattern's nominal layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        images: 10 or more color pictures of one pad at rest, folders, or patterns such as "rest/*.png"; or arrays
            (H, W, 3) BGR.
        output: layout file to write, with the measured places of the markers: .json; None: none.
        preset, response, max_pixels: see ``SequenceOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no places follow.
        OutputError: the layout file cannot be written.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.files.layout_json import write_layout
    from cmpdesign.reading.read_layout import layout_from_reference
    from extractor import learn_layout

    require_suffix("output", output, ".json")
    _require_other(output, layout, "the nominal layout itself")
    names, pictures = read_pictures(images, max_pixels)
    learnt = learn_layout(
        reference_from(layout),
        pictures,
        names=names,
        watch=partial(tell, unit="pictures"),
        preset=preset,
        response=response,
    )
    if output is not None:
        write_layout(layout_from_reference(learnt.layout), Path(output))
    return _pattern_document(learnt, str(output or ""))


def _pattern_document(learnt: LearntLayout, written: str) -> documents.reading.CalibratePatternDocument:
    import numpy as np

    made, worst = learnt.layout.as_made, int(learnt.picture_z.argmax())
    assert made is not None and made.covariance_mm2 is not None
    variance = made.covariance_mm2[learnt.measured].trace(axis1=1, axis2=2) / 2
    ends_mm = learnt.layout.xy_mm[learnt.layout.edges]
    scatter = learnt.scatter_mm / float(np.linalg.norm(ends_mm[:, 1] - ends_mm[:, 0], axis=1).mean())
    if scatter > MAX_USUAL_SCATTER_PITCHES:
        warn(
            f"the markers lie {scatter:.2f} pitches per axis from their nominal places, limit "
            f"{MAX_USUAL_SCATTER_PITCHES:g}; check that {parameter('layout')} is this pad's, unless the lens "
            "distorts strongly"
        )
    present, measured = int(learnt.layout.present.sum()), int(learnt.measured.sum())
    if measured < present:
        warn(
            f"{present - measured} of {present} markers are measured in no picture and stay at their "
            "nominal places; show the whole pad in some pictures"
        )
    return documents.reading.CalibratePatternDocument.of(
        learnt,
        written=written,
        pictures=len(learnt.picture_z),
        side=made.side,
        present=present,
        measured=measured,
        residual_z=float(learnt.z),
        worst_picture=worst,
        worst_picture_z=float(learnt.picture_z[worst]),
        worst_picture_rms_px=float(learnt.picture_rms_px[worst]),
        scatter_mm=float(learnt.scatter_mm),
        deviation_mm=float(np.sqrt(variance.mean())),
    )


def calibrate_rig(
    layout: AnyLayout,
    rig: str | Path,
    rest: str | Path | Sequence[str | Path],
    output: Annotated[str | Path | None, Written(needed=True)] = None,
    *,
    steps: Annotated[
        Mapping[float, str | Path] | None,
        Written(name="--step", metavar="MM=PICTURE", example="0.5=plate.png"),
    ] = None,
    step_sigma_mm: Annotated[float, Written(metavar="MM", least=1e-6)] = 0.002,
    side: Side = "designed",
    max_pixels: int = MAX_PIXELS,
) -> documents.calibration.CalibrateRigDocument:
    """Calibrate the views, the window and the gel of a sensor. What remains undetermined is stated and named.

    >>> found = cmpdesign.calibrate_rig("layout.json", "measured.toml", ["rest.png"], "sensor.toml")
    >>> found.held, found.depth_share

    Args:
        layout: the pad's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        rig: rig or sensor file with lenses and the measured [medium], [medium_deviation], and where it is known the
            camera's [calibration.camera]. Poses in the file are not used.
        rest: pictures of the pad at rest; of several cameras one each, joined by commas.
        output: sensor file to write, beside ``rig``: .toml; None: none.
        steps: a flat plate has pressed the pattern by MM; give two or more; or a mapping, mm -> picture.
        step_sigma_mm: standard deviation of the way of a step.
        side, max_pixels: see ``SequenceOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no rig follows.
        OutputError: the file cannot be written.
    """
    import numpy as np

    from cmpdesign.api.layouts import reference_from
    from cmpdesign.calibration.rig.calibration import calibrate_rig_markers
    from cmpdesign.sensor.sensor_file import load_sensor_file

    ways = dict(steps or {})
    for way_mm in ways:
        if not -MAX_WAY_MM <= way_mm <= MAX_WAY_MM:
            raise CmpDesignError(f"{parameter('steps')}: a way of {way_mm:g} mm, limit {MAX_WAY_MM} mm")
    require_suffix("output", output, ".toml")
    sensor, reference = load_sensor_file(rig), reference_from(layout)
    _require_other(output, rig, "RIG itself, whose measured values a further calibration needs")
    if output is not None and Path(output).resolve().parent != Path(rig).resolve().parent:
        raise CmpDesignError(
            f"{output}: write the file beside {rig}, since files are named relative to its folder"
        )
    given = [rest] if isinstance(rest, str | Path) else list(rest)
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
        text = calibrated_text(sensor, calibration, reference, len(given), tuple(ways), _date_of(dated))
        write_file(Path(output), text)
    return documents.calibration.CalibrateRigDocument.of(
        calibration,
        written=str(output or ""),
        pictures=len(given),
        steps_mm=tuple(ways),
        **calibration.by_name(),
    )


def calibrate_check(
    sensor: str | Path,
    images: Annotated[str | Path | Sequence[str | Path], Written(metavar="REST")] = (),
    *,
    layout: AnyLayout | None = None,
    max_pixels: int = MAX_PIXELS,
) -> documents.calibration.CalibrateCheckDocument:
    """Check a sensor by its pad at rest: cameras, light, focus, markers read, residuals, force scale, ages.

    If the calibration does not hold, the cause and the step to repeat are named.

    >>> found = cmpdesign.calibrate_check("sensor.toml", ["today.png"])
    >>> found.holds, found.misfit, [one.cause for one in found.causes if one.likely], found.steps

    Args:
        sensor: sensor file that calibrate rig wrote; it names its layout.
        images: pictures of the pad at rest; of several cameras one each, joined by commas; None: frames of the sensor's
            own [camera].
        layout: the pad's layout; None: the one that the file names.
        max_pixels: see ``SequenceOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: files or cameras that cannot be read, or pictures that show no
            pattern.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.calibration.rig.check import check_markers
    from cmpdesign.calibration.rig.state import ages_days, camera_states, force_scale, view_states
    from cmpdesign.runtime.opening import look_at_rest
    from cmpdesign.sensor.sensor_file import load_sensor_file

    file = load_sensor_file(sensor)
    unplaced = [view.name for view in file.rig.views if not view.placed]
    if unplaced:
        raise CmpDesignError(
            f"{sensor}: view {unplaced[0]!r} has no pose, so that there is nothing to compare; first: cmpdesign "
            "calibrate rig"
        )
    reference = reference_from(file.layout if layout is None else layout)
    file.require_layout(reference)
    names = [str(images)] if isinstance(images, str | Path) else [str(one) for one in images or ()]
    cameras: Mapping[str, CameraState | None] = {}
    if names:
        found = _read_views(file, reference, file.rig, names, "designed", max_pixels)
    else:
        live = look_at_rest(sensor)
        found, cameras, names = [live.markers], live.cameras, [file.table.camera.source]
    before = file.table.calibration.rig
    stated = before.rms_px if before is not None and len(before.rms_px) == len(file.rig.views) else ()
    return check_markers(
        reference,
        file.rig,
        dict(zip(names, found, strict=True)),
        stated_px=dict(zip(file.rig.names, stated, strict=False)),
        scale=before.scale if before is not None else 1.0,
        limit_px=file.table.limits.max_rest_error_px,
        views=view_states(file, reference, found[-1]),
        cameras=camera_states(cameras),
        force=force_scale(file, reference),
        ages_days=ages_days(file, date.today()),
    )


def _require_other(output: str | Path | None, given: object, what: str) -> None:
    """Check that the file to write is not the given one."""
    given_file = Path(given).resolve() if isinstance(given, str | Path) else None
    if output is not None and Path(output).resolve() == given_file:
        raise CmpDesignError(f"{output} is {what}; choose another name")


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


def _write_camera(
    found: CameraCalibration, response: Response, output: Path, names: Sequence[str]
) -> tuple[str, ...]:
    from cmpdesign.calibration.outputs.camera_files import camera_toml, opencv_yaml, ros_yaml
    from cmpdesign.calibration.outputs.ray_picture import ray_picture
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import to_png

    contents: dict[Path, str | bytes] = {
        output: camera_toml(found, response, _date_of(names)),
        output.with_suffix(".opencv.yaml"): opencv_yaml(found),
        output.with_suffix(".ros.yaml"): ros_yaml(found),
        output.with_suffix(".png"): to_png(ray_picture(found)),
    }
    for path, content in contents.items():
        write_file(path, content)
    return tuple(map(str, contents))


def read_pictures(
    images: str | Path | Sequence[str | Path] | Sequence[NDArray[Any]], max_pixels: int
) -> tuple[list[str], list[NDArray[Any]]]:
    """The names and the pixels of pictures; a folder or a pattern stands for its pictures."""
    from cmpdesign.files.images import read_image
    from cmpdesign.inputs.sources import picture_paths

    names: list[str] = []
    pictures: list[NDArray[Any]] = []
    for image in [images] if isinstance(images, str | Path) else images:
        if not isinstance(image, str | Path):
            names.append(f"picture {len(names) + 1}")
            pictures.append(image)
            continue
        for path in picture_paths([str(image)]):
            names.append(str(path))
            pictures.append(read_image(path, max_pixels))
    return names, pictures


def _date_of(names: Sequence[str]) -> str | None:
    """The day on which the newest picture was written, YYYY-MM-DD; None without files."""
    times = [Path(name).stat().st_mtime for name in names if Path(name).is_file()]
    return datetime.fromtimestamp(max(times), UTC).date().isoformat() if times else None
