"""``cmpdesign kerf``: measures the kerf in a photo or scan of a cut coupon."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.api import workshop
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import finish, print_step, printable_path, say, say_columns

if TYPE_CHECKING:
    from cmpdesign.products.laser.coupon.design import Coupon
    from cmpdesign.products.laser.coupon.photo import CouponReading, PatchKerf
    from cmpdesign.products.laser.grid.reading import FieldReading, GridReading

EXAMPLES = ("cmpdesign kerf coupon.json scan.png", "cmpdesign kerf grid.json photo.jpg --json")


@derived(workshop.kerf)
def kerf(coupon: Path, photo: Path, **options: Any) -> None:
    """A grid of settings is read, too. The lines for the material's file are printed."""
    from cmpdesign.products.laser.coupon.design import load_coupon

    cut_coupon, done = load_coupon(coupon), workshop.kerf(coupon, photo, **options)
    if cut_coupon.kind == "grid":
        _print_grid(cut_coupon, done.found, photo)
    else:
        print_step(f"{printable_path(photo)} is read")
        _print_kerfs(cut_coupon, done.found, photo)
    finish(lambda: done)


def _print_grid(grid: Coupon, reading: GridReading, photo: Path) -> None:
    """Print a grid's table, and the lines for the material's file."""
    counts = sorted({passes for one in reading.fields for passes in one.states})
    headings = ("field", ">power", ">speed", *(f">{count} x" for count in counts), ">depth a pass")
    rows = []
    for one in reading.fields:
        windows = [_window_text(one, count) for count in counts]
        settings = (f"{one.power_percent:g} %", f"{one.speed_mm_s:g} mm/s")
        rows.append((one.name, *settings, *windows, _depth_text(one.depth_per_pass_mm)))
    say_columns(headings, rows)
    if reading.best is None:
        say("\nno field cuts through with a pass in reserve: raise the power, or lower the speed")
    else:
        say(
            f"\nfor the file of {grid.material}, the settings of {grid.machine}: the quickest with a pass in reserve"
        )
        say(_settings_lines(reading.best, photo.name), soft_wrap=True)


def _window_text(one: FieldReading, count: int) -> str:
    if one.states[count] != "marked":
        return one.states[count]
    low, high = one.depths_mm[count]
    return f"{low:.2g} to {high:.2g} mm" if low else f"to {high:.2g} mm"


def _depth_text(depth: tuple[float, float]) -> str:
    low, high = depth
    if high == float("inf"):
        return f"above {low:.3g} mm"
    return f"{low:.3g} to {high:.3g} mm" if low else f"below {high:.3g} mm"


def _settings_lines(one: FieldReading, photo: str) -> str:
    """The settings that cut, with one number of passes in reserve."""
    assert one.passes is not None
    reserve = min(count for count in one.states if count > one.passes)
    source = json.dumps(f"grid {one.name}, {photo}: through with {one.passes} passes", ensure_ascii=False)
    values = {
        "cut_power_percent": f"{one.power_percent:g}",
        "cut_speed_mm_s": f"{one.speed_mm_s:g}",
        "cut_passes": str(reserve),
    }
    return "\n".join(f"{name} = {{ value = {value}, source = {source} }}" for name, value in values.items())


def _print_kerfs(coupon: Coupon, reading: CouponReading, photo: Path) -> None:
    """Print a coupon's table, and the lines for the material's file."""
    side = "back" if reading.from_back else "front"
    say(
        f"seen from the {side}, {reading.scale_px_mm:.1f} px in a mm, marks fit to {1000 * reading.fit_mm:.1f} um, "
        f"light: {reading.response}"
    )
    assumed = ", which is assumed" if coupon.taper_assumed else ""
    say(
        f"the picture shows the openings of the {reading.face}; the other face by a taper of {coupon.taper_deg:g} "
        "degrees"
        f"{assumed}, through {coupon.thickness_mm:g} mm"
    )
    rows = []
    for one in reading.patches:
        patch = one.patch
        faces = [reading.at_face(face, width) for face in ("front", "back") for width in (one.x, one.y)]
        sigma_mm = max(one.x.sigma_mm, one.y.sigma_mm)
        settings = (f"{patch.power_percent:g} %", f"{patch.speed_mm_s:g} mm/s", str(patch.passes))
        rows.append((patch.name, *settings, f"{sigma_mm:.4f}", *(f"{width.value_mm:.4f}" for width in faces)))
    numbers = ("power", "speed", "times over", "+-", "front x", "front y", "back x", "back y")
    say_columns(("patch", *(f">{name}" for name in numbers)), rows)
    say("kerfs in mm; x of cuts along y, y of cuts along x")
    say(f"\nfor the file of {coupon.material}, the settings of {coupon.machine}:")
    for patch_kerf in reading.patches:
        say(_material_file_lines(reading, patch_kerf, photo.name), soft_wrap=True)


def _material_file_lines(reading: CouponReading, patch_kerf: PatchKerf, photo: str) -> str:
    """The lines of the material's file for one patch: the kerf at the front, and both faces in its source."""
    patch = patch_kerf.patch
    lines = [f"# {patch.name}: {patch.power_percent:g} %, {patch.speed_mm_s:g} mm/s, {patch.passes} times"]
    for axis, width in (("x", patch_kerf.x), ("y", patch_kerf.y)):
        front, back = reading.at_face("front", width), reading.at_face("back", width)
        text = (
            f"coupon {patch.name}, {photo}: front {front.value_mm:.4f} mm, back {back.value_mm:.4f} mm, "
            f"{reading.face} seen, +- {width.sigma_mm:.4f} mm"
        )
        source = json.dumps(text, ensure_ascii=False)
        lines.append(f"kerf_{axis}_mm = {{ value = {front.value_mm:.4f}, source = {source} }}")
    return "\n".join(lines)
