"""``cmpdesign calibrate camera``: a camera's lens from pictures of a sheet with the pattern."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.calibration import calibrate_camera
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, printable_path, say, say_table

if TYPE_CHECKING:
    from cmpdesign.documents.calibration import CalibrateCameraDocument

EXAMPLES = (
    "cmpdesign calibrate camera layout.json sheet -o camera.toml",
    'cmpdesign calibrate camera layout.json "sheet/*.png" -o camera.toml --json',
)
USEFUL_GAIN = (
    0.7  # rays' deviation with one more view over the present one, from which the view is worth naming
)


@derived(calibrate_camera, "reading pictures")
def camera(done: CalibrateCameraDocument) -> None:
    """A picture that does not agree with the others is left out, with a reason."""
    print_step("the pictures are read, the camera is fitted")
    _print_figures(done)
    for path in done.written:
        say(f"wrote {printable_path(path)}")


def _print_figures(done: CalibrateCameraDocument) -> None:
    used = [one for one in done.pictures if not one.cause]
    fx, fy, cx, cy = (
        f"{done.parameters[name]:.3f} +- {done.deviations[name]:.3f}" for name in list(done.parameters)[:4]
    )
    say_table(
        {
            "pictures": f"{len(used)} of {len(done.pictures)}, {sum(one.points for one in used)} points",
            "model": f"{done.model}, read with response {done.response}",
            "focal length": f"{fx}, {fy} px",
            "principal point": f"{cx}, {cy} px",
            "residuals": f"{done.rms_px:.4f} px per axis, {done.scale:.2f} stated deviations",
            "rays": f"{done.ray_px:.4f} px per axis over the image, standard deviation",
            "sheet": f"bent by {done.sheet_bend_mm:.2f} mm" if done.sheet_bend_mm else "flat",
        }
    )
    for one in done.pictures:
        if one.rms_px is None:
            print_warning(f"{one.picture} is {one.cause}")
        elif one.cause:
            print_warning(f"{one.picture} is left out, {one.rms_px:.2f} px: {one.cause}")
    if done.held:
        print_warning(f"not determined, held at usual values: {', '.join(done.held)}")
    if done.further_view_ray_px < USEFUL_GAIN * done.ray_px:
        say(
            f"one more view would help: {done.further_view}: rays {done.ray_px:.4f} -> "
            f"{done.further_view_ray_px:.4f} px"
        )
