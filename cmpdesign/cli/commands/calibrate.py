"""``cmpdesign calibrate``: properties of one sensor, measured from its pictures."""

from __future__ import annotations

from cmpdesign import documents
from cmpdesign.api import calibration, workshop
from cmpdesign.cli.command import new_group
from cmpdesign.cli.derived import command
from cmpdesign.cli.records import print_maps, print_parts, print_rows
from cmpdesign.cli.terminal import EXIT_NEGATIVE, print_warning, say

LARGEST_RESIDUAL_Z = 2.0
LARGEST_SCALE = 3.0  # residuals over their stated deviations, as of a rest frame of reconstruct
LARGEST_MIRROR_SHIFT_MM = 0.2

CAMERA = "cmpdesign calibrate camera layout.json sheet -o camera.toml"
PATTERN = "cmpdesign calibrate pattern layout.json rest -o made.json"
app = new_group("Measure the properties of one sensor from its pictures.", CAMERA, PATTERN)


@command(
    app,
    calibration.calibrate_camera,
    "reading pictures",
    CAMERA,
    'cmpdesign calibrate camera layout.json "sheet/*.png" -o camera.toml --json',
)
def camera(done: documents.calibration.CalibrateCameraDocument) -> None:
    """A picture that does not agree with the others is left out, with a reason."""
    print_maps(done, "parameters deviations")
    print_rows(done, "model response rms_px scale ray_px sheet_bend_mm held further_view further_view_ray_px")
    for one in done.pictures:
        if one.rms_px is None:
            print_warning(f"{one.picture} is {one.cause}")
        elif one.cause:
            print_warning(f"{one.picture} is left out, {one.rms_px:.2f} px: {one.cause}")
    used = [one.points for one in done.pictures if not one.cause]
    say(f"{len(used)} of {len(done.pictures)} pictures agree, {sum(used)} points")


@command(
    app,
    calibration.calibrate_check,
    "reading pictures",
    "cmpdesign calibrate check index.toml pad.png",
    layout=None,
)
def check(done: documents.calibration.CalibrateCheckDocument) -> int:
    """Exit code 1: the calibration does not hold."""
    print_rows(
        done, "cameras views force ages_days rms_px stated_px misfit picture_misfits limit_px depth_error"
    )
    told = [(name, camera.notes) for name, camera in done.cameras.items()]
    for name, texts in [*told, *((name, view.hints) for name, view in done.views.items())]:
        for text in texts:
            print_warning(f"{name}: {text}")
    if done.holds:
        say("the calibration holds")
        return 0
    print_parts(done.causes, "cause left")
    print_warning(f"the calibration does not hold; likely cause: {'; or '.join(done.found)}")
    for one in done.causes:
        if one.likely:
            say(", ".join(f"{name} {value:+.4g}" for name, value in one.changes.items()))
    for step in done.steps:
        say(f"do: {step}")
    return EXIT_NEGATIVE


@command(app, workshop.calibrate_force, "reading the run", "cmpdesign calibrate force run.npz weights.csv")
def force(done: documents.reading.CalibrateForceDocument) -> None:
    """Thickness and marker depth are not fitted: an error of them is part of the modulus."""
    say(f"young_mpa = {done.young_mpa:.4g}\nyoung_sigma_mpa = {done.young_sigma_mpa:.2g}")
    print_rows(done, "bias_n bias_sigma_n weights residual_z")
    if done.residual_z > LARGEST_RESIDUAL_Z:
        print_warning(
            f"the weights differ from a line by {done.residual_z:.1f} stated deviations, limit "
            f"{LARGEST_RESIDUAL_Z:g}; check masses, frames, thickness and marker depth"
        )


@command(
    app,
    workshop.calibrate_gel,
    "solving the block",
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz",
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz --margin-mm 2",
)
def gel(done: documents.reading.CalibrateGelDocument) -> None:
    """The file depends on thickness, Poisson's ratio and marker depth, not on Young's modulus."""
    print_rows(done, "loads markers thickness_mm poisson marker_depth_mm margin_mm")


@command(
    app,
    calibration.calibrate_pattern,
    "reading pictures",
    PATTERN,
    'cmpdesign calibrate pattern layout.json "rest/*.png" -o made.json --json',
)
def pattern(done: documents.reading.CalibratePatternDocument) -> None:
    """Position, turn, size, shear and perspective of the whole pad are not determined."""
    print_rows(
        done,
        "pictures side present measured residual_z worst_picture worst_picture_z worst_picture_rms_px scatter_mm "
        "deviation_mm",
    )


@command(
    app,
    calibration.calibrate_rig,
    "reading pictures",
    "cmpdesign calibrate rig layout.json measured.toml pad.png -o thumb.toml",
)
def rig(done: documents.calibration.CalibrateRigDocument) -> None:
    """The written file holds all of RIG, and is a RIG itself: its deviations reach all displacements of reconstruct."""
    print_maps(done, "parameters stated deviations")
    print_rows(done, "rms_px scale depth_share held mirrors")
    for pair in done.mirrors:
        if abs(pair.shift_mm) > LARGEST_MIRROR_SHIFT_MM:
            print_warning(
                f"views {pair.views[0]} and {pair.views[1]} are shifted by {pair.shift_mm:.2f} mm along the line of "
                f"their mirrors, limit {LARGEST_MIRROR_SHIFT_MM:g} mm: plane mirrors do not do this; check the lens, "
                "and that the views share one camera"
            )
    if done.scale > LARGEST_SCALE:
        print_warning(
            f"the markers at rest lie {done.scale:.1f} deviations from their places, limit {LARGEST_SCALE:g}; "
            "deviations are enlarged by this factor; check the layout, the lens and [medium]"
        )
