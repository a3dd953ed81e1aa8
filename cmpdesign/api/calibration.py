"""Calibrations of one sensor's cameras: ``calibrate camera`` of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cmpdesign.api.layouts import reference_from
from cmpdesign.api.workshop import read_pictures
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.watch import tell

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.calibration.camera import CameraCalibration
    from cmpdesign.layout.layout import Layout as AnyLayout
    from extractor import LayoutLike
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
