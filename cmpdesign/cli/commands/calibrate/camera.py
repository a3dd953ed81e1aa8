"""``cmpdesign calibrate camera``: a camera's lens from pictures of a sheet with the pattern."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.options.images import MaxPixelsOption, PresetOption
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.options.response import METAVAR, parse_reading_response
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.api.calibration import CalibratedCamera

EXAMPLES = (
    "cmpdesign calibrate camera layout.json sheet -o camera.toml",
    'cmpdesign calibrate camera layout.json "sheet/*.png" -o camera.toml --json',
)
USEFUL_GAIN = (
    0.7  # rays' deviation with one more view over the present one, from which the view is worth naming
)


def camera(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The layout.json of the sheet.")],
    images: Annotated[
        list[str],
        typer.Argument(
            metavar="IMAGE",
            help='3 or more color pictures of one flat sheet, better 15, folders, or patterns such as "sheet/*.png".',
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Camera file to write: .toml; .opencv.yaml, .ros.yaml and .png are written beside the file.",
        ),
    ],
    preset: PresetOption = "balanced",
    response: Annotated[
        str | None,
        typer.Option(
            metavar=METAVAR,
            help="Response of the camera; with an exponent, light is value ** exponent. "
            "[default: the one under which the pictures agree best]",
        ),
    ] = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Calibrate a camera: focal lengths, principal point, distortion, with covariances. Take pictures at many tilts."""
    from cmpdesign.api.calibration import calibrate_camera
    from cmpdesign.documents.calibration import CalibrateCameraDocument
    from cmpdesign.watch import watched

    require_suffix("--output", output, [".toml"])
    known = parse_reading_response(response)
    with working("reading pictures") as steps, watched(steps.tell):
        result = calibrate_camera(
            layout, images, output, preset=preset, response=known, max_pixels=max_pixels
        )
    print_step("the pictures are read, the camera is fitted")
    _print_figures(result)
    for path in result.written:
        say(f"wrote {printable_path(path)}")
    written = tuple(map(printable_path, result.written))
    finish(lambda: CalibrateCameraDocument(written=written, **_figures(result)))


def _figures(result: CalibratedCamera) -> dict[str, Any]:
    """The fields of ``CalibrateCameraDocument`` that describe the camera."""
    found = result.calibration
    view, names = found.camera, found.model.names
    values = view.focal_px + view.centre_px + view.distortion
    pictures = [
        {"picture": one.name, "points": one.points, "rms_px": one.rms_px, "cause": one.cause}
        for one in found.pictures
    ]
    pictures += [
        {"picture": name, "points": 0, "rms_px": None, "cause": f"not read: {reason}"}
        for name, reason in result.unread.items()
    ]
    return {
        "size_px": found.adjusted.problem.size_px,
        "model": found.model.name,
        "response": result.response,
        "parameters": dict(zip(names, values, strict=True)),
        "deviations": dict(zip(names, map(float, found.cov.diagonal() ** 0.5), strict=True)),
        "held": found.held,
        "rms_px": found.rms_px,
        "scale": found.adjusted.base,
        "ray_px": found.ray_px,
        "sheet_bend_mm": found.bend_mm,
        "further_view": found.advice.text,
        "further_view_ray_px": found.advice.ray_px,
        "pictures": pictures,
    }


def _print_figures(result: CalibratedCamera) -> None:
    import numpy as np
    from rich.table import Table

    found = result.calibration
    view, deviations = found.camera, np.sqrt(found.cov.diagonal())
    (fx, fy), (cx, cy) = view.focal_px, view.centre_px
    used = [one for one in found.pictures if one.used]
    rows = {
        "pictures": f"{len(used)} of {len(found.pictures) + len(result.unread)}, "
        f"{sum(one.points for one in used)} points",
        "model": f"{found.model.name}, read with response {result.response}",
        "focal length": f"{fx:.3f} +- {deviations[0]:.3f}, {fy:.3f} +- {deviations[1]:.3f} px",
        "principal point": f"{cx:.3f} +- {deviations[2]:.3f}, {cy:.3f} +- {deviations[3]:.3f} px",
        "residuals": f"{found.rms_px:.4f} px per axis, {found.adjusted.base:.2f} stated deviations",
        "rays": f"{found.ray_px:.4f} px per axis over the image, standard deviation",
        "sheet": f"bent by {found.bend_mm:.2f} mm" if found.bend_mm else "flat",
    }
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
    for one in found.pictures:
        if not one.used:
            print_warning(f"{one.name} is left out, {one.rms_px:.2f} px: {one.cause}")
    for name, reason in result.unread.items():
        print_warning(f"{name} is not read: {reason}")
    if found.held:
        print_warning(f"not determined, held at usual values: {', '.join(found.held)}")
    if found.advice.ray_px < USEFUL_GAIN * found.ray_px:
        say(
            f"one more view would help: {found.advice.text}: rays {found.ray_px:.4f} -> {found.advice.ray_px:.4f} px"
        )
